"""What table and page say alike."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from attest.fleet.figures import AXES, FIGURES

DIGITS = {figure.title: figure.digits for figure in FIGURES}
SIGNED = {figure.title for figure in FIGURES if not figure.positive}
SIZES = {"field/model", "field", "mag latency"}
"""Figures that are never below zero."""
GROUPS = ("gyro bias", "hard iron")
"""Figures with axes, that are one cell of the overview."""
SINGLE = (
    *("field/model", "field", "mag latency"),
    *("total RMSE", "heading RMSE", "inclination RMSE", "heading offset"),
)
UNITS = {figure.title: figure.unit for figure in FIGURES}
ANEW = "as the configuration changed"


def value(one: Mapping[str, Any], number: float | None, *, unit: bool = False) -> str:
    """Spell a value of a series."""
    return _spelt(one["figure"], number) + (f" {one['unit']}" if unit else "")


def _spelt(figure: str, number: float | None) -> str:
    if number is None:
        return "-"
    sign = "+" if figure in SIGNED - SIZES else ""
    rounded = round(number, DIGITS[figure]) + 0.0  # without a negative zero
    return f"{rounded:{sign}.{DIGITS[figure]}f}"


def day(utc: str | None) -> str:
    """Return the day of a time."""
    return utc[:10] if utc else ""


def chance_in_words(chance: float | None) -> str:
    """Spell how rarely a steady series looks so changed."""
    return "" if chance is None else f"1 in {float(f'{1.0 / chance:.2g}'):,.0f}"


def deviations_in_words(change: Mapping[str, Any]) -> str:
    """Spell how large a change is; without scatter, it cannot be counted."""
    size = change["deviations"]
    return "∞" if size is None else f"{size:.1f}" if size < 1e3 else f"{size:.0e}"


def of_rows(document: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what was read and what of it does not count, each with a label."""
    rows = document["rows"]
    if document["first_utc"]:
        yield "from", f"{day(document['first_utc'])} to {day(document['last_utc'])}"
    words = {
        "not ok": "that did not end well",
        "twice": "of a log and observer that are there twice",
        "of other observers": "of other observers",
        "of other days": "of other days",
    }
    out = [f"{rows[why]:,} {text}" for why, text in words.items() if rows.get(why)]
    yield "rows", f"{rows['used']:,} used" + (f"; left out {', '.join(out)}" if out else "")
    if rows["undated"]:
        yield "undated", f"{rows['undated']:,} rows: in the medians, but not in the trends"
    if rows["without vehicle"]:
        count = rows["without vehicle"]
        yield "unnamed", f"{count:,} rows without a vehicle: by the folder of the log"
    if rows["without own id"]:
        count = rows["without own id"]
        text = f"{count:,} rows by firmware, board or system id, which several vehicles may share"
        yield "unsure", f"{text} (--by folder keeps folders apart)"
    for observer, count in document["configurations"].items():
        text = f"{observer} in {count:,} ways: errors are followed in each by itself"
        yield "configured", f"{text}, other figures through all"
    for summary in document["summaries"]:
        if summary["lacks"]:
            yield "lacking", f"{summary['path']}: {', '.join(summary['lacks'])}"


def of_tests(document: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what was judged and how much of what is flagged is chance, each with a label."""
    judged = document["judged"]
    yield "judged", f"{judged['series']:,} series of {judged['flights_at_least']} flights or more"
    if not judged["series"]:
        return
    sure = f"{judged['changed']:,} series; by chance {_few(judged['changed_by_chance_at_most'])}"
    yield "changed", f"{sure} of them at the most, on average"
    if judged["perhaps_changed"]:
        by_chance = _few(judged["perhaps_by_chance_at_most"])
        yield (
            "perhaps",
            f"{judged['perhaps_changed']:,} more; chance alone would give up to {by_chance}",
        )
    if judged["odd_flights"]:
        text = f"{judged['odd_flights']:,} values; were all normal, any at all by a chance of"
        yield "odd", f"{text} {judged['odd_flight_by_chance']:.0%}"


def _few(number: float) -> str:
    return f"{number:.2g}" if number < 100 else f"{number:,.0f}"


def overview(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield the medians of each vehicle and observer."""
    found: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for one in document["series"]:
        for observer in one["observers"]:
            figures = found.setdefault((one["vehicle"], observer), {})
            other = figures.get(one["figure"])
            if other is None or other["flights"] < one["flights"]:
                figures[one["figure"]] = one
    for vehicle in document["vehicles"]:
        for observer in document["observers"]:
            medians = found.get((vehicle["vehicle"], observer))
            if medians:
                yield {
                    "vehicle": vehicle["vehicle"],
                    "observer": observer,
                    "flights": f"{vehicle['flights']:,}",
                    "changes": str(vehicle["changes"] or ""),
                    "odd": str(vehicle["odd"] or ""),
                    **{f"{name} {UNITS[f'{name} x']}": _together(medians, name) for name in GROUPS},
                    **{f"{name} {UNITS[name]}": _median(medians, name) for name in SINGLE},
                }


def _together(figures: Mapping[str, Mapping[str, Any]], name: str) -> str:
    cells = [_median(figures, f"{name} {axis}") or "-" for axis in AXES]
    return "" if set(cells) == {"-"} else " ".join(cells)


def _median(figures: Mapping[str, Mapping[str, Any]], name: str) -> str:
    return _spelt(name, figures[name]["median"]) if name in figures else ""


def sentence(changes: Sequence[Mapping[str, Any]], one: Mapping[str, Any]) -> str:
    """Say the changes of a series."""
    return "; ".join(_said(change, one) for change in changes)


def _said(change: Mapping[str, Any], one: Mapping[str, Any]) -> str:
    first, last = day(change["after_utc"]), day(change["by_utc"])
    if change["kind"] == "drift":
        when = f"drifts from {first} to {last}"
    else:
        when = f"on {last}" if first == last else f"between {first} and {last}"
    sure = "" if change["sure"] else "perhaps "
    ends = f"{value(one, change['before'])} → {value(one, change['after'], unit=True)}"
    size = f"{deviations_in_words(change)} deviations"
    chance = f"chance {chance_in_words(change['chance'])}"
    anew = f", {ANEW}" if change["configuration_changed"] else ""
    return f"{sure}{ends} {when} ({size}, {chance}{anew})"
