"""A batch: what is done already is left, the rest is run, and each end is written down."""

import hashlib
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from attest import config
from attest.batch import cluster, kernels, pool, resume, store, urls, worker
from attest.batch.child import Job
from attest.batch.find import Log
from attest.batch.journal import Journal
from attest.batch.resume import Limits, Wanted
from attest.batch.rows import Row
from attest.batch.task import Task
from attest.batch.worker import Settings
from attest.config import Configuration
from attest.errors import ConfigError
from attest.writers import KINDS


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How to run a batch."""

    configurations: Mapping[str, Configuration]
    """The observers, by label."""
    output: Path
    """Of the journal, the summary and the page, and of the results unless they are elsewhere."""
    results: str | None = None
    """A URL for the results."""
    cluster: str | None = None
    """The address of a Dask scheduler; None: processes of this machine."""
    kinds: tuple[str, ...] = KINDS
    """What is written beside the JSON."""
    jobs: int = 0
    """Logs that are run at the same time; 0: as many as there are processors."""
    limits: Limits = field(default_factory=Limits)
    force: bool = False
    """Do again what is done."""
    retry: bool = False
    """Do again what did not end well."""
    prepare: tuple[Callable[[], object], ...] = ()
    """Called in each worker before its first log."""


def place(output: str, journal: Path | None) -> dict[str, Any]:
    """Return the fields of a plan that say where its results and its journal are.

    Raises
    ------
    ConfigError
        The URL is not known, or there is a folder for the journal, which is with the results.
    """
    where = urls.checked(output)
    if not urls.is_url(where):
        if journal is not None:
            raise ConfigError("--journal: the journal is in the --output, unless that is a URL.")
        return {"output": Path(where)}
    name = re.sub(r"[^\w.-]+", "-", where.rstrip("/"))[:100]
    digest = hashlib.sha256(where.rstrip("/").encode()).hexdigest()[:6]
    folder = journal or Path("attest_out", f"{name}-{digest}")
    return {"output": folder, "results": where.rstrip("/")}


def run(logs: Sequence[Log], plan: Plan, journal: Journal) -> Iterator[tuple[Row, bool]]:
    """Yield a row for each log and observer as it ends, and whether it was done before.

    A row that is yielded is on the disk. Leaving the iterator ends the workers.

    Raises
    ------
    WriteError
        The journal cannot be written, or the results.
    """
    digests = {label: resume.digest(each) for label, each in plan.configurations.items()}
    wanted = Wanted(
        is_there=_looked(plan),
        digests=digests,
        kinds=plan.kinds,
        limits=plan.limits,
        retry=plan.retry,
    )
    tasks = []
    for log in logs:
        missing = list(plan.configurations)
        for label in () if plan.force else plan.configurations:
            row = resume.still_good(journal, log, label, wanted)
            if row is not None:
                missing.remove(label)
                yield row, True
        if missing:
            tasks.append((log, tuple(missing)))
    if tasks:
        if plan.results is not None:
            store.begin(plan.results)
        for row in _run(tasks, plan, digests):
            journal.append([row])
            yield row, False


def _looked(plan: Plan) -> Callable[[str], bool]:
    """Return what tells whether a file is below the output: of a URL, all are listed once."""
    if plan.results is None:
        return lambda path: (plan.output / path).is_file()
    listed = cache(partial(store.there, plan.results))
    return lambda path: path in listed()


def _run(
    missing: Sequence[tuple[Log, tuple[str, ...]]], plan: Plan, digests: Mapping[str, str]
) -> Iterator[Row]:
    """Run what is missing, and yield its rows as they end."""
    documents = {label: config.effective(each) for label, each in plan.configurations.items()}
    token = uuid4().hex
    tasks = (
        Task(
            log=log.path,
            size=log.size,
            mtime_ns=log.mtime_ns,
            etag=log.etag,
            output=_output(plan),
            folder=log.folder,
            observers={label: documents[label] for label in labels},
            digests={label: digests[label] for label in labels},
            kinds=plan.kinds,
            again=token if plan.force else "",
        )
        for log, labels in missing
    )
    if plan.cluster is not None:
        job = Job(token=token, documents=documents, kinds=plan.kinds, limits=plan.limits)
        yield from cluster.run(tasks, plan.cluster, job)
        return
    with (
        kernels.compilation(documents, plan.kinds) as compile_first,
        worker.scratch() as scratch,
    ):
        settings = Settings(
            kernels=kernels.cache_folder(plan.output),
            memory_gb=plan.limits.memory_gb,
            prepare=(compile_first, *plan.prepare),
            scratch=scratch,
        )
        jobs = min(plan.jobs or os.cpu_count() or 1, len(missing))
        yield from pool.run(tasks, jobs, settings, plan.limits)


def _output(plan: Plan) -> str:
    """Return where results go: of a cluster always a URL, as its workers may try one twice."""
    if plan.results is not None:
        return plan.results
    return f"file://{plan.output.resolve()}" if plan.cluster is not None else str(plan.output)
