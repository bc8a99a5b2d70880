"""The first lines of a CSV: which bytes are the header, and how the cells stand."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from attest.errors import ReadError

TIME = "time_s"
"""The column of seconds of a canonical CSV."""
BLOCK = 1 << 20
"""Longest header and row, bytes."""

_SEPARATOR = re.compile(rb"\s*\"?sep=[,;\t |]\"?\s*$", re.IGNORECASE)
_LINE = re.compile(rb"[^\r\n]*(?:\r\n?|\n|\Z)")
_UTF8 = b"\xef\xbb\xbf"
FIRST_ROWS = 1 << 16
"""Bytes of rows that are looked at for decimals."""
DECIMAL = re.compile(rb"(?:^|[;\t\n])[ \"']*[-+]?\d*,\d+[ \"']*(?=[;\t\r\n]|$)")
"""A cell that is a number with a decimal comma."""
UTF16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class Layout:
    """How the cells of one file stand."""

    names: tuple[str, ...]
    """By column, empty where there is none."""
    separator: str
    decimal: str
    quoted: bool
    start: int
    """Byte at which the rows begin."""
    comment: str = "#"
    before: int = 0
    """Lines before the header that are no part of it, and were not told to be left out."""


class Lines(NamedTuple):
    """The first line that is neither empty nor a comment, and what stands before it."""

    told: bytes
    """The last comment before it, without its sign."""
    first: bytes
    begin: int
    """Byte at which the first line begins."""
    end: int
    """Byte at which the next one begins."""


def lines(head: bytes, skip: int = 0, comment: bytes = b"#") -> Lines:
    """Find the first line of a file, some lines and Excel's ``sep=;`` left out before it."""
    end = len(_UTF8) if head.startswith(_UTF8) else 0
    told = b""
    for i, match in enumerate(_LINE.finditer(head, end)):  # the first few: no list of all
        line, (begin, end) = match[0], match.span()
        if i < skip or not line.strip() or (i == 0 and _SEPARATOR.match(line)):
            continue
        if not line.lstrip().startswith(comment):
            return Lines(told, line.strip(b" \r\n"), begin, end)
        told = line.strip().removeprefix(comment).strip()
    return Lines(told, b"", end, end)


def has_separator(head: bytes) -> bool:
    """Whether Excel's line that tells the separator comes first."""
    start = len(_UTF8) if head.startswith(_UTF8) else 0
    found = _LINE.match(head, start)
    return found is not None and _SEPARATOR.match(found[0]) is not None


def following(line: Lines, head: bytes) -> Lines:
    """Find the first line behind another one, its place that in the whole."""
    found = lines(head[line.end :])
    return found._replace(begin=found.begin + line.end, end=found.end + line.end)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def cells(line: bytes, separator: str) -> tuple[str, ...]:
    """Split a line into what can be shown of its cells."""
    text = line.decode("utf-8", "replace")
    text = "".join(c if c.isprintable() or c == "\t" else "?" for c in text)
    if separator == " ":
        return tuple(text.split())
    return tuple(cell.strip(" \t\"'") for cell in text.split(separator))


def fields(line: bytes, wanted: Collection[str] = (TIME,)) -> tuple[tuple[str, ...], str]:
    """Split a header by the separator that yields the most of what is wanted, or else the most."""
    known = set(wanted)
    splits = [(cells(line, by), by) for by in ",;\t"]
    return max(splits, key=lambda split: (len(known & set(split[0])), len(split[0])))


def separator(row: bytes) -> str:
    """Return what stands between the cells of a row of numbers; a decimal comma is none."""
    return next((by for by in ";\t" if by.encode() in row), "," if b"," in row else " ")


def read(path: Path) -> bytes:
    """Return the beginning of a file.

    Raises
    ------
    ReadError
        It is UTF-16.
    """
    with path.open("rb") as file:
        head = file.read(2 * BLOCK)
    if head.startswith(UTF16):
        raise in_utf16(path)
    return head


def in_utf16(path: Path) -> ReadError:
    """Return what to say of a file whose characters have two bytes."""
    return ReadError(f"{path}: a CSV in UTF-16. Save it as UTF-8.")


def decimal(separator: str, rows: bytes) -> str:
    """Return the sign before decimals, of the first rows: some may have whole numbers alone."""
    return "," if separator in ";\t" and DECIMAL.search(rows, 0, FIRST_ROWS) else "."
