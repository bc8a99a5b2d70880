"""Cells of a CSV: which bytes are the header, and its columns as numbers, read by pyarrow."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.recording import Note

Array = NDArray[np.float64]
Times = NDArray[np.int64]

TIME = "time_s"
"""The column of seconds."""

_BLOCK = 1 << 20  # longest header and row, bytes
_LATEST = 2**62  # ns: sums and differences of stamps stay within int64
_EXACT = 1e6  # s: up to here float64 seconds hold nanoseconds
_NUMBER = r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?$"


@dataclass(frozen=True, slots=True)
class Layout:
    """How the cells of one file stand."""

    names: tuple[str, ...]
    separator: str
    decimal: str
    quoted: bool
    start: int
    """Byte at which the rows begin."""
    encoding: str


class Rows(NamedTuple):
    """Cells of the columns wanted, and what was wrong with the rest."""

    t: Times
    timed: NDArray[np.bool_]
    cells: dict[str, tuple[Array, NDArray[np.bool_]]]
    """By column: values, and whether there is one."""
    notes: list[Note]


def header(head: bytes) -> tuple[bytes, int]:
    """First line that is neither empty nor a comment, and where the next one starts."""
    start = len(b"\xef\xbb\xbf") if head.startswith(b"\xef\xbb\xbf") else 0
    for line in head[start:].splitlines(keepends=True):
        start += len(line)
        if line.strip() and not line.lstrip().startswith(b"#"):
            return line.strip(), start
    return b"", start


def fields(line: bytes) -> tuple[tuple[str, ...], str]:
    """Column names of a header, and the separator that yields ``time_s`` or else the most."""
    text = line.decode("utf-8", "replace")
    text = "".join(c if c.isprintable() or c == "\t" else "?" for c in text)  # names are shown
    splits = [(tuple(cell.strip(" \t\"'") for cell in text.split(by)), by) for by in ",;\t"]
    return max(splits, key=lambda split: (TIME in split[0], len(split[0])))


def layout(path: Path) -> Layout:
    """Look at the header and the first row.

    Raises
    ------
    ReadError
        There is none, or no ``time_s`` column.
    """
    with path.open("rb") as file:
        head = file.read(2 * _BLOCK)
        rest = iter(lambda: file.read(_BLOCK), b"")
        ascii_only = head.isascii() and all(block.isascii() for block in rest)
    line, start = header(head[:_BLOCK])
    if not line:
        raise ReadError(f"{path}: no header line. Start the file with time_s, gyro_x, ….")
    names, separator = fields(line)
    if TIME not in names:
        raise ReadError(f"{path}: no time_s column. Name the column of seconds time_s.")
    row, _ = header(head[start:])
    if not row:
        raise ReadError(f"{path}: a header and no rows. Check how the file was made.")
    decimal = "," if separator == ";" and b"," in row else "."
    encoding = "utf8" if ascii_only else "latin1"  # any byte is a character: no row can fail
    return Layout(names, separator, decimal, b'"' in line, start, encoding)


def read_rows(path: Path, layout: Layout, wanted: Sequence[str]) -> Rows:
    """Parse as numbers; only where that fails as text, cell by cell."""
    import pyarrow as pa

    # nine decimals are nanoseconds as integers; more are rounded; epoch seconds need Decimal
    decimal, real, text = pa.decimal128(38, 9), pa.float64(), pa.binary()
    for time, value in ((decimal, real), (real, real), (text, real), (text, text)):
        types = {name: time if name == TIME else value for name in wanted}
        try:
            table, odd = _parse(path, layout, types)
        except pa.ArrowInvalid as error:
            if value == text:
                why = str(error).splitlines()[0].rstrip(".")[:200]
                raise ReadError(f"{path}: not a readable CSV: {why}. Mend the file.") from error
            continue
        if time == real and not _small(table[TIME]):
            continue
        return _rows(table, layout, odd)
    raise AssertionError  # pragma: no cover - the last attempt returns or raises


def _parse(path: Path, layout: Layout, types: dict[str, Any]) -> tuple[Any, int]:
    """Table of the columns of these types, and the count of rows that did not fit the header."""
    from pyarrow import csv

    odd = []
    # what is not used may have any name, and twice
    names = [name if name in types else f"unused {i}" for i, name in enumerate(layout.names)]

    def skip(row: Any) -> str:
        if not (row.text or "").lstrip().startswith("#"):
            odd.append(row.actual_columns)
        return "skip"

    with path.open("rb") as file:  # not the path: pyarrow would unpack a .gz of any size
        file.seek(layout.start)
        table = csv.read_csv(
            file,
            csv.ReadOptions(column_names=names, block_size=_BLOCK, encoding=layout.encoding),
            csv.ParseOptions(
                delimiter=layout.separator,
                quote_char='"' if layout.quoted else False,
                invalid_row_handler=skip,
            ),
            csv.ConvertOptions(
                column_types=types,
                include_columns=list(types),
                null_values=[""],
                strings_can_be_null=True,
                decimal_point=layout.decimal,
            ),
        )
    return table, len(odd)


def _small(seconds: Any) -> bool:
    """Whether float64 seconds are exact to the nanosecond."""
    import pyarrow.compute as pc

    largest = pc.max(pc.abs(seconds)).as_py()
    return largest is None or largest < _EXACT


def _rows(table: Any, layout: Layout, odd: int) -> Rows:
    import pyarrow as pa

    bad = 0
    cells = {}
    for name, chunks in zip(table.column_names, table.columns, strict=True):
        column = chunks.combine_chunks()
        if column.type == pa.binary():
            column, junk = _numbers(column, layout.decimal)
            bad += junk
        if name == TIME:
            t, timed = _nanoseconds(column)
        else:
            if column.type == pa.string():
                column = column.cast(pa.float64())
            cells[name] = _filled(column)
    several = max(1, len(t) // 100)  # beyond this the file is in doubt
    lines = (
        ("rows with another number of cells than the header, skipped", odd),
        ("cells that are no number, taken as empty", bad),
        ("rows without a time that can be used, skipped", int(np.sum(~timed))),
    )
    notes = [Note(text, count, doubt=count > several) for text, count in lines if count]
    return Rows(t, timed, cells, notes)


def _numbers(column: Any, decimal: str) -> tuple[Any, int]:
    """Text of the cells that are numbers, null for the others, and how many of those there are."""
    import pyarrow as pa
    import pyarrow.compute as pc

    # bytes of any encoding: only what looks like a number is taken for text
    column = pc.replace_substring_regex(column, rb"^\s+|\s+$", b"")
    column = pc.replace_substring(column, decimal.encode(), b".")
    number = pc.fill_null(pc.match_substring_regex(column, _NUMBER), fill_value=False)
    junk = pc.sum(pc.and_(pc.is_valid(column), pc.invert(number))).as_py() or 0
    kept = pc.if_else(number, column, pa.scalar(None, column.type))
    return kept.cast(pa.string()), junk


def _nanoseconds(column: Any) -> tuple[Times, NDArray[np.bool_]]:
    """Integer nanoseconds, and whether they can be used."""
    import pyarrow as pa

    if pa.types.is_decimal(column.type):
        # the integer behind a decimal of nine places, of which 64 bits are enough
        words = np.frombuffer(column.buffers()[1], np.int64, 2 * len(column), 16 * column.offset)
        low, high = words[::2], words[1::2]
        ok = _valid(column) & (high == low >> 63) & (low < _LATEST) & (low > -_LATEST)
        return np.where(ok, low, 0), ok
    if pa.types.is_string(column.type):
        exact = [_exact(cell) for cell in column.to_pylist()]
        ok = np.array([t is not None for t in exact], np.bool_)
        return np.array([t or 0 for t in exact], np.int64), ok
    seconds, ok = _filled(column)
    ok &= np.isfinite(seconds)
    return np.rint(np.where(ok, seconds, 0.0) * 1e9).astype(np.int64), ok


def _exact(cell: str | None) -> int | None:
    """Nanoseconds of decimal seconds, rounded; None where there are none."""
    if cell is None or abs(seconds := Decimal(cell)) >= _LATEST // 10**9:
        return None
    return int((seconds * 10**9).to_integral_value())


def _filled(column: Any) -> tuple[Array, NDArray[np.bool_]]:
    """Values, NaN where a cell is empty, and where it is not."""
    return column.to_numpy(zero_copy_only=False), _valid(column)


def _valid(column: Any) -> NDArray[np.bool_]:
    if not column.null_count:
        return np.ones(len(column), np.bool_)
    return np.asarray(column.is_valid())
