"""Many logs, each run once, whatever happens.

    find -> Log… -> run (resume, pool of workers, task) -> rows -> journal -> summary, page

A `Task` is a log and how to run it; `task.run` is a function of it alone, which writes the results
and yields a JSON-like row for each observer. Where it is called is the pool's matter.
"""

from attest.batch.find import Found, Log, find, names_in
from attest.batch.journal import Journal
from attest.batch.resume import Limits
from attest.batch.run import Plan, run

__all__ = ["Found", "Journal", "Limits", "Log", "Plan", "find", "names_in", "run"]
