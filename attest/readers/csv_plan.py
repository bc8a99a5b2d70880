"""What is taken from the columns of a CSV: by their canonical names, or as the user maps them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from attest.config import UNITS, Csv
from attest.errors import ConfigError, ReadError
from attest.readers import csv_columns, csv_head, csv_preamble
from attest.readers.csv_cells import Stamps
from attest.readers.csv_head import TIME, Layout
from attest.recording import Kind

_REF = ("ref_qw", "ref_qx", "ref_qy", "ref_qz")
_POSITION = ("lat_deg", "lon_deg", "alt_m")
_NAMES = {"vel": "velocity"}
"""Signals that go by another name in a Recording."""
_RESERVED = ("position", "velocity")
"""Signals with a meaning that ``<name>_x`` columns would not have."""
_FACTORS = {unit: factor for units in UNITS.values() for unit, factor in units.items()}
"""To SI."""
_UNITS = {name: next(iter(units)) for name, units in UNITS.items()}
"""Of the columns that go by their canonical names."""
DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Decimals of each unit of time that make a nanosecond."""


class Group(NamedTuple):
    """Columns that make up one signal."""

    places: tuple[int, ...]
    """Counted from 0."""
    source: str
    """The columns' names."""
    unit: str = ""
    """Of the cells, if not SI."""

    @property
    def factor(self) -> float:
        """To SI."""
        return _FACTORS.get(self.unit, 1.0)


class Attitude(NamedTuple):
    """Columns that make up a reference."""

    group: Group
    """Of w, x, y, z."""
    kind: Kind
    by: str
    """Who says that it is of this kind."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is taken from which columns of one file."""

    layout: Layout
    stamps: Stamps
    signals: Mapping[str, Group]
    references: Mapping[str, Attitude]
    unused: Sequence[str] = ()
    clock: str = TIME
    """The column of time by name."""


def canonical(path: Path) -> Plan:
    """Plan for a CSV whose header names everything.

    Raises
    ------
    ReadError
        It does not, or names it twice.
    """
    layout = csv_preamble.canonical(path)
    groups = _groups(layout.names)
    used = {name for group in groups.values() for name in group} | {TIME}
    held = Counter(layout.names)
    if twice := sorted(name for name in used if held[name] > 1):
        raise ReadError(f"{path}: two columns are named {twice[0]}. Rename one.")
    place = {name: i for i, name in enumerate(layout.names)}
    found = {
        name: Group(tuple(place[column] for column in columns), ", ".join(columns))
        for name, columns in groups.items()
    }
    attitudes = {}
    if "ref" in found:
        attitudes["ref"] = Attitude(found.pop("ref"), "truth", "as the file declares it by ref_q "
                                    "columns")  # fmt: skip
    found |= {key: found[key]._replace(unit=unit) for key, unit in _UNITS.items() if key in found}
    unused = sorted(held.keys() - used - {""})
    return Plan(layout, Stamps(place[TIME], 9), found, attitudes, unused)


