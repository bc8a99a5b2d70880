"""The messages of a DataFlash log as text: ``NAME, value, value``, one on each line."""

from collections.abc import Collection
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.readers import decimals
from attest.readers.dataflash_format import (
    FMT_FORMAT,
    Damage,
    Format,
    Scan,
    Table,
    number,
    parse,
    with_units,
)
from attest.readers.dataflash_lines import Spans, by_name
from attest.readers.decimals import Bytes

LONGEST_TEXT = 64
"""Bytes, as in a binary log: a column takes as many for each of its texts."""
_ROWS = 4096
"""Lines taken apart at once where it is done cell by cell."""
_PAD = 8
"""Bytes behind a text, so that as many can be looked at from every place in it."""


def recognises(head: bytes) -> bool:
    """Whether some line describes a message."""
    lines = (line for line in head.splitlines() if line.startswith(b"FMT,"))
    return any(_definition(line.partition(b",")[2]) is not None for line in lines)


def scan(path: Path, wanted: Collection[str]) -> Scan:
    """Read the wanted messages of a log."""
    text = _text(path)
    lines, counts, junk = by_name(text, {*wanted, "FMT", "UNIT", "MULT", "FMTU"})
    formats = {"FMT": FMT_FORMAT}
    for rest in _cut(text, lines.pop("FMT", np.empty((0, 2), np.int64))):
        if (form := _definition(rest)) is not None:
            formats[form.name] = form
    tables = {}
    for name, spans in lines.items():
        if name not in formats:
            junk += _size(spans)
            continue
        table, bad = _table(formats[name], text, spans)
        junk, counts[name] = junk + bad, len(table)
        if len(table):
            tables[name] = table
    known = {name: count for name, count in counts.items() if name in formats and count}
    tables = {name: table for name, table in with_units(tables, formats).items() if name in wanted}
    return Scan(tables, known, Damage(int(junk > 0), junk))


def _text(path: Path) -> Bytes:
    """Return a file with line feeds behind it."""
    size = path.stat().st_size
    text = np.empty(size + _PAD, np.uint8)
    with path.open("rb") as file:
        size = file.readinto(text[:size].data)
    text[size:] = ord("\n")
    return text[: size + _PAD]


def _cut(text: Bytes, spans: Spans) -> list[bytes]:
    """Return what is behind the names."""
    return [text[start:end].tobytes() for start, end in spans.tolist()]


def _size(spans: Spans) -> int:
    return int((spans[:, 1] - spans[:, 0]).sum())


def _definition(rest: bytes) -> Format | None:
    cells = [cell.strip() for cell in rest.split(b",")]
    if len(cells) < 4 or not (cells[0].isdigit() and cells[1].isdigit()):
        return None
    kind, length = int(cells[0][:4]), int(cells[1][:4])
    return parse(kind, length, cells[2], cells[3], b",".join(cells[4:]))


def _table(form: Format, text: Bytes, spans: Spans) -> tuple[Table, int]:
    """Read the cells of one message; also the bytes of the lines that are none."""
    columns, good = _quickly(form, text, spans)
    count, left = len(form.columns), np.flatnonzero(~good)
    for i in range(0, len(left), _ROWS):
        rows = left[i : i + _ROWS]
        cells = [line.split(b",", count - 1) for line in _cut(text, spans[rows])]
        rows = rows[[len(row) == count for row in cells]]
        read, good[rows] = _slowly(form, [row for row in cells if len(row) == count])
        for name, values in read.items():
            columns[name][rows] = values
    table = Table(spans[:, 0], columns)
    return table if good.all() else table[good], _size(spans[~good])


def _kind(char: str) -> Any:
    """Type of the column: the widest number of its kind, None for text."""
    if char in "cCeELfdg":
        return np.float64
    return np.uint64 if char in "BHIQ" else np.int64 if char in "bhiq" else None


def _quickly(
    form: Format, text: Bytes, spans: Spans
) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_]]:
    """Read the lines of plain numbers, and tell which they are; leave room for the others."""
    kinds = {name: _kind(char) for name, char in zip(form.columns, form.chars, strict=False)}
    if None not in kinds.values() and len(kinds) == len(form.columns) > 0:
        values, plain = decimals.columns(text, spans[:, 0].copy(), [*kinds.values()])
        return dict(zip(kinds, values, strict=True)), plain
    longest = min(LONGEST_TEXT, int(np.ptp(spans, axis=1).max()))
    room = {name: np.empty(len(spans), kind or f"S{longest}") for name, kind in kinds.items()}
    return room, np.zeros(len(spans), np.bool_)


def _slowly(
    form: Format, cells: list[list[bytes]]
) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_]]:
    """Read cell by cell, and tell which rows are good."""
    good = np.ones(len(cells), np.bool_)
    columns: dict[str, NDArray[Any]] = {}
    for i, (name, char) in enumerate(zip(form.columns, form.chars, strict=False)):
        texts = [row[i].strip() for row in cells]
        kind = _kind(char)
        if kind is None:
            columns[name] = np.array([text[:LONGEST_TEXT] for text in texts], np.bytes_)
            good &= np.array([len(text) <= LONGEST_TEXT for text in texts], np.bool_)
            continue
        values = _reals(texts) if kind is np.float64 else _wholes(texts, kind)
        good &= np.array([value is not None for value in values], np.bool_)
        columns[name] = np.array([value or 0 for value in values], kind)
    return columns, good


def _reals(texts: list[bytes]) -> list[float | None]:
    values = [number(text) for text in texts]
    # what is written as no number is one that the sensor gave
    return [
        value if not isnan(value) or text.lower().strip(b"+-") in (b"nan", b"qnan") else None
        for text, value in zip(texts, values, strict=True)
    ]


def _wholes(texts: list[bytes], kind: Any) -> list[int | None]:
    limits = np.iinfo(kind)
    least, most = int(limits.min), int(limits.max)
    values = [
        int(text) if len(text) <= 20 and text[text[:1] in (b"+", b"-") :].isdigit() else None
        for text in texts
    ]
    return [None if value is None or not least <= value <= most else value for value in values]
