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

LONGEST = 1 << 16
"""Bytes of a line that can be one."""


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
    lines: dict[str, Lines] = {}
    counts: Counter[bytes] = Counter()
    junk = at = 0
    with path.open("rb") as file:
        while line := file.readline(LONGEST):
            name, comma, rest = line.partition(b",")
            if not comma or len(name) > 16:
                junk += len(line) if line.strip() else 0
            else:
                counts[name] += 1
                if name in wanted:
                    lines.setdefault(wanted[name], []).append((at, rest))
            at += 1
    return lines, Counter({name.decode("latin-1"): n for name, n in counts.items()}), junk


def _definition(rest: bytes) -> Format | None:
    cells = [cell.strip() for cell in rest.split(b",")]
    if len(cells) < 4 or not (cells[0].isdigit() and cells[1].isdigit()):
        return None
    kind, length = int(cells[0][:4]), int(cells[1][:4])
    return parse(kind, length, cells[2], cells[3], b",".join(cells[4:]))


def _table(form: Format, lines: Lines) -> tuple[Table, int]:
    """Read the cells of one message; also the bytes of the lines that are none."""
    count = len(form.columns)
    whole = [(at, rest) for at, rest in lines if rest.count(b",") >= count - 1]
    bad = sum(len(rest) for _, rest in lines) - sum(len(rest) for _, rest in whole)
    at = np.array([place for place, _ in whole], np.int64)
    try:
        columns = _quickly(form, [rest for _, rest in whole])
    except ValueError:  # what pyarrow raises too
        cells = [rest.split(b",", count - 1) for _, rest in whole]
        columns, good = _slowly(form, cells)
        bad += sum(len(rest) for (_, rest), kept in zip(whole, good, strict=True) if not kept)
        return Table(at, columns)[good], bad
    return Table(at, columns), bad


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
