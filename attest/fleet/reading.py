"""The rows of summaries, which anybody may have written."""

import csv
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from attest.batch.summary import FORMULA
from attest.errors import ReadError
from attest.fleet.figures import COLUMNS

if TYPE_CHECKING:
    import pyarrow

NEEDED = ("path", "observer", "status")
TEXTS = (
    *(*NEEDED, "sha256", "vehicle", "vehicle_id", "began_utc", "reference", "version", "iron"),
    *("digest", "ran_utc"),
)
NAMES = ("summary.parquet", "summary.csv")
"""In the output of a batch, the better one first."""
MAGIC = b"PAR1"
MOST_BYTES = 8 * 10**9
"""Of all rows in memory; a million have half a gigabyte."""
ROWS = 1 << 16
"""That are read at a time."""
HEAD = 1 << 20
"""Characters of a CSV's first line, at the most."""


def read(named: Sequence[Path]) -> tuple["pyarrow.Table", dict[str, list[str]]]:
    """Return the rows of summaries one behind the other, and what columns each file lacks.

    Raises
    ------
    ReadError
        A file is no summary.
    """
    import pyarrow

    parts, lacking, size = [], {}, 0
    for path in map(_file, named):
        try:
            names = _names(path)
            lacking[str(path)] = [name for name in (*TEXTS, *COLUMNS) if name not in names]
            for batch in _batches(path, [name for name in names if name in {*TEXTS, *COLUMNS}]):
                parts.append(_typed(pyarrow.Table.from_batches([batch]), path))
                size += parts[-1].nbytes
                if size > MOST_BYTES:
                    raise ReadError(f"{path}: too many rows for memory. Name fewer summaries.")
        except (pyarrow.ArrowException, OSError, ValueError, csv.Error) as error:
            raise ReadError(f"{path}: cannot be read: {_line(error)}. {_ADVICE}") from error
    return pyarrow.concat_tables(parts or [_schema().empty_table()]), lacking


_ADVICE = "Name a summary of `attest batch`."


def _line(error: Exception) -> str:
    text = " ".join((getattr(error, "strerror", None) or str(error)).split()).rstrip(".")
    return text if len(text) <= 200 else f"{text[:200]}…"


def _file(named: Path) -> Path:
    """Return the summary that a name stands for."""
    if named.is_dir():
        for name in NAMES:
            if (named / name).is_file():
                return named / name
        raise ReadError(f"{named}: no {' or '.join(NAMES)} in this folder. {_ADVICE}")
    if not named.is_file():
        what = "not a regular" if named.exists() else "no such"
        raise ReadError(f"{named}: {what} file. {_ADVICE}")
    return named


def _names(path: Path) -> list[str]:
    """Return the columns of a summary."""
    import pyarrow.parquet

    if _is_parquet(path):
        names = pyarrow.parquet.read_schema(path).names
    else:
        with path.open(encoding="utf-8-sig", newline="") as file:
            names = next(csv.reader([file.readline(HEAD)]), [])
    if missing := [name for name in NEEDED if name not in names]:
        raise ReadError(f"{path}: no column {', '.join(missing)}. {_ADVICE}")
    twice = [name for name, count in Counter(names).items() if count > 1 and name in TEXTS]
    twice += [name for name, count in Counter(names).items() if count > 1 and name in COLUMNS]
    if twice:
        raise ReadError(f"{path}: the column {twice[0]} is there twice. {_ADVICE}")
    return list(names)


def _is_parquet(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _batches(path: Path, columns: list[str]) -> Iterator["pyarrow.RecordBatch"]:
    import pyarrow.csv
    import pyarrow.parquet

    if _is_parquet(path):
        with pyarrow.parquet.ParquetFile(path) as file:
            yield from file.iter_batches(ROWS, columns=columns)
        return
    how = pyarrow.csv.ConvertOptions(
        include_columns=columns,
        column_types={field.name: field.type for field in _schema()},
        strings_can_be_null=True,
        null_values=[""],
    )
    parse = pyarrow.csv.ParseOptions(newlines_in_values=True)
    with pyarrow.csv.open_csv(path, parse_options=parse, convert_options=how) as reader:
        yield from reader


def _schema() -> "pyarrow.Schema":
    import pyarrow

    types = {name: pyarrow.large_string() for name in TEXTS}
    types |= {name: pyarrow.float64() for name in COLUMNS}
    return pyarrow.schema(list(types.items()))


def _typed(table: "pyarrow.Table", path: Path) -> "pyarrow.Table":
    """Return all columns as they should be, those that are not there without values."""
    import pyarrow
    import pyarrow.compute

    table.validate(full=True)
    columns = []
    for field in _schema():
        if field.name not in table.column_names:
            columns.append(pyarrow.nulls(table.num_rows, field.type))
            continue
        column = table.column(field.name)
        try:
            column = column.cast(field.type)
        except pyarrow.ArrowException as error:
            kind = "text" if field.type == pyarrow.large_string() else "a number"
            raise ReadError(
                f"{path}: the column {field.name} is {column.type}, not {kind}. {_ADVICE}"
            ) from error
        if field.type == pyarrow.large_string():
            signs = "".join(FORMULA)
            column = pyarrow.compute.replace_substring_regex(column, f"^'([{signs}])", r"\1")
            nothing = pyarrow.compute.equal(column, "")
            column = pyarrow.compute.if_else(nothing, None, column)
        columns.append(column)
    return pyarrow.table(columns, schema=_schema())