def _groups(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Columns of each signal."""
    groups: dict[str, tuple[str, ...]] = {}
    held = set(names)
    if held >= set(_POSITION):
        groups["position"] = _POSITION
    if held >= set(_REF):
        groups["ref"] = _REF
    for name in names:
        stem = name.removesuffix("_x")
        axes = tuple(f"{stem}_{axis}" for axis in "xyz")
        if name != stem and held >= set(axes) and stem not in (*_RESERVED, "time", "ref", ""):
            groups[_NAMES.get(stem, stem)] = axes
    return groups


def further(names: Iterable[str]) -> bool:
    """Whether there are feature points or other vectors, which can do without a gyroscope."""
    return not {"accel", "mag", "torque", *_NAMES.values(), *_RESERVED} >= set(names)


def mapped(path: Path, csv: Csv, by: str = "as input.csv says", name: str = "ref") -> Plan:
    """Plan for a CSV whose columns are told.

    Raises
    ------
    ReadError
        There are no rows.
    ConfigError
        A column is told that the file does not have.
    """
    told = _told(csv)
    layout = csv_columns.layout(
        path, csv, [c for cs, _ in told.values() for c in cs if isinstance(c, str)]
    )
    places = csv_columns.places(
        path, csv, layout, {key: columns for key, (columns, _) in told.items()}
    )
    groups = {
        key.removeprefix("vectors."): Group(places[key], ", ".join(map(str, columns)), unit)
        for key, (columns, unit) in told.items()
    }
    time = groups.pop("time")
    stamps = Stamps(time.places[0], DIGITS[time.unit])
    attitude = groups.pop("reference", None)
    kind = csv.reference.kind if csv.reference else "truth"
    used = {place for several in places.values() for place in several}
    unused = [name for i, name in enumerate(layout.names) if i not in used and name]
    return Plan(
        layout=layout,
        stamps=stamps,
        signals=groups,
        references={name: Attitude(attitude, kind, by)} if attitude else {},
        unused=unused,
        clock=layout.names[stamps.place] or f"column {stamps.place + 1}",
    )


def units(plan: Plan) -> dict[str, str]:
    """Return the unit that each signal's cells, and the stamps, are taken in."""
    time = next(unit for unit, digits in DIGITS.items() if digits == plan.stamps.digits)
    return {"time": time} | {key: group.unit for key, group in plan.signals.items() if group.unit}


def columns(plan: Plan) -> list[str | int]:
    """Return the columns of the reference by name, or by number where that is not enough."""
    names = plan.layout.names
    places = [place for attitude in plan.references.values() for place in attitude.group.places]
    clear = {name for name, count in Counter(names).items() if name and count == 1}
    return [names[place] if names[place] in clear else place + 1 for place in places]


def listed(units: Mapping[str, str]) -> str:
    """Return units as text, such as ``time ms, gyro deg/s``."""
    return ", ".join(f"{key} {unit}" for key, unit in units.items())


def amended(path: Path, plan: Plan, csv: Csv) -> Plan:
    """Take the columns of a plan in the units, and the reference of the columns, told alone.

    Raises
    ------
    ConfigError
        The file has no such columns.
    """
    units = csv.units()
    stamps = plan.stamps._replace(digits=DIGITS.get(units.pop("time", ""), plan.stamps.digits))
    for key in units:
        if key not in plan.signals:
            held = ", ".join(filter(None, plan.layout.names))[:300]
            raise ConfigError(
                f"{path}: no columns of {key} for input.csv.{key}.unit. The file has: {held}."
            )
    told = {key: plan.signals[key]._replace(unit=unit) for key, unit in units.items()}
    plan = replace(plan, stamps=stamps, signals={**plan.signals, **told})
    if csv.reference is None:
        return plan
    columns, key = csv.reference.columns, "input.csv.reference"
    group = Group(
        tuple(csv_columns.place(path, plan.layout, column, key) for column in columns),
        ", ".join(map(str, columns)),
    )
    attitude = Attitude(group, csv.reference.kind, "as input.csv says")
    used = {plan.layout.names[place] for place in group.places}
    unused = [name for name in plan.unused if name not in used]
    return replace(plan, references={"ref": attitude}, unused=unused)


def fits(path: Path, csv: Csv) -> bool:
    """Whether a file has the columns that are told; of a time told by number, a number there."""
    if csv.time is None or csv.time.column is None:
        return False
    try:
        plan = mapped(path, csv)
        head = csv_head.read(path)
    except (OSError, ReadError, ConfigError):
        return False
    if isinstance(csv.time.column, str):
        return True
    row = csv_head.lines(head[plan.layout.start :], 0, csv.comment.encode()).first
    cells = csv_head.cells(row, plan.layout.separator)
    try:
        float(cells[csv.time.column - 1].replace(plan.layout.decimal, "."))
    except (IndexError, ValueError):
        return False
    return True


def _told(csv: Csv) -> dict[str, tuple[tuple[str | int, ...], str]]:
    """Columns and unit of each signal by its key."""
    told: dict[str, tuple[tuple[str | int, ...], str]] = {}
    if csv.time is not None and csv.time.column is not None:
        told["time"] = (csv.time.column,), csv.time.unit
    keys = ("gyro", "accel", "mag", "reference", "velocity", "position", "torque")
    for key in keys:
        if (section := getattr(csv, key)) is not None:
            told[key] = section.columns, getattr(section, "unit", "")
    return told | {f"vectors.{key}": (v.columns, "") for key, v in csv.vectors.items()}
