"""Cells of a CSV as numbers, read by pyarrow."""

import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.readers.csv_head import BLOCK, Layout, cells, lines
from attest.recording import Note

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Times = NDArray[np.int64]

LATEST = 2**62  # ns: sums and differences of stamps stay within int64
_EXACT = 10**15  # ns: up to here float64 of any unit holds nanoseconds
_BACKWARDS = 0.9  # share of steps
_NUMBER = r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?$"


class Stamps(NamedTuple):
    """The column of time."""

    place: int
    """Counted from 0."""
    digits: int
    """Decimals of its unit that make a nanosecond: 9 of a second."""


class Rows:
    """Cells of the columns wanted, and what was wrong with the rest."""

    def __init__(
        self, table: Any, layout: Layout, stamps: Stamps, wanted: Iterable[int], odd: int
    ) -> None:
        self._columns = dict(zip(table.column_names, table.columns, strict=True))
        self._left = Counter(map(str, wanted))  # uses of each column, let go of after the last
        self._decimal = layout.decimal
        self._bad = 0
        self.t, self.timed = self._times(stamps)
        self.backwards = _backwards(self.t if self.timed.all() else self.t[self.timed])
        if self.backwards:
            self.t, self.timed = self.t[::-1].copy(), self.timed[::-1].copy()
        untimed = int(np.sum(~self.timed))
        self._lines = [
            ("rows with another number of cells than the header, skipped", odd),
            ("rows without a time that can be used, skipped", untimed),
        ]

    def take(self, places: Sequence[int]) -> tuple[Array, NDArray[np.int8]]:
        """Return the values of some columns, and how many cells of each row are filled."""
        y = np.empty((len(self.t), len(places)))
        filled = np.full(len(self.t), len(places), np.int8)
        for k, place in enumerate(places):
            column = self._numbers(self._columns[str(place)])
            start = 0
            for chunk in column.chunks:
                stop = start + len(chunk)
                y[start:stop, k] = chunk.to_numpy(zero_copy_only=False)
                if chunk.null_count:
                    filled[start:stop] -= ~np.asarray(chunk.is_valid())
                start = stop
            self._left[str(place)] -= 1
            if not self._left[str(place)]:
                del self._columns[str(place)]
        return (y[::-1].copy(), filled[::-1].copy()) if self.backwards else (y, filled)

    def notes(self) -> list[Note]:
        """Tell what was wrong, after all has been taken."""
        several = max(1, len(self.t) // 100)  # beyond this the file is in doubt
        told = [*self._lines, ("cells that are no number, taken as empty", self._bad)]
        notes = [Note(text, count, doubt=count > several) for text, count in told if count]
        if self.backwards:
            notes.append(
                Note("time runs backwards: rows taken from the last to the first", doubt=True)
            )
        return notes

    def _times(self, stamps: Stamps) -> tuple[Times, Mask]:
        import pyarrow as pa

        column = self._columns[str(stamps.place)]
        if column.type == pa.binary():
            exact = [_exact(cell, stamps.digits) for cell in self._text(column).to_pylist()]
            ok = np.array([t is not None for t in exact], np.bool_)
            return np.array([t or 0 for t in exact], np.int64), ok
        parts = [_nanoseconds(chunk, stamps.digits) for chunk in column.chunks]
        if not parts:
            return np.empty(0, np.int64), np.empty(0, np.bool_)
        return np.concatenate([t for t, _ in parts]), np.concatenate([ok for _, ok in parts])

    def _numbers(self, column: Any) -> Any:
        import pyarrow as pa

        return (self._text(column) if column.type == pa.binary() else column).cast(pa.float64())

    def _text(self, column: Any) -> Any:
        """Text of the cells that are numbers, null for the others, which are counted."""
        import pyarrow as pa
        import pyarrow.compute as pc

        # bytes of any encoding: only what looks like a number is taken for text
        column = pc.replace_substring_regex(column, rb"^\s+|\s+$", b"")
        column = pc.replace_substring(column, self._decimal.encode(), b".")
        number = pc.fill_null(pc.match_substring_regex(column, _NUMBER), fill_value=False)
        self._bad += pc.sum(pc.and_(pc.is_valid(column), pc.invert(number))).as_py() or 0
        kept = pc.if_else(number, column, pa.scalar(None, column.type))
        return kept.cast(pa.string())


def read_rows(path: Path, layout: Layout, stamps: Stamps, wanted: Sequence[int]) -> Rows:
    """Parse as numbers; only where that fails as text, cell by cell.

    Raises
    ------
    ReadError
        It cannot be split into cells.
    """
    import pyarrow as pa

    # decimals of an integer nanosecond are exact; more are rounded; float64 is quicker if it does
    decimal, real, text = pa.decimal128(38, stamps.digits), pa.float64(), pa.binary()
    encoding = _encoding(path)
    times = [real, decimal] if _begins_small(path, layout, stamps) else [decimal, real]
    for time, value in ((times[0], real), (times[1], real), (text, real), (text, text)):
        types = dict.fromkeys(map(str, wanted), value) | {str(stamps.place): time}
        try:
            table, odd = _parse(path, layout, types, encoding)
        except pa.ArrowInvalid as error:
            if value == text:
                raise _unreadable(path, str(error)) from error
            continue
        if time != real or _small(table[str(stamps.place)], stamps):
            return Rows(table, layout, stamps, wanted, odd)
    raise AssertionError  # pragma: no cover - the last attempt returns or raises


def _unreadable(path: Path, why: str) -> ReadError:
    """Return what to say of a file that cannot be split into cells."""
    with path.open("rb") as file:
        lines = iter(lambda: file.readline(BLOCK + 1), b"")
        number = next((i for i, line in enumerate(lines, 1) if len(line) > BLOCK), None)
    if number is not None:
        return ReadError(
            f"{path}: line {number} is longer than {BLOCK >> 20} MB, as no row is. "
            "Check how the file was made."
        )
    why = why.splitlines()[0].rstrip(".")[:200]
    return ReadError(f"{path}: not a readable CSV: {why}. Mend the file.")


def _encoding(path: Path) -> str:
    """Return one in which any byte of the file is a character, so that no row can fail."""
    with path.open("rb") as file:
        blocks = iter(lambda: file.read(BLOCK), b"")
        return "utf8" if all(block.isascii() for block in blocks) else "latin1"


def _parse(path: Path, layout: Layout, types: dict[str, Any], encoding: str) -> tuple[Any, int]:
    """Table of the columns of these types, and the count of rows that did not fit the header."""
    from pyarrow import csv

    odd = []

    def skip(row: Any) -> str:
        if not (row.text or "").lstrip().startswith(layout.comment):
            odd.append(row.actual_columns)
        return "skip"

    with path.open("rb") as file:  # not the path: pyarrow would unpack a .gz of any size
        file.seek(layout.start)
        table = csv.read_csv(
            io.BufferedReader(_Squeezed(file), BLOCK) if layout.separator == " " else file,
            csv.ReadOptions(
                column_names=[str(i) for i in range(len(layout.names))],
                block_size=BLOCK,
                encoding=encoding,
            ),
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


class _Squeezed(io.RawIOBase):
    """A file with one blank for each run of blanks, and none at the ends of lines."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._rest = self._ready = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._ready and (block := self._file.read(BLOCK)):
            whole, end, self._rest = (self._rest + block).rpartition(b"\n")
            if not end and len(self._rest) > BLOCK:  # no row is that long
                whole, self._rest = self._rest, b""
            self._ready = _squeeze(whole + end)
        if not self._ready:
            self._ready, self._rest = _squeeze(self._rest), b""
        given, self._ready = self._ready[: len(buffer)], self._ready[len(buffer) :]
        buffer[: len(given)] = given
        return len(given)


def _squeeze(text: bytes) -> bytes:
    return re.sub(rb"(?m)^ | (?=\r?$)", b"", re.sub(rb"[ \t]+", b" ", text))


def _begins_small(path: Path, layout: Layout, stamps: Stamps) -> bool:
    """Whether float64 would do for the first stamp."""
    with path.open("rb") as file:
        file.seek(layout.start)
        row = lines(file.read(BLOCK), comment=layout.comment.encode()).first
    try:
        cell = cells(row, layout.separator)[stamps.place].replace(layout.decimal, ".")
        return abs(float(cell)) * 10.0**stamps.digits < _EXACT
    except (ValueError, IndexError):
        return False


def _small(times: Any, stamps: Stamps) -> bool:
    """Whether float64 is exact to the nanosecond."""
    import pyarrow.compute as pc

    largest = pc.max(pc.abs(times)).as_py()
    return largest is None or largest * 10.0**stamps.digits < _EXACT


def _nanoseconds(column: Any, digits: int) -> tuple[Times, Mask]:
    """Integer nanoseconds, and whether they can be used."""
    import pyarrow as pa

    valid = np.asarray(column.is_valid())
    if pa.types.is_decimal(column.type):
        # the integer behind a decimal of so many places, of which 64 bits are enough
        words = np.frombuffer(column.buffers()[1], np.int64, 2 * len(column), 16 * column.offset)
        low, high = words[::2], words[1::2]
        ok = valid & (high == low >> 63) & (low < LATEST) & (low > -LATEST)
        return np.where(ok, low, 0), ok
    times = column.to_numpy(zero_copy_only=False)
    ok = valid & np.isfinite(times)
    return np.rint(np.where(ok, times, 0.0) * 10.0**digits).astype(np.int64), ok


def _backwards(t: Times) -> bool:
    """Whether nearly all stamps are before the last one."""
    return len(t) > 2 and bool(t[0] > t[-1] and np.mean(t[1:] <= t[:-1]) > _BACKWARDS)


def _exact(cell: str | None, digits: int) -> int | None:
    """Nanoseconds of a decimal, rounded; None where there are none."""
    if cell is None or abs(time := Decimal(cell)) >= Decimal(LATEST).scaleb(-digits):
        return None
    return int(time.scaleb(digits).to_integral_value())
