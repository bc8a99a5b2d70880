"""Rerun recording (.rrd): what happened, to look at, with the layout inside.

Rerun stores rotations as float32; the MCAP is the lossless output. Its row ids are random, so equal
runs give equal content but not equal bytes.
"""

from collections.abc import Sequence
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from attest.files import replacing
from attest.result import Result
from attest.writers.json import to_json


def write_rerun(path: Path, results: Sequence[Result]) -> None:
    """Write the runs over one log as a recording that opens with its own layout.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    # the library takes most of a second to import, and only this needs it
    from attest.writers.rerun_recording import record

    with replacing(path) as part, part.open("wb") as file:
        record(file, results, recording_id(results))


def recording_id(results: Sequence[Result]) -> str:
    """Name runs by log, observers and configurations, so that they open as the same recording."""
    log = results[0].summary.get("log")
    identity = log.get("sha256") if isinstance(log, dict) else None
    what: list[object] = [identity or str(results[0].recording.path)]
    for result in results:
        what += [result.estimates.observer, result.configuration]
    return str(uuid5(NAMESPACE_URL, to_json(what)))
