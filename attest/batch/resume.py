"""What of an earlier batch still holds."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import attest
from attest import config, report
from attest.batch import urls
from attest.batch.find import Log
from attest.batch.journal import Journal
from attest.batch.rows import Row
from attest.config import Configuration
from attest.errors import ReadError


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one log may take; None: all there is."""

    timeout_s: float | None = None
    memory_gb: float | None = None
    """Beside what a worker takes before its first log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a row must have been made with to be taken again."""

    is_there: Callable[[str], bool]
    """Whether a file is, by its path below the output."""
    digests: dict[str, str]
    """Of the configurations, by the observers' labels."""
    kinds: tuple[str, ...]
    limits: Limits
    retry: bool = False
    """Take again only what ended well."""


def digest(configuration: Configuration) -> str:
    """Return the digest of an effective configuration, and of the reference file that it names.

    Raises
    ------
    ReadError
        That file cannot be read.
    """
    text = json.dumps(config.effective(configuration), sort_keys=True)
    reference = configuration.evaluation.reference
    if reference is not None and Path(reference).exists():
        text += report.sha256(Path(reference))
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def still_good(journal: Journal, log: Log, label: str, wanted: Wanted) -> Row | None:
    """Return the row of an earlier batch, if doing it again would give the same."""
    row = journal.find(log.path, label)
    if row is None or not _same_job(row, label, wanted) or not _written(row, wanted):
        return None
    if row.get("sha256") is None:
        return None
    if (row["size"], row["mtime_ns"], row.get("etag", "")) == (log.size, log.mtime_ns, log.etag):
        return row
    if urls.is_url(log.path):
        return None
    try:
        same = report.sha256(Path(log.path)) == row["sha256"]
    except ReadError:
        return None
    return row | {"size": log.size, "mtime_ns": log.mtime_ns} if same else None


def _same_job(row: Row, label: str, wanted: Wanted) -> bool:
    """Whether it was done in the same way, and came to an end that more room would not change."""
    if row.get("version") != attest.__version__ or row.get("digest") != wanted.digests[label]:
        return False
    if not row.get("final") or (wanted.retry and row["status"] != "ok"):
        return False
    limit = {"timeout": "timeout_s", "memory": "memory_gb"}.get(row["status"])
    if limit is None:
        return True
    now, then = getattr(wanted.limits, limit), row.get(limit)
    return now is not None and then is not None and now <= then


def _written(row: Row, wanted: Wanted) -> bool:
    """Whether the results that are wanted are all there."""
    if row["status"] != "ok":
        return True
    return set(wanted.kinds) <= set(row["kinds"]) and all(
        wanted.is_there(Path(row["folder"], name).as_posix()) for name in row["outputs"]
    )
