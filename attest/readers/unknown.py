"""What to say of a file that no reader knows, by what is in it."""

from pathlib import Path

from attest.errors import ReadError
from attest.readers import csv_head, csv_layouts

COMPRESSED = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"PK\x05\x06": "zip",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"BZh": "bzip2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""By the bytes that a file begins with."""
SHOWN = 8
"""Names of columns that fit one line."""
ROWS = 4
"""Lines behind a header among which there must be one of numbers: units may stand between."""
MAP = "by input.csv in a YAML (README.md, Configuration), and name it by --observer"


def compressed(path: Path, head: bytes) -> ReadError | None:
    """Return what to say of a file that must be unpacked; None of any other."""
    for begins, name in COMPRESSED.items():
        if head.startswith(begins):
            return ReadError(f"{path}: is compressed ({name}). Unpack it first.")
    return None


def refusal(path: Path, head: bytes, formats: str) -> ReadError:
    """Return what to say of a file that is no log."""
    if csv_layouts.of_trajectory(path) is not None:
        return csv_layouts.no_log(path)
    text = head.decode("utf-16", "replace").encode() if head.startswith(csv_head.UTF16) else b""
    if columns(text) is not None:
        return csv_head.in_utf16(path)
    names = columns(head)
    if names is None:
        return ReadError(
            f"{path}: not a log that attest knows ({formats}). Check that it is the file you meant."
        )
    if not names:
        return ReadError(
            f"{path}: a CSV without names of its columns. Tell their numbers {MAP}, "
            "with header: false."
        )
    return ReadError(
        f"{path}: a CSV whose columns attest does not know: {listed(names)}. Tell them {MAP}."
    )


def columns(head: bytes) -> list[str] | None:
    """Return the names of a CSV's columns, none where the first line is one of numbers.

    None of a file that is no CSV.
    """
    if b"\0" in head:
        return None
    line = csv_head.lines(head)
    if _is_numbers(line.first):
        told = _cells(line.told)
        return [] if len(told) != len(_cells(line.first)) else _named(told)
    names, head = _cells(line.first), head[line.end :]
    for _ in range(ROWS):
        row = csv_head.lines(head)
        if _is_numbers(row.first):
            return _named(names) if len(names) > 1 else None
        head = head[row.end :]
    return None


def listed(names: list[str]) -> str:
    """Return the first of some names, and how many there are in all."""
    shown = ", ".join(name[:40] for name in names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown}, … ({len(names)} in all)"


def _named(names: tuple[str, ...]) -> list[str]:
    return [name for name in names if name]


def _cells(line: bytes) -> tuple[str, ...]:
    return csv_head.cells(line, csv_head.separator(line))


def _is_numbers(line: bytes) -> bool:
    """Whether most cells of a line are numbers, two or more."""
    filled = _named(_cells(line))
    numbers = sum(_is_number(cell) for cell in filled)
    return numbers > 1 and 2 * numbers > len(filled)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
