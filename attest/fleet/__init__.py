"""What becomes of a fleet: bias, calibration and error of each vehicle from flight to flight.

    summaries -> read -> flights -> Series… -> Trend… -> document -> table, page, CSV

It reads what a batch writes, and knows nothing else of it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from attest.errors import ReadError
from attest.fleet import reading
from attest.fleet.choice import Choice, flights
from attest.fleet.document import describe
from attest.fleet.page import write_page
from attest.fleet.series import series
from attest.fleet.table import text_of_fleet
from attest.fleet.trend import trends
from attest.fleet.written import write_table

LEFT_OUT = ("not ok", "of other observers", "of other days")

__all__ = ["Choice", "fleet", "text_of_fleet", "write_results"]


def fleet(named: Sequence[Path], choice: Choice) -> dict[str, Any]:
    """Return the document of a fleet, ``schema: 1``, from summaries or the folders with them.

    Raises
    ------
    ReadError
        A file is no summary, or no row can be used.
    ConfigError
        An observer that is chosen is in none of the rows.
    """
    table, lacking = reading.read(named)
    rows, left_out = flights(table, choice)
    found, tests = trends(list(series(rows)))
    if not found:
        where = ", ".join(map(str, named[:3]))
        raise ReadError(f"{where}: {_why(left_out)}. Name other summaries, or choose less.")
    return describe(rows, found, tests, left_out, lacking)


def _why(left_out: dict[str, int]) -> str:
    reasons = [f"{left_out[why]:,} {why}" for why in LEFT_OUT if left_out.get(why)]
    told = f", {', '.join(reasons)}" if reasons else ""
    return f"no row with a figure that can be used ({left_out['read']:,} read{told})"


def write_results(document: dict[str, Any], folder: Path) -> list[Path]:
    """Write ``fleet.csv`` and ``fleet.html``, and return their paths.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    return [write_page(document, folder), write_table(document, folder)]
