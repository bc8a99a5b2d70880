"""A batch: what is done already is left, the rest is run, and each end is written down."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from attest import config
from attest.batch import kernels, pool, resume
from attest.batch.find import Log
from attest.batch.journal import Journal
from attest.batch.resume import Limits, Wanted
from attest.batch.rows import Row
from attest.batch.task import Task
from attest.batch.worker import Settings
from attest.config import Configuration
from attest.writers import KINDS


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How to run a batch."""

    configurations: Mapping[str, Configuration]
    """The observers, by label."""
    output: Path
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


def run(logs: Sequence[Log], plan: Plan, journal: Journal) -> Iterator[tuple[Row, bool]]:
    """Yield a row for each log and observer as it ends, and whether it was done before.

    A row that is yielded is on the disk. Leaving the iterator ends the workers.

    Raises
    ------
    WriteError
        The journal cannot be written.
    """
    digests = {label: resume.digest(each) for label, each in plan.configurations.items()}
    wanted = Wanted(
        output=plan.output,
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
        for row in _run(tasks, plan, digests):
            journal.append([row])
            yield row, False


def _run(
    missing: Sequence[tuple[Log, tuple[str, ...]]], plan: Plan, digests: Mapping[str, str]
) -> Iterator[Row]:
    """Run what is missing, and yield its rows as they end."""
    documents = {label: config.effective(each) for label, each in plan.configurations.items()}
    tasks = (
        Task(
            log=log.path,
            size=log.size,
            mtime_ns=log.mtime_ns,
            output=str(plan.output),
            folder=log.folder,
            observers={label: documents[label] for label in labels},
            digests=digests,
            kinds=plan.kinds,
        )
        for log, labels in missing
    )
    with kernels.compilation(documents, plan.kinds) as compile_first:
        settings = Settings(
            kernels=kernels.cache_folder(plan.output),
            memory_gb=plan.limits.memory_gb,
            prepare=(compile_first, *plan.prepare),
        )
        jobs = min(plan.jobs or os.cpu_count() or 1, len(missing))
        yield from pool.run(tasks, jobs, settings, plan.limits)
