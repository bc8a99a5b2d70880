"""A fleet as text for a terminal."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from attest.errors import printable
from attest.fleet.words import (
    ANEW,
    chance_in_words,
    day,
    deviations_in_words,
    of_rows,
    of_tests,
    overview,
    value,
)
from attest.report.info import shown

MOST = 25
"""Lines of a table; the page and the CSV have all."""
WIDEST = 44
"""Of a name in a table."""
TOLD = 3
"""Figures of an odd flight that are told."""
NAMES = frozenset({"vehicle", "observer", "log"})
RIGHT = frozenset({"flights", "changes", "odd", "chance", "deviations"})


def text_of_fleet(document: Mapping[str, Any], written: Sequence[Path]) -> str:
    """Return what changed, which flights are odd, and every vehicle."""
    vehicles = document["vehicles"]
    flights = sum(one["flights"] for one in vehicles)
    lines = [
        f"{len(vehicles):,} vehicles, {flights:,} flights  {', '.join(document['observers'])}",
        *(f"  {label:12s}{text}" for label, text in of_rows(document)),
        *(f"  {label:12s}{text}" for label, text in of_tests(document)),
    ]
    for title, rows in (
        ("changes", list(_changes(document))),
        ("odd flights", list(_odd(document))),
        ("medians, vehicles with changes first", list(overview(document))),
    ):
        if rows:
            lines += ["", f"  {title}", *_table(rows)]
    if written:
        names = " ".join(path.name for path in written)
        lines += ["", f"  written     {written[0].parent}/  {names}"]
    return "\n".join(printable(line) for line in lines)


def _changes(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    for one in document["series"]:
        for change in one["changes"]:
            step = change["kind"] == "step"
            yield {
                "vehicle": one["vehicle"],
                "observer": ", ".join(one["observers"]),
                "figure": one["figure"],
                "when": day(change["by_utc"]) if step else f"drift from {day(one['first_utc'])}",
                "from": value(one, change["before"]),
                "to": value(one, change["after"], unit=True),
                "deviations": deviations_in_words(change),
                "chance": chance_in_words(change["chance"]),
                "": ", ".join(_remarks(change)),
            }


def _remarks(change: Mapping[str, Any]) -> Iterator[str]:
    if not change["sure"]:
        yield "perhaps"
    if change["configuration_changed"]:
        yield ANEW


def _odd(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    """Yield the odd flights, the oddest first, each with all that is odd about it."""
    flights: dict[tuple[str, str], list[tuple[float, str]]] = {}
    days = {}
    for one in document["series"]:
        for flight in one["odd"]:
            key = one["vehicle"], flight["log"]
            days[key] = day(flight["utc"])
            usual = value(one, flight["usual"])
            text = f"{one['figure']} {value(one, flight['value'], unit=True)} for {usual}"
            flights.setdefault(key, []).append((flight["chance"], text))
    for (vehicle, log), told in sorted(flights.items(), key=lambda item: min(item[1])):
        texts = list(dict.fromkeys(text for _, text in sorted(told)))
        more = f", and {len(texts) - TOLD} more" if len(texts) > TOLD else ""
        when = days[vehicle, log]
        what = ", ".join(texts[:TOLD]) + more
        yield {"vehicle": vehicle, "when": when, "log": Path(log).name, "value for usual": what}


def _table(rows: Sequence[Mapping[str, str]]) -> Iterator[str]:
    """Yield titles and the first rows, without the columns that are empty."""
    some = [{title: _short(text, title) for title, text in row.items()} for row in rows[:MOST]]
    titles = [title for title in some[0] if any(row[title] for row in some)]
    some.insert(0, {title: title for title in titles})
    widths = {title: max(len(row[title]) for row in some) for title in titles}
    for row in some:
        cells = [
            f"{row[title]:{'>' if title in RIGHT else '<'}{widths[title]}s}" for title in titles
        ]
        yield f"  {'  '.join(cells)}".rstrip()
    if len(rows) > MOST:
        yield f"  … and {len(rows) - MOST:,} more"


def _short(text: str, title: str) -> str:
    """Return a text for one cell, the end of a long name."""
    text = shown(text)
    if title not in NAMES or len(text) <= WIDEST:
        return text
    return f"…{text[1 - WIDEST :]}"
