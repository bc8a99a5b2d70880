"""Outputs that are whole or not there.

An output is written beside its final name, under a hidden name that carries the process's id, and
renamed when it is whole and on the disk. A kill or a full disk leaves the old file or none; what a
killed process left behind is removed by the next write of the same name.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from attest.errors import WriteError

ADVICE = {
    errno.ENOSPC: "Free some space, or choose another folder with --output.",
    errno.EDQUOT: "Free some space, or choose another folder with --output.",
    errno.EACCES: "Choose a folder that you may write to with --output.",
    errno.EPERM: "Choose a folder that you may write to with --output.",
    errno.EROFS: "Choose a folder that you may write to with --output.",
}
"""What to do, by the system's error number."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path that becomes `path` when the block ends well.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_stale(path)
        yield part
        _flush_to_disk(part)
        part.replace(path)
    except OSError as error:
        raise refused(path, error) from error
    finally:
        with suppress(OSError):  # already renamed, or never made
            part.unlink()


def _flush_to_disk(path: Path) -> None:
    """Wait until the file's content has reached the disk, so that the name never precedes it."""
    file = os.open(path, os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def _remove_stale(path: Path) -> None:
    """Remove what processes that are gone left behind under this name."""
    start, end = f".{path.name}.", ".part"
    for other in path.parent.iterdir():
        pid = other.name.removeprefix(start).removesuffix(end)
        if other.name == f"{start}{pid}{end}" and pid.isdecimal() and not _runs(int(pid)):
            with suppress(OSError):
                other.unlink()


def _runs(pid: int) -> bool:
    if os.name != "posix":
        return True  # there, signal 0 is not a question but a kill
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # another user's
    return True


def refused(path: Path, error: OSError) -> WriteError:
    """Return what to tell of a file that the system refuses to write."""
    advice = ADVICE.get(error.errno or 0, "Choose another folder with --output.")
    return WriteError(f"{path}: cannot write: {error.strerror or error}. {advice}")
