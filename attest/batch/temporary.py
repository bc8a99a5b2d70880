"""Temporary folders of a batch, which do not stay when it is killed: the next one removes them."""

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

PREFIX = "attest-batch-"
LOCK = ".lock"
YOUNG = 60.0
"""A folder is not looked at for so long: it may not be locked yet, s."""


@contextmanager
def folder() -> Iterator[Path]:
    """Give a folder that is removed at the end, or by a later call where this process is killed.

    Raises
    ------
    OSError
        There is no room for it.
    """
    _remove_abandoned()
    with ExitStack() as stack:
        made = stack.enter_context(
            tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True)
        )
        if sys.platform != "win32":
            import fcntl

            # the system lets go of it however this process ends
            lock = stack.enter_context(Path(made, LOCK).open("wb"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield Path(made)


def _remove_abandoned() -> None:
    """Remove the folders of ours that no process holds."""
    if sys.platform == "win32":  # where a lock does not tell
        return
    for path in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):  # gone, another's, or in use
            if path.stat().st_uid == os.getuid() and time.time() - path.stat().st_mtime > YOUNG:
                _remove_unlocked(path)


def _remove_unlocked(path: Path) -> None:
    import fcntl

    with (path / LOCK).open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        shutil.rmtree(path)
