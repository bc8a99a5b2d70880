"""How the cells of a CSV stand whose columns are told, and where these columns are."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from attest.config import Csv
from attest.errors import ConfigError, ReadError
from attest.readers import csv_head, csv_preamble
from attest.readers.csv_head import Layout


def layout(path: Path, csv: Csv, wanted: Sequence[str]) -> Layout:
    """How the cells stand, as far as told, and else as it looks."""
    head = csv_head.read(path)
    sign = csv.comment.encode()
    line = csv_head.lines(head, csv.skip, sign)
    names: tuple[str, ...] = ()
    start, row = line.begin, line.first
    if csv.header and line.first:
        # a header may stand in a comment
        header = max(line.first, line.told, key=lambda text: _found(text, csv.separator, wanted))
        names, by = _split(header, csv.separator, wanted)
        if header is line.first:
            start, row = line.end, csv_head.lines(head[line.end :], 0, sign).first
    else:
        by = csv.separator or csv_head.separator(row)
    if not row:
        raise ReadError(f"{path}: no rows. Check the file, and input.csv.skip.")
    width = len(csv_head.cells(row, by))
    if not names or row.endswith(by.encode()):  # that ends each row
        names += ("",) * (width - len(names))
    quoted = b'"' in line.first + row
    point = csv.decimal or csv_head.decimal(by, row + b"\n" + head[start:])
    before = int(not csv.skip and csv_head.has_separator(head))
    return Layout(names, by, point, quoted, start, csv.comment, before)


def _split(
    header: bytes, separator: str | None, wanted: Sequence[str]
) -> tuple[tuple[str, ...], str]:
    if separator:
        return csv_head.cells(header, separator), separator
    split = csv_head.fields(header, wanted)
    return split if len(split[0]) > 1 else (csv_head.cells(header, " "), " ")


def _found(header: bytes, separator: str | None, wanted: Sequence[str]) -> int:
    return len(set(_split(header, separator, wanted)[0]) & set(wanted))


def places(
    path: Path, csv: Csv, layout: Layout, told: Mapping[str, Sequence[str | int]]
) -> dict[str, tuple[int, ...]]:
    """Places of the columns of each key."""
    try:
        return {
            key: tuple(place(path, layout, column, f"input.csv.{key}") for column in columns)
            for key, columns in told.items()
        }
    except ConfigError as error:
        found = csv_preamble.columns(csv_head.read(path))
        if found is None or found.skip <= csv.skip or bool(found.names) is not csv.header:
            raise
        cure = f"The columns begin behind other lines: --set input.csv.skip={found.skip}"
        raise ConfigError(f"{error} {cure}") from error


def place(path: Path, layout: Layout, column: str | int, key: str) -> int:
    """Place of a column by its name or number."""
    names = layout.names
    if isinstance(column, int):
        if column > len(names):
            raise ConfigError(f"{path}: no column {column} for {key}. The file has {len(names)}.")
        return column - 1
    if names.count(column) == 1:
        return names.index(column)
    if column in names:
        raise ConfigError(f"{path}: two columns are named {column!r}. Give {key} its number.")
    alike = {name.lower(): name for name in names if name}
    near = get_close_matches(column.lower(), alike, n=1, cutoff=0.4)
    hint = f"Did you mean {alike[near[0]]!r}? " if near else ""
    held = ", ".join(filter(None, names))[:300] or f"{len(names)} columns without names"
    raise ConfigError(f"{path}: no column {column!r} for {key}. {hint}The file has: {held}.")
