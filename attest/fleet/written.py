"""Every series as a row of a table."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from attest.batch.summary import cells
from attest.files import replacing

COLUMNS = (
    *("vehicle", "observers", "figure", "unit", "reference", "configuration"),
    *("flights", "undated", "median", "mad", "slope_per_month"),
    *("first_utc", "last_utc", "last", "chance"),
)
LAST = ("changes", "latest_change", "kind", "sure", "before", "after", "deviations", "odd")


def write_table(document: Mapping[str, Any], folder: Path) -> Path:
    """Write ``fleet.csv``: of a series' changes the latest one, in full.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    path = folder / "fleet.csv"
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow([*COLUMNS, *LAST])
        rows.writerows(cells(_row(one)) for one in document["series"])
    return path


def _row(one: Mapping[str, Any]) -> dict[str, Any]:
    latest = one["changes"][-1] if one["changes"] else {}
    return {
        **{name: one[name] for name in COLUMNS},
        "observers": " ".join(one["observers"]),
        "changes": len(one["changes"]),
        "latest_change": latest.get("by_utc"),
        **{name: latest.get(name) for name in ("kind", "sure", "before", "after", "deviations")},
        "odd": len(one["odd"]),
    }
