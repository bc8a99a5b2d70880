"""A fleet as one page that needs nothing else: what changed, odd flights, every vehicle.

What comes from a summary is escaped, and the page may not load anything.
"""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from attest.files import replacing
from attest.fleet import drawing
from attest.fleet.words import (
    chance_in_words,
    day,
    of_rows,
    of_tests,
    overview,
    sentence,
    value,
)
from attest.report.html import FOOT, head

MOST_DRAWN, MOST = 60, 2000
"""Drawings, and rows of a table, that a browser shows with ease."""
LONGEST = 24
"""Of a number in a table; what is longer is a sentence, whose lines break."""
STYLE = """
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0 1.2em }
dt { color: var(--faint) } dd { margin: 0 }
figure { width: 600px; max-width: 100% } figure svg { max-width: 100%; height: auto }
figure small { display: block; font-weight: 400 }
th { white-space: normal; vertical-align: bottom }
h2 { margin-top: 1.6em }
"""
SERIES = ("vehicle", "observer", "figure", "unit", "flights", "median", "± MAD", "a month", "last")
Cell = tuple[str, object]
"""What is shown, and by what it is sorted."""


def write_page(document: Mapping[str, Any], folder: Path) -> Path:
    """Write ``fleet.html``.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    path = folder / "fleet.html"
    with replacing(path) as part, part.open("w", encoding="utf-8") as file:
        file.writelines(_page(document))
    return path


def _page(document: Mapping[str, Any]) -> Iterator[str]:
    yield head("attest fleet", STYLE + drawing.STYLE)
    flights = sum(one["flights"] for one in document["vehicles"])
    yield f"<p>{len(document['vehicles']):,} vehicles, {flights:,} flights, "
    yield f"{escape(', '.join(document['observers']))}. "
    yield 'Every series: <a href="fleet.csv">CSV</a>.</p><dl>'
    for label, text in (*of_rows(document), *of_tests(document)):
        yield f"<dt>{label}</dt><dd>{escape(text)}</dd>"
    yield "</dl>"
    yield from _drawings([one for one in document["series"] if one["points"]])
    rows = [_medians(row) for row in overview(document)]
    titles = list(next(overview(document), {}))
    yield from _table("Medians, vehicles with changes first", titles, rows)
    odd = [_odd(one, flight) for one in document["series"] for flight in one["odd"]]
    titles = ["vehicle", "observer", "figure", "began", "value", "usual", "unit", "log"]
    yield from _table("Odd flights", titles, odd)
    titles = [*SERIES, "chance", "changes", "odd", "reference", "configuration"]
    yield from _table("Every series", titles, [_series(one) for one in document["series"]])
    yield FOOT


def _drawings(series: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield what changed, then what has odd flights only."""
    changed = [one for one in series if one["changes"]]
    others = [one for one in series if not one["changes"]]
    for title, some in (("Changes", changed), ("Steady, with odd flights", others)):
        if some:
            yield f"<h2>{title}{_less(min(len(some), MOST_DRAWN), len(some))}</h2>"
        for one in some[:MOST_DRAWN]:
            observers = escape(", ".join(one["observers"]))
            told = sentence(one["changes"], one) if one["changes"] else _odd_in_words(one)
            yield f"<figure><figcaption>{escape(one['vehicle'])}: {escape(one['figure'])}"
            yield f" <small>{observers}{_against(one)}</small><small>{escape(told)}</small>"
            yield f"</figcaption>{drawing.drawing(one)}</figure>\n"


def _odd_in_words(one: Mapping[str, Any]) -> str:
    return "; ".join(
        f"{value(one, flight['value'], unit=True)} on {day(flight['utc'])}, usually "
        f"{value(one, flight['usual'])}"
        for flight in one["odd"][:3]
    )


def _against(one: Mapping[str, Any]) -> str:
    parts = [f" against {escape(one['reference'])}"] if one["reference"] else []
    parts += [f" by configuration {escape(one['configuration'])}"] if one["configuration"] else []
    return "".join(parts)


def _less(shown: int, total: int) -> str:
    return "" if shown == total else f", {shown:,} of {total:,}"


def _table(title: str, titles: Sequence[str], rows: Sequence[Sequence[Cell]]) -> Iterator[str]:
    """Yield a table, without the columns that are empty."""
    if not rows:
        return
    rows, total = rows[:MOST], len(rows)
    full = [i for i in range(len(titles)) if any(row[i][0] for row in rows)]
    yield f"<h2>{title}{_less(len(rows), total)}</h2><table><thead><tr>"
    yield "".join(f"<th>{escape(titles[i])}</th>" for i in full) + "</tr></thead><tbody>\n"
    for row in rows:
        yield f"<tr>{''.join(_cell(*row[i]) for i in full)}</tr>\n"
    yield "</tbody></table>"


def _cell(text: str, key: object) -> str:
    number = isinstance(key, int | float)
    shown = escape(text)
    by = repr(key) if number else shown if key is None else escape(str(key))
    plain = number and len(text) <= LONGEST
    return f'<td{" class=n" if plain else ""} data-v="{by}">{shown}</td>'


def _medians(row: Mapping[str, str]) -> list[Cell]:
    return [(text, _sorted_by(text)) for text in row.values()]


def _sorted_by(text: str) -> object:
    """Return the number that a text is, or begins with."""
    try:
        return float(text.split(" ", maxsplit=1)[0].replace(",", ""))
    except ValueError:
        return text


def _series(one: Mapping[str, Any]) -> list[Cell]:
    figures = [(value(one, one[key]), one[key]) for key in ("median", "mad", "slope_per_month")]
    return [
        (one["vehicle"], one["vehicle"]),
        (", ".join(one["observers"]), ", ".join(one["observers"])),
        (one["figure"], one["figure"]),
        (one["unit"], one["unit"]),
        (f"{one['flights']:,}", one["flights"]),
        *figures,
        (value(one, one["last"]), one["last"]),
        (chance_in_words(one["chance"]), one["chance"]),
        (sentence(one["changes"], one), len(one["changes"])),
        (str(len(one["odd"]) or ""), len(one["odd"])),
        (one["reference"] or "", one["reference"] or ""),
        (one["configuration"] or "", one["configuration"] or ""),
    ]


def _odd(one: Mapping[str, Any], flight: Mapping[str, Any]) -> list[Cell]:
    return [
        (one["vehicle"], one["vehicle"]),
        (", ".join(one["observers"]), ", ".join(one["observers"])),
        (one["figure"], one["figure"]),
        (flight["utc"].replace("T", " ").removesuffix("+00:00"), flight["utc"]),
        (value(one, flight["value"]), flight["value"]),
        (value(one, flight["usual"]), flight["usual"]),
        (one["unit"], one["unit"]),
        (flight["log"], flight["log"]),
    ]
