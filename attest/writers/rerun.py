"""Rerun recording (.rrd): what happened, to look at, with the layout inside.

Rerun stores rotations as float32; the MCAP is the lossless output. Its row ids are random, so equal
runs give equal content but not equal bytes.
"""

from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from attest.files import replacing
from attest.result import Result
from attest.writers.json import to_json


def write_rerun(path: Path, result: Result) -> None:
    """Write the run as a recording that opens with its own layout.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    # the library takes most of a second to import, and only this needs it
    from attest.writers.rerun_recording import record

    with replacing(path) as part, part.open("wb") as file:
        record(file, result, recording_id(result))


def recording_id(result: Result) -> str:
    """Name a run by its log, observer and configuration, so that it opens as the same recording."""
    log = result.summary.get("log")
    identity = log.get("sha256") if isinstance(log, dict) else None
    what = [identity or str(result.recording.path), result.estimates.observer]
    return str(uuid5(NAMESPACE_URL, to_json([*what, result.configuration])))
