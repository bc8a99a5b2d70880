"""Processes that run tasks, of which any may die at any moment.

Each has a pipe of its own, and no lock is shared: what dies holds up no other. A process runs one
task at a time, so that it is known which one ended it, and is then replaced.
"""

import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic

from attest.batch import rows
from attest.batch.resume import Limits
from attest.batch.rows import Row
from attest.batch.task import Task
from attest.batch.worker import Settings, scratch_of, work
from attest.errors import AttestError

STARTS = 3
"""Workers in a row that may die before they are ready."""


class WorkerError(AttestError):
    """No worker comes to its first log."""


@dataclass(slots=True, eq=False)
class _Worker:
    """A process, and what it is doing."""

    process: BaseProcess
    connection: Connection
    scratch: Path | None
    ready: bool = False
    task: Task | None = None
    began: float = 0.0
    sha256: str | None = None
    left: list[str] = field(default_factory=list)
    """Observers of the task that have not ended."""

    def begin(self, task: Task) -> None:
        self.task, self.began, self.sha256 = task, monotonic(), None
        self.left = list(task.observers)
        try:
            self.connection.send(task)
        except OSError:  # dead: its pipe will tell, and the task is not to blame
            self.task = None

    def end(self) -> int | None:
        """Kill the process, and return the exit code that it had or has now."""
        self.process.kill()
        self.process.join()
        code = self.process.exitcode
        self.process.close()
        self.connection.close()
        if self.scratch is not None:
            shutil.rmtree(self.scratch, ignore_errors=True)
        return code


def run(tasks: Iterator[Task], jobs: int, settings: Settings, limits: Limits) -> Iterator[Row]:
    """Run tasks in processes, and yield their rows as they end.

    The first process is alone until it is ready: it compiles for all of them.

    Raises
    ------
    WorkerError
        The processes die before they are ready.
    """
    pool = _Pool(tasks, settings, limits)
    try:
        pool.start()
        while pool.workers:
            if pool.proven:
                while len(pool.workers) < jobs and pool.has_more():
                    pool.start()
            yield from pool.step()
    finally:
        for worker in pool.workers:
            worker.end()


class _Pool:
    """The processes, and the tasks that none of them has."""

    def __init__(self, tasks: Iterator[Task], settings: Settings, limits: Limits) -> None:
        self.workers: list[_Worker] = []
        self.proven = False
        """Whether a worker was ready once."""
        self._tasks, self._settings, self._limits = tasks, settings, limits
        self._next: Task | None = None
        self._died = 0

    def has_more(self) -> bool:
        """Whether there is a task that no worker has."""
        if self._next is None:
            self._next = next(self._tasks, None)
        return self._next is not None

    def start(self) -> None:
        """Start a process."""
        context = get_context("spawn")  # fork would copy locks of the threads of libraries
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, self._settings), daemon=True)
        with _deaf():
            process.start()
        theirs.close()
        scratch = self._settings.scratch
        its = scratch_of(scratch, process.pid) if scratch and process.pid else None
        self.workers.append(_Worker(process, ours, its))

    def step(self) -> Iterator[Row]:
        """Wait until something happens, and yield what ended by it."""
        for worker in self._heard():
            try:
                message = worker.connection.recv()
            except (EOFError, OSError):
                yield from self._dead(worker)
            else:
                yield from self._told(worker, message)
        now = monotonic()
        for worker in [w for w in self.workers if self._deadline(w) <= now]:
            yield from self._replaced(worker, "timeout", self._late)

    def _heard(self) -> list[_Worker]:
        first = min(map(self._deadline, self.workers))
        patience = None if first == float("inf") else max(0.0, first - monotonic())
        heard = wait([worker.connection for worker in self.workers], patience)
        return [worker for worker in self.workers if worker.connection in heard]

    def _deadline(self, worker: _Worker) -> float:
        if worker.task is None or self._limits.timeout_s is None:
            return float("inf")
        return worker.began + self._limits.timeout_s

    def _told(self, worker: _Worker, message: object) -> Iterator[Row]:
        """Take in what a worker says: ready, its log's digest, a row, or the end of its task."""
        match message:
            case "ready":
                worker.ready = self.proven = True
                self._died = 0
                self._hand_out(worker)
            case ("log", str(sha256)):
                worker.sha256 = sha256
            case dict():
                worker.left.remove(message["observer"])
                yield message | self._allowed()
            case "retire":
                worker.task = None
                yield from self._replaced(worker, "memory", _cause)
            case _:
                self._hand_out(worker)

    def _hand_out(self, worker: _Worker) -> None:
        worker.task = None
        if self.has_more() and self._next is not None:
            worker.begin(self._next)
            self._next = None
        else:
            self._retire(worker)

    def _retire(self, worker: _Worker) -> None:
        self.workers.remove(worker)
        worker.end()

    def _dead(self, worker: _Worker) -> Iterator[Row]:
        if not worker.ready:
            self._died += 1
        yield from self._replaced(worker, "crashed", _cause)

    def _replaced(
        self, worker: _Worker, status: str, why: Callable[[int | None], str]
    ) -> Iterator[Row]:
        """End a worker, yield what its task has come to, and start another if it is needed.

        In this order: whether it is may take a while to be known.
        """
        self.workers.remove(worker)
        cause = why(worker.end())
        if self._died >= STARTS:
            raise WorkerError(f"no worker comes to its first log: {cause}")
        if worker.task is not None:
            told = {"sha256": worker.sha256, "total_s": round(monotonic() - worker.began, 4)}
            for label in worker.left:
                yield rows.unfinished(worker.task, label, status, cause) | told | self._allowed()
        if self.has_more() or not self.proven:
            self.start()

    def _late(self, _: int | None) -> str:
        return f"not done in {self._limits.timeout_s:g} s. Raise --timeout, or cut the log."

    def _allowed(self) -> Row:
        return {"timeout_s": self._limits.timeout_s, "memory_gb": self._limits.memory_gb}


@contextmanager
def _deaf() -> Iterator[None]:
    """Let a process that is started not hear Ctrl-C, which is for us, from its first moment on."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cause(code: int | None) -> str:
    """Say how a process ended."""
    if code is None or code >= 0:
        return f"the worker ended with exit code {code}. Report it with the log."
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if name == "SIGKILL":
        return "the worker was killed, as the system does when memory runs out. Lower --jobs."
    return f"the worker died of {name}. Report it with the log."
