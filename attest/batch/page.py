"""The rows of a batch as one page that needs nothing else: counts, distributions, worst first.

What comes from a log or its name is escaped, and the page may not load anything.
"""

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from heapq import nsmallest
from html import escape
from pathlib import Path
from urllib.parse import quote

from attest.batch.find import common
from attest.batch.histogram import histogram
from attest.batch.rows import Row
from attest.batch.summary import flat
from attest.files import replacing
from attest.report.html import FOOT, head, utf8
from attest.report.info import counted

MOST = 2000
"""Rows that a browser sorts at once; the summary has them all."""
ERRORS = ("total", "heading", "inclination")
COLUMNS: Mapping[str, str] = {
    "observer": "observer",
    "status": "status",
    **{f"{error}_rmse_deg": f"{error} RMSE °" for error in ERRORS},
    "total_p95_deg": "p95 °",
    "total_max_deg": "max °",
    "settling_time_s": "settled s",
    "reference": "reference",
    "reference_kind": "its kind",
    "vehicle": "vehicle",
    "began_utc": "began",
    "duration_s": "length s",
    "warnings_count": "warnings",
}

AGAINST: Mapping[str, str] = {
    "truth": "truth",
    "autopilot": "an autopilot's estimate, which is not truth",
    "smoother": "the smoother, which is not truth",
}


@dataclass(slots=True)
class Seen:
    """What a page tells of rows, gathered while they go by."""

    statuses: Counter[str] = field(default_factory=Counter)
    errors: dict[tuple[str, str, str], list[float]] = field(default_factory=dict)
    """Of each observer and kind of reference, each error's RMSE."""
    worst: list[Row] = field(default_factory=list)
    """More than are shown, at the most twice as many."""

    def watched(self, rows: Iterator[Row]) -> Iterator[Row]:
        """Yield the rows as they are, and gather."""
        for row in rows:
            self.statuses[row["status"]] += 1
            for error in ERRORS:
                value = row.get(f"{error}_rmse_deg")
                if value is not None:
                    key = row["observer"], str(row.get("reference_kind")), error
                    self.errors.setdefault(key, []).append(value)
            self.worst.append(row)
            if len(self.worst) == 2 * MOST:
                self.worst = nsmallest(MOST, self.worst, key=_best_last)
            yield row


def write_page(seen: Seen, folder: Path) -> Path:
    """Write ``index.html``.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    path = folder / "index.html"
    with replacing(path) as part, part.open("w", encoding="utf-8") as file:
        file.writelines(_page(seen))
    return path


def _page(seen: Seen) -> Iterator[str]:
    worst = nsmallest(MOST, seen.worst, key=_best_last)
    total = sum(seen.statuses.values())
    counts = ", ".join(f"{n:,} {escape(status)}" for status, n in sorted(seen.statuses.items()))
    yield f"{head('attest batch')}<p>{total:,} runs: {counts}."
    yield ' All of them: <a href="summary.csv">CSV</a>, <a href="summary.parquet">Parquet</a>.</p>'
    for key, values in sorted(seen.errors.items(), key=lambda item: _place(item[0])):
        observer, kind, error = key
        title = f"{observer}: {error} error against {AGAINST.get(kind, kind)}, "
        title += f"RMSE of {counted(len(values), 'log')}"
        yield f"<figure><figcaption>{escape(utf8(title))}</figcaption>{histogram(values)}</figure>"
    yield f"<h2>{_title(len(worst), total)}</h2>"
    heads = "".join(f"<th>{head}</th>" for head in ("log", "results", *COLUMNS.values()))
    yield f"<table><thead><tr>{heads}</tr></thead><tbody>\n"
    base = common([str(Path(row["path"]).parent) for row in worst])
    for row in worst:
        yield _line(row, base)
    yield f"</tbody></table>{FOOT}"


def _title(shown: int, total: int) -> str:
    less = "" if shown == total else f" {shown:,} of {total:,}"
    return f"What ended badly, then the worst{less}"


def _place(key: tuple[str, str, str]) -> tuple[str, int, str, int]:
    observer, kind, error = key
    return observer, [*AGAINST, kind].index(kind), kind, ERRORS.index(error)


def _best_last(row: Row) -> tuple[bool, bool, float]:
    """Return what sorts failures first, then large errors, then what has no reference."""
    error = row.get("total_rmse_deg")
    return row["status"] == "ok", error is None, -(error or 0.0)


def _line(row: Row, base: str | None) -> str:
    values = flat(row)
    cells = [_cell(name, values[name]) for name in COLUMNS]
    path = escape(utf8(row["path"] if base is None else os.path.relpath(row["path"], base)))
    told = (values["error"] or values["warnings"] or "").removeprefix(f"{values['path']}: ")
    more = f"<small>{escape(told)}</small>" if told else ""
    links = " ".join(_link(row["folder"], name) for name in row["outputs"])
    bad = "" if row["status"] == "ok" else ' class="bad"'
    first = f'<td class="path" data-v="{path}">{path}{more}</td>'
    return f"<tr{bad}>{first}<td>{links}</td>{''.join(cells)}</tr>\n"


def _cell(name: str, value: object) -> str:
    if isinstance(value, float):
        figures = 1 if name == "duration_s" else 2
        return f'<td class="n" data-v="{value!r}">{value:.{figures}f}</td>'
    if isinstance(value, int):
        return f'<td class="n" data-v="{value}">{value}</td>'
    text = escape(str(value)) if value is not None else ""
    return f'<td data-v="{text}">{text}</td>'


def _link(folder: str, name: str) -> str:
    place = quote(os.fsencode(Path(folder, name).as_posix()))  # a name need not be UTF-8
    return f'<a href="./{place}">{escape(utf8(Path(name).suffix[1:]))}</a>'
