"""Several observers over one log, as the JSON document and as a ranked table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from attest.report.info import shown, text_of_notes
from attest.report.table import KINDS
from attest.result import Result


def rank(results: Sequence[Result], failed: Mapping[str, str]) -> dict[str, Any]:
    """Return the document of a comparison, ``schema: 1``; the results come the best first."""
    first = results[0].summary
    return {
        "schema": 1,
        "log": first["log"],
        "reference": first["reference"],
        "ranking": [_row(place, result) for place, result in enumerate(results, start=1)],
        "runs": {result.estimates.observer: result.summary for result in results},
        "failed": dict(failed),
    }


def _row(place: int, result: Result) -> dict[str, Any]:
    summary, metrics = result.summary, result.metrics
    row = {
        "rank": place,
        "observer": result.estimates.observer,
        "cost_mean": summary["consistency"]["cost_mean"],
        "seconds": summary["timing"].get("observing_s"),
    }
    if metrics is None:
        return row
    return row | {
        "total_rmse_deg": metrics.total.rmse,
        "heading_rmse_deg": metrics.heading.rmse,
        "inclination_rmse_deg": metrics.inclination.rmse,
        "median_deg": metrics.total.median,
        "p95_deg": metrics.total.p95,
        "max_deg": metrics.total.max,
        "settling_time_s": metrics.settling_time_s,
        "bias_error_rad_s": metrics.bias_error,
    }


COLUMNS = (
    ("total_rmse_deg", "RMSE [°]", 2),
    ("heading_rmse_deg", "heading [°]", 2),
    ("inclination_rmse_deg", "tilt [°]", 2),
    ("median_deg", "median [°]", 2),
    ("p95_deg", "p95 [°]", 2),
    ("max_deg", "max [°]", 2),
    ("settling_time_s", "settled [s]", 2),
    ("cost_mean", "cost", 4),
    ("seconds", "run [s]", 2),
)
"""Key, title and decimals."""


def text_of_ranking(document: Mapping[str, Any], written: Sequence[Path]) -> str:
    """Return the ranked table for a terminal."""
    reference, rows = document["reference"], document["ranking"]
    lines = [f"{shown(document['log']['path'])}  {len(rows)} observers"]
    if reference is None:
        lines.append("  reference   none: ranked by Wahba's mean cost, consistency only")
    else:
        lines.append(f"  reference   {reference['name']} ({KINDS[reference['kind']]})")
    columns = [c for c in COLUMNS if reference is not None or c[0] in rows[0]]
    widest = max(len(row["observer"]) for row in rows) + 2
    titles = "".join(f"{title:>12s}" for _, title, _ in columns)
    lines += ["", f"  {'':4s}{'observer':{widest}s}{titles}"]
    for row in rows:
        cells = "".join(f"{_number(row.get(key), digits):>12s}" for key, _, digits in columns)
        lines.append(f"  {row['rank']:<4d}{row['observer']:{widest}s}{cells}")
    lines += [f"  -   {name}: {why}" for name, why in document["failed"].items()]
    lines += text_of_notes(document["runs"][rows[0]["observer"]])
    if written:
        names = " ".join(path.name for path in written)
        lines += ["", f"  written     {written[0].parent}/  {names}"]
    return "\n".join(lines)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
