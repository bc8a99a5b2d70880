"""The same tasks on a Dask cluster that is there already.

Where tasks run, what becomes of those of a lost worker, and how often they are tried is Dask's. It
is sent JSON alone, and never more tasks at a time than keep its workers busy.
"""

import asyncio
import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from itertools import islice
from typing import TYPE_CHECKING, Any

import attest
from attest.batch import rows, served
from attest.batch.child import Job
from attest.batch.rows import Row
from attest.batch.task import Task
from attest.batch.urls import EXTRA
from attest.errors import AttestError, ConfigError

if TYPE_CHECKING:
    from distributed import Client

PATIENCE_S = 8.0
"""For a scheduler to answer."""
PROTOCOLS = ("tcp", "tls", "ws", "wss", "ucx")
RETRIES = 2
"""Of a task whose process ended, on this worker or another."""
AHEAD = 2
"""Tasks at the scheduler for each that runs."""
LEAST = 16
"""Tasks at the scheduler, so that a cluster that grows with its work has a reason to."""


class ClusterError(AttestError):
    """There is no cluster to work with."""


def run(tasks: Iterator[Task], address: str, job: Job) -> Iterator[Row]:
    """Run tasks on a cluster, and yield their rows as they end; leaving the iterator ends them.

    Raises
    ------
    ConfigError
        A library is missing, the address is none, or a worker has another version of attest.
    ClusterError
        The scheduler does not answer, or is gone.
    """
    with _connected(address) as client:
        try:
            yield from _ended(client, tasks, job, address)
        finally:
            with suppress(Exception):  # they end by themselves
                client.run(served.end, job.token, on_error="ignore")


@contextmanager
def _connected(address: str) -> "Iterator[Client]":
    if address.partition("://")[0] not in PROTOCOLS:
        raise ConfigError(f"--cluster {address}: name a Dask scheduler, such as tcp://host:8786.")
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigError(f"--cluster: {error}: {EXTRA}.") from error
    for name in ("distributed", "distributed.client", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what matters is told in a line
    try:
        asyncio.run(asyncio.wait_for(_answer(address), PATIENCE_S))
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except Exception as error:  # of sockets, of TLS, or of Dask
        raise ClusterError(
            f"--cluster {address}: no Dask scheduler answers there in {PATIENCE_S:g} s. Start one "
            "(`dask scheduler`), or check the address."
        ) from error
    with client:
        yield client


async def _answer(address: str) -> None:
    """Ask a scheduler who it is; a client that finds none takes long to go away."""
    from distributed import Security, rpc

    arguments = Security().get_connection_args("client")
    async with rpc(address, connection_args=arguments) as scheduler:
        await scheduler.identity()


def _ended(client: "Client", tasks: Iterator[Task], job: Job, address: str) -> Iterator[Row]:
    """Keep the workers busy, and yield what comes of each task."""
    from distributed import as_completed

    told = json.dumps(asdict(job))
    under_way: dict[str, Task] = {}
    futures = as_completed(with_results=True, raise_errors=False, loop=client.loop)
    numbered = enumerate(tasks)
    while True:
        with _telling(address):
            room = max(LEAST, AHEAD * sum(client.nthreads().values())) - len(under_way)
        for number, task in islice(numbered, max(room, 0)):
            key, line = f"attest-{job.token}-{number}", json.dumps(asdict(task))
            under_way[key] = task
            what = (attest.__version__, told, line)
            with _telling(address):
                futures.add(client.submit(served.run, *what, key=key, retries=RETRIES, pure=False))
        if not under_way:
            return
        with _telling(address):
            future, outcome = next(futures)
        yield from _rows(under_way.pop(future.key), future.status, outcome, address)


@contextmanager
def _telling(address: str) -> Iterator[None]:
    """Tell in one line that the scheduler is gone, which Dask does in many ways."""
    try:
        yield
    except Exception as error:
        raise _gone(address) from error


def _gone(address: str) -> ClusterError:
    return ClusterError(
        f"--cluster {address}: the scheduler is gone. Run it again: what is done is kept."
    )


def _rows(task: Task, status: str, outcome: Any, address: str) -> Iterator[Row]:
    """Yield what became of a task."""
    if status == "finished":
        yield from map(json.loads, outcome)
        return
    error = outcome[1] if status == "error" else outcome
    if isinstance(error, AttestError):
        raise ClusterError(f"--cluster {address}: {error}")
    if isinstance(error, ImportError):
        raise ClusterError(
            f"--cluster {address}: a worker cannot run attest: {error}. Install attest "
            f"{attest.__version__} where the workers are."
        )
    if status != "error":
        raise _gone(address)
    for label in task.observers:
        row = rows.unfinished(task, label, "crashed", _cause(error))
        yield row | {"sha256": None, "total_s": None}


def _cause(error: Exception) -> str:
    """Say what ended a task again and again."""
    if type(error).__name__ == "KilledWorker":
        return "the workers that ran it were lost, one after another. See the workers' logs."
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}. See the workers' logs."
