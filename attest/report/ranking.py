"""Several observers over one log, as the JSON document and as a ranked table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

from attest.errors import printable
from attest.report.info import shown, text_of_notes
from attest.report.table import KINDS
from attest.result import Result


def rank(results: Sequence[Result], failed: Mapping[str, str]) -> dict[str, Any]:
    """Return the document of a comparison, ``schema: 1``; the results come the best first.

    Only ``time_per_step_ns`` and the runs' ``timing`` differ between equal comparisons.
    """
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
    seconds, steps = summary["timing"].get("observing_s"), len(result.estimates.t)
    row = {
        "rank": place,
        "observer": result.estimates.observer,
        "cost_mean": summary["consistency"]["cost_mean"],
        "time_per_step_ns": None if seconds is None else round(1e9 * seconds / steps),
    }
    if metrics is None:
        return row
    return row | {
        "scored": metrics.scored,
        "total_rmse_deg": metrics.total.rmse,
        "heading_rmse_deg": metrics.heading.rmse,
        "inclination_rmse_deg": metrics.inclination.rmse,
        "median_deg": metrics.total.median,
        "p95_deg": metrics.total.p95,
        "max_deg": metrics.total.max,
        "settling_time_s": metrics.settling_time_s,
        "bias_error_rad_s": metrics.bias_error,
    }


@dataclass(frozen=True, slots=True)
class Column:
    """One column of the table."""

    key: str
    title: str
    unit: str
    format: str
    scale: float = 1.0
    none: str = "-"

    def cell(self, row: Mapping[str, Any]) -> str:
        """Spell the value of a row; what it lacks is a dash."""
        if row.get(self.key) is None:
            return self.none if self.key in row else "-"
        return format(self.scale * row[self.key], self.format)


COLUMNS = (
    Column("total_rmse_deg", "RMSE", "[°]", ".2f"),
    Column("heading_rmse_deg", "heading", "[°]", ".2f"),
    Column("inclination_rmse_deg", "inclination", "[°]", ".2f"),
    Column("median_deg", "median", "[°]", ".2f"),
    Column("p95_deg", "p95", "[°]", ".2f"),
    Column("max_deg", "max", "[°]", ".2f"),
    Column("settling_time_s", "settled", "[s]", ".2f", none="never"),
    Column("bias_error_rad_s", "bias error", "[°/s]", ".3f", scale=degrees(1.0)),
    Column("cost_mean", "cost", "[-]", ".4f"),
    Column("time_per_step_ns", "per step", "[ns]", ",.0f"),
)


def text_of_ranking(document: Mapping[str, Any], written: Sequence[Path]) -> str:
    """Return the ranked table for a terminal."""
    rows, runs = document["ranking"], document["runs"]
    lines = [f"{shown(document['log']['path'])}  {len(rows)} observers", *_order(document), ""]
    lines += _table(rows)
    lines += [f"  -   {name}: {why}" for name, why in document["failed"].items()]
    lines += ["", *claims] if (claims := list(_claims(document))) else []
    lines += text_of_notes(_notes(runs))
    if written:
        names = " ".join(path.name for path in written)
        lines += ["", f"  written     {written[0].parent}/  {names}"]
    return "\n".join(map(printable, lines))


def _order(document: Mapping[str, Any]) -> Iterator[str]:
    """Say what the order is by, and what that is worth."""
    reference, rows = document["reference"], document["ranking"]
    runs = document["runs"].values()
    if reference is None:
        yield "  reference   none: ranked by Wahba's mean cost, consistency only"
    else:
        yield f"  reference   {reference['name']} ({KINDS[reference['kind']]})"
    scored = [run["metrics"] for run in runs if run["metrics"] is not None]
    if scored:
        bound = f"{scored[0]['settling_bound_deg']:g}°"
        yield f"  order       total RMSE over the scored samples; settled: below {bound} from then"
    elif reference is not None:
        yield "  order       Wahba's mean cost, consistency only: nothing could be scored"
    if len({row.get("scored") for row in rows}) > 1:
        yield "  ! scored over different samples: the errors of the observers do not compare well"
    if len(scored) < len(rows) and not _alike([run["configuration"] for run in runs]):
        yield "  ! weights or vectors differ between the observers: their costs do not compare"


def _alike(configurations: Sequence[Mapping[str, Any]]) -> bool:
    """Tell whether Wahba's cost is the same function in all of them."""

    def cost(configuration: Mapping[str, Any]) -> list[Any]:
        weights = configuration["weights"]
        return [weights["k"], weights.get("w"), configuration["vectors"]]

    return all(cost(each) == cost(configurations[0]) for each in configurations)


def _table(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield titles, units and rows, without the columns that no row has."""
    columns = [c for c in COLUMNS if any(c.cell(row) != "-" for row in rows)]
    named = [["observer", "", *(row["observer"] for row in rows)]]
    named += [[c.title, c.unit, *(c.cell(row) for row in rows)] for c in columns]
    widths = [max(map(len, column)) for column in named]
    for i, place in enumerate(["", "", *(str(row["rank"]) for row in rows)]):
        figures = "".join(
            f"  {column[i]:>{w}s}" for column, w in zip(named[1:], widths[1:], strict=True)
        )
        yield f"  {place:<4s}{named[0][i]:{widths[0]}s}{figures}"


def _claims(document: Mapping[str, Any]) -> Iterator[str]:
    """Say of each observer, the best first, how much of what was promised held."""
    label = "promised"
    for name in (row["observer"] for row in document["ranking"]):
        held = [claim["holds"] for claim in document["runs"][name]["attestation"]]
        if not held:
            continue
        broken = f", {held.count(False)} did NOT" if False in held else ""
        unknown = f", {held.count(None)} open" if None in held else ""
        yield f"  {label:12s}{name}: {held.count(True)} of {len(held)} held{broken}{unknown}"
        label = ""


def _notes(runs: Mapping[str, Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return what all runs say once, then what each says besides, under its name."""
    found = {}
    for key in ("warnings", "notes"):
        every = [run[key] for run in runs.values()]
        common = [note for note in every[0] if all(note in others for others in every)]
        own = [
            {**note, "text": f"{name}: {note['text']}"}
            for name, run in runs.items()
            for note in run[key]
            if note not in common
        ]
        found[key] = common + own
    return found
