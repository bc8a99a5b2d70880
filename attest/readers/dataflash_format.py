"""How a DataFlash log describes its own messages: FMT, UNIT, MULT and FMTU.

A format is a string of characters, one for each column; most are plain numbers, some imply a
divisor. What is common to the binary log and its text is here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

DTYPES = {
    "a": ("<i2", (32,)), "b": "i1", "B": "u1", "g": "<f2", "h": "<i2", "H": "<u2", "i": "<i4",
    "I": "<u4", "f": "<f4", "d": "<f8", "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2",
    "e": "<i4", "E": "<u4", "L": "<i4", "M": "i1", "q": "<i8", "Q": "<u8",
}  # fmt: skip
"""What each character of a format stands for in memory."""
DIVISORS = {"c": 1e2, "C": 1e2, "e": 1e2, "E": 1e2, "L": 1e7}
"""By which the integer is to be divided."""
FMT = 0x80
"""The message that describes messages, itself always the same."""
HEADER = 3
"""Bytes before the fields: two marks and the type."""


@dataclass(frozen=True)
class Format:
    """One message type."""

    kind: int
    length: int
    """Bytes with the header."""
    name: str
    chars: str
    columns: tuple[str, ...]

    @cached_property
    def dtype(self) -> np.dtype[np.void] | None:
        """The whole message; None where characters and length contradict each other."""
        fields: list[tuple[str, object]] = [("", f"V{HEADER}")]
        names = dict.fromkeys(self.columns)
        if len(names) != len(self.columns) or len(names) > len(self.chars):
            return None
        for i, char in enumerate(self.chars):
            name = self.columns[i] if i < len(self.columns) else f"#{i}"
            fields.append((name, DTYPES[char]))
        dtype = np.dtype([(name or "#", kind) for name, kind in fields])
        return dtype if dtype.itemsize == self.length else None

    @property
    def timed(self) -> bool:
        """Whether the message begins with microseconds since boot."""
        return self.chars[:1] == "Q" and self.columns[:1] == ("TimeUS",)


FMT_FORMAT = Format(FMT, 89, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Messages of one name, in file order."""

    at: Ints
    """Place in the file, bytes."""
    columns: Mapping[str, NDArray[Any]]
    """Values by name, divided where the format says so."""
    units: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    """Unit, and by what to multiply to have it, of the columns for which the log tells."""

    def __len__(self) -> int:
        return len(self.at)

    def __getitem__(self, chosen: Mask | Ints) -> "Table":
        columns = {name: column[chosen] for name, column in self.columns.items()}
        return Table(self.at[chosen], columns, self.units)


@dataclass(frozen=True, slots=True)
class Damage:
    """What of a log is not sound."""

    gaps: int = 0
    """Stretches in which no message can be told."""
    bytes_skipped: int = 0
    cut: bool = False
    """Whether the last message is not whole."""


@dataclass(frozen=True, slots=True)
class Scan:
    """A whole log."""

    tables: dict[str, Table]
    """The wanted messages that are there, by name."""
    counts: dict[str, int]
    """All messages by name."""
    damage: Damage
    contradictory: tuple[str, ...] = ()
    """Names of wanted messages whose format does not fit their length."""


def parse(kind: int, length: int, name: bytes, chars: bytes, columns: bytes) -> Format | None:
    """Return a description; None where it cannot be one."""
    try:
        texts = [part.split(b"\0")[0].decode("ascii") for part in (name, chars, columns)]
    except UnicodeDecodeError:
        return None
    known = all(char in DTYPES for char in texts[1])
    if not (known and texts[0].isalnum() and texts[2].isprintable() and length >= HEADER):
        return None
    return Format(kind, length, texts[0], texts[1], tuple(filter(None, texts[2].split(","))))


def with_units(tables: Mapping[str, Table], formats: Mapping[str, Format]) -> dict[str, Table]:
    """Give tables the units that UNIT, MULT and FMTU tell; these are to be among the tables."""
    labels = _lookup(tables.get("UNIT"), "Label")
    factors = _lookup(tables.get("MULT"), "Mult")
    told = _ids(tables.get("FMTU"))
    found = {}
    for name, table in tables.items():
        form = formats[name]
        units = _units(form, *told[form.kind], labels, factors) if form.kind in told else {}
        found[name] = Table(table.at, table.columns, units)
    return found


def _lookup(table: Table | None, value: str) -> dict[str, str]:
    """Return what each one-character id means, as text."""
    if table is None or not {"Id", value} <= table.columns.keys():
        return {}
    ids, values = table.columns["Id"].tolist(), table.columns[value].tolist()
    pairs = zip(ids, values, strict=True)
    return {chr(int(key) & 0xFF): text_of(meaning) for key, meaning in pairs}


def _ids(table: Table | None) -> dict[int, tuple[str, str]]:
    """Ids of units and of multipliers by message number."""
    names = ("FmtType", "UnitIds", "MultIds")
    if table is None or not set(names) <= table.columns.keys():
        return {}
    rows = zip(*(table.columns[name].tolist() for name in names), strict=True)
    return {int(kind): (text_of(units), text_of(factors)) for kind, units, factors in rows}


def _units(
    form: Format,
    unit_ids: str,
    factor_ids: str,
    labels: Mapping[str, str],
    factors: Mapping[str, str],
) -> dict[str, tuple[str, float]]:
    units = {}
    for i, (name, char) in enumerate(zip(form.columns, form.chars, strict=False)):
        # what is divided as its format says has its unit already
        factor = 1.0 if char in DIVISORS else number(factors.get(factor_ids[i : i + 1], "1"))
        # written as a float32 and widened: seven digits are what was meant; 0 is none
        rounded = float(f"{factor:.7g}")
        usable = np.isfinite(rounded) and rounded != 0.0
        units[name] = (labels.get(unit_ids[i : i + 1], ""), rounded if usable else 1.0)
    return units


def number(text: str | bytes) -> float:
    """Return a cell of text as a number, NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def text_of(cell: object) -> str:
    """Return a cell as text, whatever its bytes are."""
    return cell.decode("latin-1") if isinstance(cell, bytes) else str(cell)
