"""One log through all observers: a function of where the log is, how, and where results go."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from attest import config, observers, pipeline, report
from attest.batch import rows
from attest.batch.find import marked
from attest.batch.rows import Row
from attest.config import Configuration
from attest.errors import AttestError, ReadError
from attest.writers.folders import owners

OUT_OF_MEMORY = "not enough memory for this log. Raise --memory, lower --jobs, or cut the log."


@dataclass(frozen=True, slots=True)
class Task:
    """A log, and what is to be done with it; JSON-like, so that it can be sent anywhere."""

    log: str
    size: int
    mtime_ns: int
    output: str
    """The folder that all results of the batch are below."""
    folder: str
    """Of this log's results, below that."""
    observers: Mapping[str, Mapping[str, Any]]
    """The effective configurations, by label."""
    digests: Mapping[str, str]
    """Of these, by label."""
    kinds: tuple[str, ...]
    """What is written beside the JSON."""


def run(task: Task, tell: Callable[[str], None] | None = None) -> Iterator[Row]:
    """Run a log through its observers, and yield a row for each as it ends.

    The log's digest is told before the log is read: should reading it end the process, it is known
    which content did. No error ends a task: it is told in the row.
    """
    sha256, opened = None, _Opened(Path(task.log))
    for label, document in task.observers.items():
        began = perf_counter()
        try:
            if sha256 is None:
                sha256 = _digest(Path(task.log))
                if tell:
                    tell(sha256)
            row = _finished(task, label, opened, document)
        except MemoryError:
            row = rows.unfinished(task, label, "memory", OUT_OF_MEMORY)
        except Exception as error:  # noqa: BLE001  a fault of ours is no end of the batch either
            row = rows.unfinished(task, label, "failed", _line(error))
            row["final"] = isinstance(error, ReadError) and sha256 is not None
        yield row | {"sha256": sha256, "total_s": round(perf_counter() - began, 4)}


def _finished(task: Task, label: str, opened: "_Opened", document: Mapping[str, Any]) -> Row:
    """Run one observer, write its results, and return its row."""
    model = observers.get(str(document["observer"])).config
    configuration = config.validate(model, document, label)
    result = pipeline.observe(opened.by(configuration), configuration, label=label)
    began = perf_counter()
    folder = _own(task)
    written = pipeline.write([result], Path(task.output, folder), kinds=task.kinds)
    took = perf_counter() - began
    names = [path.name for path in written]
    return rows.finished(task, label, result.summary, names, took) | {"folder": folder}


def _own(task: Task) -> str:
    """Return the folder of the log's results, or another where an earlier call left a log's there.

    That log may well have had the same path below another folder.
    """
    others = owners(Path(task.output, task.folder)) - {str(Path(task.log).resolve())}
    return marked(task.folder, task.log) if others else task.folder


class _Opened:
    """A log that is read again only for an observer that reads it in another way."""

    def __init__(self, log: Path) -> None:
        self._log = log
        self._how: object = None
        self._found: pipeline.Opened | AttestError | None = None

    def by(self, configuration: Configuration) -> pipeline.Opened:
        """Return the log as a configuration reads it; what cannot be read is not tried again."""
        how = pipeline.reading(configuration)
        if self._found is None or self._how != how:
            self._found, self._how = None, how  # the old one goes before the new one comes
            try:
                self._found = pipeline.opened(self._log, configuration)
            except AttestError as error:
                self._found = error
        if isinstance(self._found, AttestError):
            raise self._found
        return self._found


def _digest(log: Path) -> str:
    """Return the digest of a log; reading what is no file might never end."""
    try:
        fits, exists = log.is_file() or log.is_dir(), log.exists()
    except OSError as error:
        raise ReadError(f"{log}: {error.strerror}. Check the path.") from error
    if not fits:
        raise ReadError(f"{log}: {'not a regular' if exists else 'no such'} file. Check the path.")
    return report.sha256(log)


def _line(error: Exception) -> str:
    if isinstance(error, AttestError):
        return " ".join(str(error).split())
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return f"a fault of attest, not of the log: {what}. Please report it."
