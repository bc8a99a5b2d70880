"""What was found of a fleet, as the JSON document ``schema: 1``: the contract for scripts."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import isfinite
from typing import Any

import numpy as np

import attest
from attest.fleet.change import CHANCE, PERHAPS, SHARE_BY_CHANCE
from attest.fleet.choice import Flights
from attest.fleet.series import Series
from attest.fleet.trend import FEWEST, ODD, Change, Tests, Trend


def describe(
    flights: Flights,
    found: Sequence[Trend],
    tests: Tests,
    left_out: Mapping[str, int],
    lacking: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    """Return the document; the series that change most surely come first.

    Parameters
    ----------
    left_out
        How many rows were read, and how many of them left out, by why.
    lacking
        Columns that each summary has not.
    """
    dated = flights.t[np.isfinite(flights.t)]
    series = [_series(flights, trend) for trend in found]
    return {
        "schema": 1,
        "summaries": [{"path": path, "lacks": list(names)} for path, names in lacking.items()],
        "rows": {"used": len(flights.t), **left_out},
        "vehicles": _vehicles(flights, series),
        "observers": sorted(flights.observers),
        "configurations": dict(flights.several),
        "first_utc": _utc(dated.min()) if len(dated) else None,
        "last_utc": _utc(dated.max()) if len(dated) else None,
        "judged": _judged(tests, series),
        "series": series,
        "versions": {"attest": attest.__version__},
    }


def _judged(tests: Tests, series: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what was judged, and how much of what is flagged chance would flag."""
    flagged = [one for one in series if one["changes"]]
    sure = sum(any(change["sure"] for change in one["changes"]) for one in flagged)
    return {
        "series": tests.series,
        "flights_at_least": FEWEST,
        "changed": sure,
        "changed_by_chance_at_most": min(SHARE_BY_CHANCE * sure, CHANCE * tests.series),
        "perhaps_changed": len(flagged) - sure,
        "perhaps_by_chance_at_most": PERHAPS * tests.series,
        "odd_flights": sum(len(one["odd"]) for one in series),
        "odd_flight_by_chance": ODD,
    }


def _vehicles(flights: Flights, series: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each vehicle with its flights, that with the surest change first, then odd ones."""
    order = dict.fromkeys(one["vehicle"] for one in series)
    count = np.bincount(_of_logs(flights), minlength=len(flights.vehicles))
    number = {name: i for i, name in enumerate(flights.vehicles)}
    of: dict[str, list[Mapping[str, Any]]] = {name: [] for name in order}
    for one in series:
        of[one["vehicle"]].append(one)
    found = [
        {
            "vehicle": name,
            "flights": int(count[number[name]]),
            "changes": sum(len(one["changes"]) for one in of[name]),
            "odd": len({flight["log"] for one in of[name] for flight in one["odd"]}),
        }
        for name in order
    ]
    return sorted(found, key=lambda one: (not one["changes"], not one["odd"]))


def _of_logs(flights: Flights) -> Any:
    """Return the vehicle of each log, which several observers may have had."""
    logs = flights.path.combine_chunks().dictionary_encode().indices.to_numpy(zero_copy_only=False)
    one = np.unique(np.stack([flights.vehicle, np.nan_to_num(logs, nan=-1)]), axis=1)
    return one[0].astype(np.int64)


def _series(flights: Flights, trend: Trend) -> dict[str, Any]:
    one = trend.series
    dated = one.dated
    return {
        "vehicle": one.vehicle,
        "observers": list(one.observers),
        "figure": one.figure.title,
        "unit": one.figure.unit,
        "reference": one.reference or None,
        "configuration": one.configuration or None,
        "flights": len(one.x),
        "undated": len(one.x) - dated,
        "median": _number(trend.median),
        "mad": _number(trend.spread),
        "slope_per_month": _number(trend.slope),
        "first_utc": _utc(one.t[0]) if dated else None,
        "last_utc": _utc(one.t[dated - 1]) if dated else None,
        "last": _number(one.x[dated - 1]) if dated else None,
        "chance": _number(trend.chance),
        "changes": [_change(flights, one, change) for change in trend.changes],
        "odd": [_odd(flights, trend, *each) for each in trend.odd],
        "points": _points(trend) if trend.changes or trend.odd else [],
    }


def _change(flights: Flights, one: Series, change: Change) -> dict[str, Any]:
    step = change.kind == "step"
    first, last = (change.at - 1, change.at) if step else (0, one.dated - 1)
    return {
        "kind": change.kind,
        "sure": change.sure,
        "after_utc": _utc(one.t[first]),
        "by_utc": _utc(one.t[last]),
        "log": _path(flights, one, last),
        "before": _number(change.before),
        "after": _number(change.after),
        "configuration_changed": step and _configured_anew(flights, one, last),
        "deviations": _number(change.deviations),
        "chance": change.chance,
    }


def _configured_anew(flights: Flights, one: Series, i: int) -> bool:
    """Tell whether a flight was run in another way than the one before it."""
    before, after = flights.configuration[one.rows[i - 1 : i + 1]]
    return bool(before != after)


def _odd(flights: Flights, trend: Trend, i: int, chance: float) -> dict[str, Any]:
    one = trend.series
    return {
        "utc": _utc(one.t[i]),
        "log": _path(flights, one, i),
        "value": _number(one.x[i]),
        "usual": _number(trend.level[i]),
        "chance": chance,
    }


def _points(trend: Trend) -> list[list[float]]:
    """Return seconds since 1970, value and level of each flight with a date."""
    n = len(trend.level)
    columns = trend.series.t[:n], trend.series.x[:n], trend.level
    points: list[list[float]] = np.stack(columns, axis=1).tolist()
    return points


def _path(flights: Flights, one: Series, i: int) -> str:
    return str(flights.path[int(one.rows[i])].as_py() or "")


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _utc(t: float) -> str:
    return datetime.fromtimestamp(float(t), UTC).isoformat(timespec="seconds")
