"""A process that runs one log after another, and ends with the one that started it."""

import ctypes
import os
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from pathlib import Path

from attest.batch import task as tasks
from attest.batch import temporary

PR_SET_PDEATHSIG = 1
GB = 10**9


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What a worker is told at its start."""

    kernels: str | None
    """Where compiled code is kept; None: where numba keeps it."""
    memory_gb: float | None
    """How much it may take beside what it takes before its first log."""
    prepare: tuple[Callable[[], object], ...]
    """Called before the first log, so that this is not counted as its time."""
    scratch: str | None = None
    """For temporary files, in a folder of each worker's own; None: where the system keeps them."""


@contextmanager
def scratch() -> Iterator[str | None]:
    """Give a folder for `Settings.scratch`; None where there is no room for one."""
    with ExitStack() as stack:
        try:
            folder = str(stack.enter_context(temporary.folder()))
        except OSError:
            folder = None
        yield folder


def scratch_of(scratch: str, pid: int) -> Path:
    """Return the folder of a worker's temporary files, which outlive one that is killed."""
    return Path(scratch, str(pid))


def work(connection: Connection, settings: Settings) -> None:
    """Run each task that comes, and send its rows, then None, or "retire" where this must end."""
    _end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears it, and ends us
    warnings.simplefilter("ignore", RuntimeWarning)  # of hostile logs, as on the command line
    if settings.kernels is not None:
        os.environ["NUMBA_CACHE_DIR"] = settings.kernels
    if settings.scratch is not None:
        _keep_below(scratch_of(settings.scratch, os.getpid()))
    for prepare in settings.prepare:
        prepare()
    if settings.memory_gb is not None:
        _bound(settings.memory_gb)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):  # the parent is gone
        _serve(connection)


def _serve(connection: Connection) -> None:
    connection.send("ready")
    broken = False  # what a refusal of memory leaves is in pieces: then begin anew
    while not broken:
        for row in tasks.run(connection.recv(), lambda sha256: connection.send(("log", sha256))):
            connection.send(row)
            broken = broken or row["status"] == "memory"
        connection.send("retire" if broken else None)


def _end_with_parent() -> None:
    """End at once when the parent ends, however it does, and also while a library does not return.

    The system does it on Linux; elsewhere a thread does, when the library lets it.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.join,), daemon=True).start()


def _follow(parent_ends: Callable[[], object]) -> None:
    parent_ends()
    os._exit(1)


def _keep_below(folder: Path) -> None:
    """Keep temporary files in a folder."""
    with suppress(OSError):  # then the first log tells
        folder.mkdir(parents=True, exist_ok=True)
    tempfile.tempdir = str(folder)


def _bound(memory_gb: float) -> None:
    """Let the system refuse more memory than this beside what is taken now; only Linux does."""
    if sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + int(memory_gb * GB)
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
