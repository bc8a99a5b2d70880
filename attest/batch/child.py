"""A program that runs the tasks that it is told, one after another: a line of JSON for each row.

It stands between a worker of a cluster, which must not have processes of its own and must not hang,
and the embedded pool, which bounds time and memory of each log. It ends when its input does, and
by itself when it hears nothing for a while.
"""

import json
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO, NoReturn, TextIO

from attest.batch import kernels, pool
from attest.batch.resume import Limits
from attest.batch.task import Task
from attest.batch.worker import Settings, scratch

IDLE_S = 60.0
"""Without a task, after which nobody is thought to send one."""
GRACE_S = 5.0
"""For an end in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What all tasks of a batch have in common; JSON-like."""

    token: str
    """Of this batch alone."""
    documents: Mapping[str, Mapping[str, Any]]
    """The effective configurations, by label."""
    kinds: tuple[str, ...]
    limits: Limits


def job_of(text: str | bytes) -> Job:
    """Return the job that a line of JSON stands for."""
    found = json.loads(text)
    limits = Limits(**found["limits"])
    return replace(Job(**found), kinds=tuple(found["kinds"]), limits=limits)


def task_of(text: str | bytes) -> Task:
    """Return the task that a line of JSON stands for."""
    found = json.loads(text)
    return replace(Task(**found), kinds=tuple(found["kinds"]))


def main() -> None:
    """Run the tasks of the job on the first line of the input."""
    told = sys.stdin.buffer
    out = os.fdopen(os.dup(1), "w", encoding="ascii", buffering=1)
    os.dup2(2, 1)  # what libraries print is no row
    signal.signal(signal.SIGTERM, _end)
    job = job_of(told.readline())
    lines: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(told, lines), daemon=True).start()
    _serve(job, lines, out)


def _serve(job: Job, lines: "SimpleQueue[bytes]", out: TextIO) -> None:
    with kernels.compilation(job.documents, job.kinds) as compile_first, scratch() as folder:
        settings = Settings(
            kernels=kernels.cache_folder(Path(folder or tempfile.gettempdir())),
            memory_gb=job.limits.memory_gb,
            prepare=(compile_first,),
            scratch=folder,
        )
        rows = pool.run(_tasks(lines), 1, settings, job.limits)
        out.writelines(json.dumps(row) + "\n" for row in rows)


def _tasks(lines: "SimpleQueue[bytes]") -> Iterator[Task]:
    while True:
        try:
            yield task_of(lines.get(timeout=IDLE_S))
        except Empty:
            return


def _listen(told: BinaryIO, lines: "SimpleQueue[bytes]") -> None:
    """Take in lines; at their end, end the program, whatever it is doing."""
    for line in told:
        lines.put(line)
    if sys.platform == "win32":
        os._exit(1)
    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
    time.sleep(GRACE_S)
    os._exit(1)


def _end(*_: object) -> NoReturn:
    sys.exit(1)
