"""What a worker of a Dask cluster does for a batch; called there, by its threads.

A thread has a `child`, which stays for the tasks to come, so that libraries are loaded and kernels
are compiled once. What is sent either way is JSON.
"""

import os
import subprocess
import sys
import threading
from collections import defaultdict, deque
from contextlib import suppress

import attest
from attest.batch.child import job_of, task_of
from attest.errors import ConfigError

_Child = subprocess.Popen[str]

_idle: defaultdict[str, list[_Child]] = defaultdict(list)
_busy: defaultdict[str, set[_Child]] = defaultdict(set)
"""By the batch that they run for."""
_over: deque[str] = deque(maxlen=100)
"""Batches that are at their end, whose last tasks may still come."""
_lock = threading.Lock()


class ChildError(Exception):
    """The process that ran a task has ended."""


def run(version: str, job: str, task: str) -> list[str]:
    """Run a task, and return its rows.

    Raises
    ------
    ConfigError
        This worker has another version.
    ChildError
        The process that ran the task has ended: another may do better.
    """
    if version != attest.__version__:
        raise ConfigError(
            f"a worker has attest {attest.__version__}, and this is {version}. Install the same."
        )
    token = job_of(job).token
    if token in _over:
        raise ChildError("the batch is at its end")
    child = _taken(token) or _started(token, job)
    try:
        rows = list(_answered(child, task))
    except OSError as error:
        raise ChildError("the process that ran the task has ended") from error
    finally:
        with _lock:
            _busy[token].discard(child)
    with _lock:
        over = token in _over
        if not over:
            _idle[token].append(child)
    if over:
        _close(child)
    return rows


def end(token: str) -> None:
    """End what runs for a batch."""
    with _lock:
        _over.append(token)
        children = [*_idle.pop(token, ()), *_busy.pop(token, ())]
    for child in children:
        _close(child)


def _taken(token: str) -> _Child | None:
    """Return a process that waits for a task, if there is one."""
    with _lock:
        while _idle[token]:
            child = _idle[token].pop()
            if child.poll() is None:
                _busy[token].add(child)
                return child
            _close(child)
    return None


def _started(token: str, job: str) -> _Child:
    """Start a process that finds the same modules; a worker's own may have no children."""
    child = subprocess.Popen(
        [sys.executable, "-c", "from attest.batch.child import main; main()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        encoding="ascii",
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        start_new_session=True,  # Ctrl-C is for the worker, which then ends it
    )
    with _lock:
        _busy[token].add(child)
        over = token in _over
    if over:
        _close(child)
    elif child.stdin is not None:
        with suppress(OSError):  # then the task finds it dead
            child.stdin.write(f"{job}\n")
            child.stdin.flush()
    return child


def _answered(child: _Child, task: str) -> list[str]:
    """Send a task, and wait for its rows."""
    if child.stdin is None or child.stdout is None:
        raise ChildError("no pipes")
    child.stdin.write(f"{task}\n")
    child.stdin.flush()
    rows = [child.stdout.readline() for _ in task_of(task).observers]
    if not all(row.endswith("\n") for row in rows):
        _close(child)
        raise ChildError(f"the process that ran the task ended with {child.wait()}")
    return rows


def _close(child: _Child) -> None:
    """Let a process end: it does when its input does."""
    if child.stdin is not None:
        with suppress(OSError):
            child.stdin.close()
