"""What stands before the columns of a CSV: lines of a logger's own, and where the header is."""

import re
from pathlib import Path
from typing import NamedTuple

from attest.errors import ReadError
from attest.readers import csv_head
from attest.readers.csv_head import TIME, Layout, Lines

LONGEST = 100
"""Lines before a header that are looked past."""
FEWEST = 4
"""Cells of a header behind other lines: a time and a vector, or else it is a line of text."""
BETWEEN = 4
"""Lines behind a header among which there must be one of numbers: units may stand between."""
WIDEST = 1 << 16
"""Bytes of a file in which columns are looked for."""


class Columns(NamedTuple):
    """What the columns of a CSV are named, and how many lines there are before them."""

    names: list[str]
    """None where no line names them."""
    skip: int
    """Lines before the header, or before the rows if there is none, that no reading leaves out."""


def canonical(path: Path) -> Layout:
    """Look at the header and the first row of a canonical CSV.

    Raises
    ------
    ReadError
        There is none, or no ``time_s`` column.
    """
    head = csv_head.read(path)
    line, before = header(head[: csv_head.BLOCK])
    if not line.first:
        raise ReadError(f"{path}: no header line. Start the file with time_s, gyro_x, ….")
    names, by = csv_head.fields(line.first)
    if TIME not in names:
        raise ReadError(f"{path}: no time_s column. Name the column of seconds time_s.")
    row = csv_head.following(line, head).first
    if not row:
        raise ReadError(f"{path}: a header and no rows. Check how the file was made.")
    point = csv_head.decimal(by, row + b"\n" + head[line.end :])
    return Layout(names, by, point, b'"' in line.first, line.end, before=before)


def header(head: bytes) -> tuple[Lines, int]:
    """Find the line that names ``time_s``, and how many lines before it are no part of it.

    It names more than the time, and numbers follow. The first line where there is no such line.
    """
    first = line = csv_head.lines(head)
    before = int(csv_head.has_separator(head))
    for passed in range(LONGEST):
        if _is_followed(line, head):
            return line, before + passed
        line = csv_head.following(line, head)
    return first, before


def columns(head: bytes) -> Columns | None:
    """Find the columns of a CSV that begins so, by its first row of numbers; None if it is none."""
    head = head[:WIDEST]
    if b"\0" in head:
        return None
    passed: list[Lines] = []
    line = csv_head.lines(head)
    while line.first and len(passed) < LONGEST:
        if _is_numbers(line.first):
            return _named(passed, line, head)
        passed.append(line)
        line = csv_head.following(line, head)
    return None


def _is_followed(line: Lines, head: bytes) -> bool:
    """Whether a line names time and more, and the next one has a number in the place of time."""
    names, by = csv_head.fields(line.first)
    if TIME not in names or len(names) < FEWEST:
        return False
    row = csv_head.cells(csv_head.following(line, head).first, by)
    place = names.index(TIME)
    return len(row) > place and csv_head.is_number(row[place])


def _named(passed: list[Lines], row: Lines, head: bytes) -> Columns | None:
    """Return the columns by the last lines before a row that could name them."""
    by = csv_head.separator(row.first)
    width = len(csv_head.cells(row.first, by))
    near = passed[-BETWEEN:]
    headers = [line for line in near if len(csv_head.cells(line.first, by)) == width]
    headers += [line for line in near if len(csv_head.cells(line.first, by)) > 1]
    if headers:
        skip = _count(head[: headers[0].begin]) if headers[0] is not passed[0] else 0
        return Columns([*filter(None, csv_head.cells(headers[0].first, by))], skip)
    told = csv_head.cells(row.told, by)
    names = [*filter(None, told)] if len(told) == width else []
    # one line of numbers is not yet a table
    if passed and not names and not _is_numbers(csv_head.following(row, head).first):
        return None
    return Columns(names, _count(head[: row.begin]) if passed else 0)


def _count(head: bytes) -> int:
    return len(re.findall(rb"\r\n?|\n", head))


def _is_numbers(line: bytes) -> bool:
    """Whether most cells of a line are numbers, two or more."""
    filled = [*filter(None, csv_head.cells(line, csv_head.separator(line)))]
    numbers = sum(csv_head.is_number(cell) for cell in filled)
    return numbers > 1 and 2 * numbers > len(filled)
