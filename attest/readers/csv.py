"""Canonical CSV: SI columns by name, each signal on its own clock where its cells are filled.

Header ``time_s, gyro_x, gyro_y, gyro_z`` (rad/s), and optionally ``accel_x`` … (m/s²), ``mag_x`` …
(µT), ``ref_qw`` … (body to world), ``lat_deg, lon_deg, alt_m``, ``vel_x`` … (m/s, world),
``torque_x`` … (N·m), ``point1_x`` … (feature points, m; these need no gyroscope) and
``<name>_x, <name>_y, <name>_z`` for any other vector in the body. Comma,
semicolon or tab between cells; lines that start with ``#`` are comments.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.readers import csv_cells
from attest.readers.csv_cells import TIME, Array, Rows, Times
from attest.readers.options import ReadOptions
from attest.recording import Clock, Note, Recording, Reference, Signal, World

_REF = ("ref_qw", "ref_qx", "ref_qy", "ref_qz")
_POSITION = ("lat_deg", "lon_deg", "alt_m")
_NAMES = {"vel": "velocity"}
"""Signals that go by another name in a Recording."""
_RESERVED = ("position", "velocity")
"""Signals with a meaning that ``<name>_x`` columns would not have."""
_FACTORS = {"mag": 1e-6}
"""To SI."""

_UNIX = 10**18  # ns, the year 2001: later stamps are unix time
_UNIT_TOLERANCE = 1e-3


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 - the content tells, not the name
    """Whether the first line that is no comment names a ``time_s`` column."""
    line, _ = csv_cells.header(head)
    return TIME in csv_cells.fields(line)[0]


def read(path: Path, options: ReadOptions) -> Recording:
    """Read the signals and the reference of one file.

    Raises
    ------
    ReadError
        The file is no canonical CSV, or holds no gyroscope.
    """
    if options.csv is not None:
        raise ConfigError(f"{path}: input.csv is not known yet. Name the columns as in the README.")
    try:
        layout = csv_cells.layout(path)
        groups, unused = _groups(path, layout.names)
        wanted = [name for group in groups.values() for name in group]
        rows = csv_cells.read_rows(path, layout, wanted)
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror or error}. Check the file.") from error
    notes = [*rows.notes]
    if unused:
        notes.append(Note(f"columns not used: {', '.join(unused)[:200]}", len(unused)))
    signals = _signals(rows, groups, notes)
    if "gyro" not in signals and not _further(signals):
        raise ReadError(f"{path}: no row has a time and gyro_x, gyro_y, gyro_z. Fill the cells.")
    world = _world(options.world, signals, notes)
    start = min(int(signal.t[0]) for signal in signals.values())
    return Recording(
        path=path,
        format="csv",
        signals=signals,
        references=_references(rows, groups, notes),
        clock=Clock("CSV time_s", 0 if start > _UNIX else None),
        world=world,
        body="frd" if world == "ned" else "flu",
        notes=tuple(notes),
        details={"rows": len(rows.t), "columns": list(layout.names[:1000])},
    )


def _groups(path: Path, names: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """Columns of each signal, and the columns of none."""
    groups: dict[str, tuple[str, ...]] = {"time": (TIME,)}
    held = Counter(names)
    if held.keys() >= set(_POSITION):
        groups["position"] = _POSITION
    if held.keys() >= set(_REF):
        groups["ref"] = _REF
    for name in names:
        stem = name.removesuffix("_x")
        axes = tuple(f"{stem}_{axis}" for axis in "xyz")
        if (
            name != stem
            and held.keys() >= set(axes)
            and stem not in (*_RESERVED, "time", "ref", "")
        ):
            groups[_NAMES.get(stem, stem)] = axes
    if "gyro" not in groups and not _further(groups):
        raise ReadError(
            f"{path}: no gyro_x, gyro_y, gyro_z column. An observer needs the gyroscope, in rad/s."
        )
    used = {name for group in groups.values() for name in group}
    if twice := sorted(name for name in used if held[name] > 1):
        raise ReadError(f"{path}: two columns are named {twice[0]}. Rename one.")
    return groups, sorted(held.keys() - used - {""})


def _further(names: Iterable[str]) -> bool:
    """Whether there are feature points or other vectors, which can do without a gyroscope."""
    return not {"time", "ref", "accel", "mag", "torque", *_NAMES.values(), *_RESERVED} >= set(names)


def _signals(
    rows: Rows, groups: dict[str, tuple[str, ...]], notes: list[Note]
) -> dict[str, Signal]:
    signals = {}
    for name, columns in groups.items():
        if name in ("time", "ref"):
            continue
        t, y = _samples(rows, name, columns, notes)
        if name == "position":
            on_earth = (np.abs(y[:, 0]) <= 90.0) & (np.abs(y[:, 1]) <= 180.0)
            t, y = _keep(on_earth, t, y, "position rows off the globe, dropped", notes)
        if len(t):
            signals[name] = Signal(t, y * _FACTORS.get(name, 1.0), ", ".join(columns))
        else:
            notes.append(Note(f"signal without a usable row: {name}"))
    return signals


def _samples(
    rows: Rows, name: str, columns: Iterable[str], notes: list[Note]
) -> tuple[Times, Array]:
    """Take one group of columns where all of it is there and time advances."""
    values, filled = zip(*(rows.cells[column] for column in columns), strict=True)
    whole = np.logical_and.reduce(filled) & rows.timed
    finite = np.logical_and.reduce([np.isfinite(value) for value in values])
    if torn := int(np.sum(np.logical_or.reduce(filled) & rows.timed & ~whole)):
        notes.append(Note(f"{name} rows with a cell missing, dropped", torn))
    if endless := int(np.sum(whole & ~finite)):
        notes.append(Note(f"{name} rows with a value that is not finite, dropped", endless))
    taken = whole & finite
    t, y = rows.t[taken], np.stack([value[taken] for value in values], axis=-1)
    return _keep(_advancing(t), t, y, f"{name} rows whose time does not advance, dropped", notes)


def _keep(
    good: NDArray[np.bool_], t: Times, y: Array, otherwise: str, notes: list[Note]
) -> tuple[Times, Array]:
    """Drop what is not good, and note it."""
    if not (dropped := int(np.sum(~good))):
        return t, y
    notes.append(Note(otherwise, dropped, doubt=dropped > max(1, len(t) // 100)))
    return t[good], y[good]


def _advancing(t: Times) -> NDArray[np.bool_]:
    """Mark the most stamps that increase strictly: one wild stamp costs itself alone."""
    if np.all(t[1:] > t[:-1]):
        return np.ones(len(t), np.bool_)
    ends: list[int] = []  # least last stamp of an increasing run of each length
    order: list[int] = []  # and its place
    before = np.full(len(t), -1)
    for i, stamp in enumerate(t.tolist()):
        length = bisect_left(ends, stamp)
        if length < len(ends) and ends[length] == stamp:
            continue  # of twins the first
        ends[length : length + 1], order[length : length + 1] = [stamp], [i]
        before[i] = order[length - 1] if length else -1
    good = np.zeros(len(t), np.bool_)
    i = order[-1]
    while i >= 0:
        good[i] = True
        i = int(before[i])
    return good


def _references(
    rows: Rows, groups: dict[str, tuple[str, ...]], notes: list[Note]
) -> dict[str, Reference]:
    if "ref" not in groups:
        return {}
    t, q = _samples(rows, "ref_q", groups["ref"], notes)
    size = np.max(np.abs(q), axis=-1)
    usable = (size > 1e-9) & (size < 1e9)  # whose squares neither vanish nor overflow
    t, q = _keep(usable, t, q, "ref_q rows of no usable length, dropped", notes)
    if not len(t):
        notes.append(Note("reference without a usable row: ref"))
        return {}
    length = np.linalg.norm(q, axis=-1)
    if off := int(np.sum(np.abs(length - 1.0) > _UNIT_TOLERANCE)):
        notes.append(Note("ref_q rows not of unit length, normalised", off))
    notes.append(Note("reference taken as truth, as the file declares it by ref_q columns"))
    return {"ref": Reference("ref", "truth", t, quaternion.continuous(quaternion.normalize(q)))}


def _world(given: World | None, signals: dict[str, Signal], notes: list[Note]) -> World:
    """Axes as declared, else north-east-down: noted, and doubted if gravity says otherwise."""
    if given is not None:
        return given
    notes.append(Note("world axes not declared: north-east-down and body forward-right-down taken"))
    if "accel" in signals and np.median(signals["accel"].y[:, 2]) > 5.0:
        notes.append(Note("accel_z is up, as in a body with z up: try --world enu", doubt=True))
    return "ned"
