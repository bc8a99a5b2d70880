"""Rerun recording (.rrd): what happened, to look at, with the layout inside.

Rerun stores rotations as float32; the MCAP is the lossless output. Its row ids are random, so equal
runs give equal content but not equal bytes.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from attest.files import replacing
from attest.result import Result
from attest.writers.json import to_json

PROBE = 1 << 20
"""Bytes by which to find out why a file cannot grow."""


def write_rerun(path: Path, result: Result) -> None:
    """Write the run as a recording that opens with its own layout.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    # the library takes most of a second to import, and only this needs it
    with _quiet():
        from attest.writers.rerun_recording import record

    with replacing(path) as part:
        try:
            record(part, result, recording_id(result))
        except RuntimeError as error:
            raise _refusal(part, error) from error


def recording_id(result: Result) -> str:
    """Name a run by its log, observer and configuration, so that it opens as the same recording."""
    log = result.summary.get("log")
    identity = log.get("sha256") if isinstance(log, dict) else None
    what = [identity or str(result.recording.path), result.estimates.observer]
    return str(uuid5(NAMESPACE_URL, to_json([*what, result.configuration])))


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library, which reads this when it is imported, from logging what it also raises."""
    before = os.environ.get("RUST_LOG")
    os.environ["RUST_LOG"] = before or "off"
    try:
        yield
    finally:
        if before is None:
            del os.environ["RUST_LOG"]


def _refusal(part: Path, error: RuntimeError) -> OSError:
    """Find out from the system why the library, which does not say, could not write."""
    try:
        with part.open("ab") as file:
            file.write(bytes(PROBE))
    except OSError as refusal:
        return refusal
    return OSError(errno.EIO, str(error))
