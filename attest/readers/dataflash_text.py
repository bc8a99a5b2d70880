"""The messages of a DataFlash log as text: ``NAME, value, value``, one on each line."""

from collections import Counter
from collections.abc import Collection
from io import BytesIO
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

Lines = list[tuple[int, bytes]]
"""Places of lines, and what stands behind the name."""

NAMED = 5
"""Bytes in which a line has its name, of four at most, and a comma."""


def recognises(head: bytes) -> bool:
    """Whether some line describes a message."""
    lines = (line for line in head.splitlines() if line.startswith(b"FMT,"))
    return any(_definition(line.partition(b",")[2]) is not None for line in lines)


def scan(path: Path, wanted: Collection[str]) -> Scan:
    """Read the wanted messages of a log."""
    names = {name.encode(): name for name in {*wanted, "FMT", "UNIT", "MULT", "FMTU"}}
    lines, counts, junk = _lines(path, names)
    formats = {"FMT": FMT_FORMAT}
    for _, rest in lines.pop("FMT", []):
        if (form := _definition(rest)) is not None:
            formats[form.name] = form
    tables = {}
    for name, found in lines.items():
        if name not in formats:
            junk += sum(len(rest) for _, rest in found)
            continue
        table, bad = _table(formats[name], found)
        junk, counts[name] = junk + bad, len(table)
        if len(table):
            tables[name] = table
    known = {name: count for name, count in counts.items() if name in formats and count}
    tables = {name: table for name, table in with_units(tables, formats).items() if name in wanted}
    return Scan(tables, known, Damage(int(junk > 0), junk))


def _lines(path: Path, wanted: dict[bytes, str]) -> tuple[dict[str, Lines], Counter[str], int]:
    """Sort the lines by name, count all names, and the bytes in lines without one."""
    data = path.read_bytes() + b"\n" + bytes(NAMED)
    text = np.frombuffer(data, np.uint8)
    end = np.flatnonzero(text == ord("\n"))
    start = np.concatenate([[0], end[:-1] + 1])
    key = _names(text, start)
    lines: dict[str, Lines] = {}
    for name, known in wanted.items():
        rows = np.flatnonzero(key == int.from_bytes(name, "little"))
        first = (start[rows] + len(name) + 1).tolist()
        cut = [data[a:b] for a, b in zip(first, (end[rows] + 1).tolist(), strict=True)]
        lines[known] = [*zip(rows.tolist(), cut, strict=True)]
    junk = int((end - start)[key == 0].sum())
    told = zip(*(found.tolist() for found in np.unique_counts(key[key > 0])), strict=True)
    counts = {name.to_bytes(8, "little").rstrip(b"\0"): count for name, count in told}
    return lines, Counter({name.decode("latin-1"): n for name, n in counts.items()}), junk


def _names(text: NDArray[np.uint8], start: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return the bytes before the first comma of each line as one number; 0 where none is near."""
    key = np.zeros(len(start), np.uint64)
    open_ = np.ones(len(start), np.bool_)
    for i in range(NAMED):
        byte = text[start + i]
        open_ &= byte != ord(",")
        key |= np.where(open_, byte.astype(np.uint64) << np.uint64(8 * i), np.uint64(0))
    key[open_] = 0
    return key


def _definition(rest: bytes) -> Format | None:
    cells = [cell.strip() for cell in rest.split(b",")]
    if len(cells) < 4 or not (cells[0].isdigit() and cells[1].isdigit()):
        return None
    kind, length = int(cells[0][:4]), int(cells[1][:4])
    return parse(kind, length, cells[2], cells[3], b",".join(cells[4:]))


def _table(form: Format, lines: Lines) -> tuple[Table, int]:
    """Read the cells of one message; also the bytes of the lines that are none."""
    at = np.array([place for place, _ in lines], np.int64)
    try:
        return Table(at, _quickly(form, [rest for _, rest in lines])), 0
    except ValueError:  # what pyarrow raises too
        count = len(form.columns)
        cells = [rest.split(b",", count - 1) for _, rest in lines]
        full = np.array([len(row) == count for row in cells], np.bool_)
        columns, read = _slowly(form, [row for row in cells if len(row) == count])
        good = full.copy()
        good[full] = read
        bad = sum(len(rest) for (_, rest), kept in zip(lines, good, strict=True) if not kept)
        return Table(at[full], columns)[read], bad


def _kind(char: str) -> Any:
    """Type of the column: the widest number of its kind, None for text."""
    if char in "cCeELfdg":
        return np.float64
    return np.uint64 if char in "BHIQ" else np.int64 if char in "bhiq" else None


def _quickly(form: Format, lines: list[bytes]) -> dict[str, NDArray[Any]]:
    """Let pyarrow read them, who refuses all if one cell is no number."""
    import pyarrow as pa
    from pyarrow import csv

    kinds = [_kind(char) for char, _ in zip(form.chars, form.columns, strict=False)]
    if not lines or None in kinds:
        raise ValueError(form.name)
    types = {name: pa.from_numpy_dtype(kind)
             for name, kind in zip(form.columns, kinds, strict=False)}  # fmt: skip
    table = csv.read_csv(
        BytesIO(b"".join(lines)),
        csv.ReadOptions(column_names=list(types)),
        csv.ParseOptions(quote_char=False),
        csv.ConvertOptions(column_types=types, null_values=[]),
    )
    if table.num_rows != len(lines):
        raise ValueError(form.name)
    return {name: table[name].to_numpy() for name in types}


def _slowly(
    form: Format, cells: list[list[bytes]]
) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_]]:
    """Read cell by cell, and tell which rows are good."""
    columns: dict[str, NDArray[Any]] = {}
    good = np.ones(len(cells), np.bool_)
    for i, (name, char) in enumerate(zip(form.columns, form.chars, strict=False)):
        texts = [row[i].strip() for row in cells]
        kind = _kind(char)
        if kind is None:
            columns[name] = np.array(texts, np.bytes_)
            continue
        values = [_real(text) if kind is np.float64 else _whole(text, kind) for text in texts]
        good &= np.array([value is not None for value in values], np.bool_)
        columns[name] = np.array([value or 0 for value in values], kind)
    return columns, good


def _real(text: bytes) -> float | None:
    value = number(text)
    # what is written as no number is one that the sensor gave
    meant = not isnan(value) or text.lower().strip(b"+-") in (b"nan", b"qnan")
    return value if meant else None


def _whole(text: bytes, kind: Any) -> int | None:
    if not text.lstrip(b"+-").isdigit() or len(text) > 20:
        return None
    limits = np.iinfo(kind)
    value = int(text)
    return value if limits.min <= value <= limits.max else None
