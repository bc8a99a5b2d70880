"""One log through all observers: a function of where the log is, how, and where results go."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Self

from attest import config, observers, pipeline, report
from attest.batch import rows, urls
from attest.batch.fetch import Source
from attest.batch.find import marked
from attest.batch.listing import Stamp
from attest.batch.rows import Row
from attest.batch.store import Store
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
    """The folder or URL that all results of the batch are below."""
    folder: str
    """Of this log's results, below that."""
    observers: Mapping[str, Mapping[str, Any]]
    """The effective configurations, by label."""
    digests: Mapping[str, str]
    """Of these, by label."""
    kinds: tuple[str, ...]
    """What is written beside the JSON."""
    etag: str = ""
    """What an object store tells of the log's content."""
    again: str = ""
    """What sets a batch apart that takes no results of earlier ones."""


def run(task: Task, tell: Callable[[str], None] | None = None) -> Iterator[Row]:
    """Run a log through its observers, and yield a row for each as it ends.

    The log's digest is told before the log is read: should reading it end the process, it is known
    which content did. No error ends a task: it is told in the row. What another worker has
    committed is not made again.
    """
    with (
        Source(task.log, Stamp(task.size, task.mtime_ns, task.etag)) as source,
        Store(task) if urls.is_url(task.output) else _Folder(task) as store,
    ):
        opened = _Opened(source, tell)
        for label in task.observers:
            yield _ended(task, label, opened, store)


def _ended(task: Task, label: str, opened: "_Opened", store: "Store | _Folder") -> Row:
    """Run one observer, and return what it came to."""
    began = perf_counter()

    def known() -> Row:
        return {"sha256": opened.sha256, "total_s": round(perf_counter() - began, 4)}

    try:
        row = store.found(label)
        if row is None:
            opened.begin()
            row = store.commit(label, _finished(task, label, opened, store) | known())
    except MemoryError:
        row = rows.unfinished(task, label, "memory", OUT_OF_MEMORY) | known()
    except Exception as error:  # noqa: BLE001  a fault of ours is no end of the batch either
        row = rows.unfinished(task, label, "failed", opened.source.named(_line(error))) | known()
        row["final"] = isinstance(error, ReadError) and opened.sha256 is not None
    finally:
        store.discard()
    return row


def _finished(task: Task, label: str, opened: "_Opened", store: "Store | _Folder") -> Row:
    """Run one observer, write its results, and return its row."""
    document = task.observers[label]
    model = observers.get(str(document["observer"])).config
    configuration = config.validate(model, document, label)
    result = pipeline.observe(opened.by(configuration), configuration, label=label)
    result = replace(result, summary=opened.source.told(result.summary))
    began = perf_counter()
    written = pipeline.write([result], store.folder(label), kinds=task.kinds)
    folder = store.put(written)
    took = perf_counter() - began
    names = [path.name for path in written]
    return rows.finished(task, label, result.summary, names, took) | {"folder": folder}


class _Folder:
    """The results of a task in a folder of this machine, where no other process makes them."""

    def __init__(self, task: Task) -> None:
        self._task, self._own = task, ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave all as it is."""

    def found(self, label: str) -> None:
        """Return nothing: what was done before is in the journal."""

    def folder(self, label: str) -> Path:  # noqa: ARG002
        """Return where to write, or another place where an earlier call left a log's results.

        That log may well have had the same path below another folder.
        """
        task = self._task
        others = owners(Path(task.output, task.folder)) - {str(Path(task.log).resolve())}
        self._own = marked(task.folder, task.log) if others else task.folder
        return Path(task.output, self._own)

    def put(self, written: Sequence[Path]) -> str:  # noqa: ARG002
        """Return the folder of what is written."""
        return self._own

    def commit(self, label: str, row: Row) -> Row:  # noqa: ARG002
        """Return the row: each file was renamed when it was whole."""
        return row

    def discard(self) -> None:
        """Leave all as it is."""


class _Opened:
    """A log that is read again only for an observer that reads it in another way."""

    def __init__(self, source: Source, tell: Callable[[str], None] | None) -> None:
        self.source = source
        self.sha256: str | None = None
        self._tell = tell
        self._how: object = None
        self._found: pipeline.Opened | AttestError | None = None

    def begin(self) -> None:
        """Bring the log, and tell its digest."""
        if self.sha256 is None:
            self.sha256 = _digest(self.source.path())
            if self._tell:
                self._tell(self.sha256)

    def by(self, configuration: Configuration) -> pipeline.Opened:
        """Return the log as a configuration reads it; what cannot be read is not tried again."""
        how = pipeline.reading(configuration)
        if self._found is None or self._how != how:
            self._found, self._how = None, how  # the old one goes before the new one comes
            try:
                self._found = pipeline.opened(self.source.path(), configuration)
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
