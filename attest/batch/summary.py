"""The rows of a batch as tables."""

import csv
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from attest.batch.rows import COLUMNS, Row
from attest.files import refused, replacing

if TYPE_CHECKING:
    import pyarrow

ROWS = 4096
"""That are in memory at a time."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What makes a spreadsheet take a text for a formula."""


def write_summary(rows: Iterator[Row], folder: Path) -> tuple[Path, Path]:
    """Write ``summary.csv`` and ``summary.parquet``, in the order of the rows that are given.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    table, parquet = folder / "summary.csv", folder / "summary.parquet"
    with replacing(table) as one, replacing(parquet) as other:
        try:
            _write(map(flat, rows), one, other)
        except OSError as error:
            raise refused(table, error) from error
    return table, parquet


def flat(row: Row) -> dict[str, Any]:
    """Return the columns of a row, each a plain value."""
    return {name: _plain(row.get(name)) for name in COLUMNS}


def _plain(value: object) -> object:
    """Return a value as it is, lists joined, text as UTF-8 can hold it."""
    if isinstance(value, list):
        value = " ".join(map(str, value))
    if isinstance(value, str):  # a path need not be UTF-8
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    return value


def _write(rows: Iterator[dict[str, Any]], table: Path, parquet: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    schema = _schema(pyarrow)
    with (
        table.open("w", encoding="utf-8", newline="") as file,
        pyarrow.parquet.ParquetWriter(parquet, schema, compression="zstd") as writer,
    ):
        lines = csv.writer(file)  # its line ends, of RFC 4180, make it quote a lone \r too
        lines.writerow(COLUMNS)
        for some in _some(rows):
            lines.writerows(map(cells, some))
            writer.write_table(pyarrow.Table.from_pylist(some, schema))


def _some(rows: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while some := list(islice(rows, ROWS)):
        yield some


def cells(row: Mapping[str, Any]) -> list[object]:
    """Return a row's cells; a text that a spreadsheet would run is quoted, as people do it."""
    return [
        f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value
        for value in row.values()
    ]


def _schema(arrow: Any) -> "pyarrow.Schema":
    types = {"text": arrow.string(), "float": arrow.float64(), "int": arrow.int64()}
    return arrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
