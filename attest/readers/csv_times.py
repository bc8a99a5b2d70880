"""What is wrong with the times of a CSV that none of can be used."""

from math import isnan, nan
from pathlib import Path

from attest.readers import csv_head
from attest.readers.csv_cells import LATEST
from attest.readers.csv_plan import DIGITS, Plan

NAMES = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
DATES = (631_152_000, 4_102_444_800)
"""1990 to 2100, unix seconds: what a log may have been recorded in."""


def fault(path: Path, plan: Plan) -> str | None:
    """Tell what is wrong with the first time, and what to do; None where nothing is."""
    cell = _first(path, plan)
    shown = f"{plan.clock}, such as {cell[:40]}"
    try:
        time = float(cell.replace(plan.layout.decimal, "."))
    except ValueError:
        time = nan
    if isnan(time):
        return f"{shown}, is no number. Give seconds, or input.csv.time." if cell else None
    if abs(time) * 10.0**plan.stamps.digits < LATEST:
        return None
    for unit, digits in DIGITS.items():
        if DATES[0] <= time * 10.0 ** (digits - 9) <= DATES[1]:
            return (
                f"{shown}, looks like {NAMES[unit]} since 1970. "
                f"Read it so: --set input.csv.time.unit={unit}"
            )
    return f"{shown}, is too large for a time. Give its unit by input.csv.time."


def _first(path: Path, plan: Plan) -> str:
    """Return the cell of time in the first row, empty where there is none."""
    comment = plan.layout.comment.encode()
    row = csv_head.lines(csv_head.read(path)[plan.layout.start :], 0, comment).first
    cells = csv_head.cells(row, plan.layout.separator)
    return cells[plan.stamps.place] if plan.stamps.place < len(cells) else ""
