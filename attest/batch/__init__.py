"""Many logs, each run once, whatever happens.

    find -> Log… -> run (resume, pool of workers, task) -> rows -> journal -> summary, page

A `Task` is a log and how to run it; `task.run` is a function of it alone, which writes the results
and yields a JSON-like row for each observer. Where it is called is the pool's matter, or that of a
Dask cluster, each of whose workers has a pool of one. Logs and results may be at URLs.
"""

from pathlib import Path

from attest.batch.find import Found, Log, find, names_in
from attest.batch.journal import Journal
from attest.batch.page import Seen, write_page
from attest.batch.resume import Limits
from attest.batch.run import Plan, place, run
from attest.batch.store import publish
from attest.batch.summary import write_summary

__all__ = [
    "Found",
    "Journal",
    "Limits",
    "Log",
    "Plan",
    "find",
    "names_in",
    "place",
    "run",
    "write_results",
]


def write_results(journal: Journal, folder: Path, url: str | None = None) -> list[Path]:
    """Write the summary and the page of all that a journal holds, and return their paths.

    Where the results are at a URL, they are put there too: the page's links are right there.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    seen = Seen()
    tables = write_summary(seen.watched(journal.rows()), folder)
    written = [*tables, write_page(seen, folder)]
    if url is not None:
        publish(written, url)
    return written
