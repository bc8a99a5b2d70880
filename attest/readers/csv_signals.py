"""Signals and references of a CSV, each on its own clock where its cells are filled."""

from bisect import bisect_left
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import csv_cells
from attest.readers.csv_cells import Array, Mask, Rows, Times
from attest.readers.csv_plan import Attitude, Group, Plan
from attest.readers.values import any_of
from attest.recording import Note, Reference, Signal

_UNIT_TOLERANCE = 1e-3
_STUCK = "whose time does not advance, dropped"
_LARGEST = 1e100
"""Of any value in any unit: sums of squares of more may overflow."""


class Taken(NamedTuple):
    """What a plan yields."""

    signals: dict[str, Signal]
    references: dict[str, Reference]
    notes: list[Note]
    rows: int


def take(path: Path, plan: Plan) -> Taken:
    """Read the columns of a plan.

    Raises
    ------
    ReadError
        The file cannot be read.
    """
    attitudes = plan.references.items()
    groups = [*plan.signals.values(), *(attitude.group for _, attitude in attitudes)]
    wanted = [place for group in groups for place in group.places]
    try:
        rows = csv_cells.read_rows(path, plan.layout, plan.stamps, wanted)
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror or error}. Check the file.") from error
    notes: list[Note] = []
    found = {name: _signal(rows, name, group, notes) for name, group in plan.signals.items()}
    given = {name: _reference(rows, name, attitude, notes) for name, attitude in attitudes}
    unused = Note(f"columns not used: {', '.join(plan.unused)[:200]}", len(plan.unused))
    return Taken(
        {name: signal for name, signal in found.items() if signal is not None},
        {name: reference for name, reference in given.items() if reference is not None},
        [*rows.notes(), *([unused] if plan.unused else []), *notes],
        len(rows.t),
    )


def _signal(rows: Rows, name: str, group: Group, notes: list[Note]) -> Signal | None:
    t, y = _samples(rows, name, group, notes)
    if name == "position":
        on_earth = (np.abs(y[:, 0]) <= 90.0) & (np.abs(y[:, 1]) <= 180.0)
        t, y = _keep(on_earth, t, y, "position rows off the globe, dropped", notes)
    if group.factor != 1.0:
        y *= group.factor
    usable = ~any_of(np.abs(y) > _LARGEST)
    t, y = _keep(usable, t, y, f"{name} rows beyond {_LARGEST:g}, dropped", notes)
    if not len(t):
        notes.append(Note(f"signal without a usable row: {name}"))
        return None
    return Signal(t, y, group.source)


def _samples(rows: Rows, name: str, group: Group, notes: list[Note]) -> tuple[Times, Array]:
    """Take one group of columns where all of it is there and time advances."""
    y, filled = rows.take(group.places)
    if rows.timed.all() and _all_finite(y):  # and no cell is empty
        return _keep(_advancing(rows.t), rows.t, y, f"{name} rows {_STUCK}", notes)
    whole = (filled == len(group.places)) & rows.timed
    finite = np.isfinite(y).all(axis=1)
    if torn := int(np.sum((filled > 0) & rows.timed & ~whole)):
        notes.append(Note(f"{name} rows with a cell missing, dropped", torn))
    if endless := int(np.sum(whole & ~finite)):
        notes.append(Note(f"{name} rows with a value that is not finite, dropped", endless))
    t, y = rows.t[whole & finite], y[whole & finite]
    return _keep(_advancing(t), t, y, f"{name} rows {_STUCK}", notes)


@np.errstate(over="ignore", invalid="ignore")
def _all_finite(y: Array) -> bool:
    """Whether the sum is finite: quicker than a look at each, and so for most files."""
    return bool(np.isfinite(y.sum()))


def _keep(good: Mask, t: Times, y: Array, otherwise: str, notes: list[Note]) -> tuple[Times, Array]:
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


def _reference(rows: Rows, name: str, attitude: Attitude, notes: list[Note]) -> Reference | None:
    t, q = _samples(rows, f"{name}_q", attitude.group, notes)
    size = np.max(np.abs(q), axis=-1)
    usable = (size > 1e-9) & (size < 1e9)  # whose squares neither vanish nor overflow
    t, q = _keep(usable, t, q, f"{name}_q rows of no usable length, dropped", notes)
    if not len(t):
        notes.append(Note(f"reference without a usable row: {name}"))
        return None
    length = np.linalg.norm(q, axis=-1)
    if off := int(np.sum(np.abs(length - 1.0) > _UNIT_TOLERANCE)):
        notes.append(Note(f"{name}_q rows not of unit length, normalised", off))
    notes.append(Note(f"reference taken as {attitude.kind}, {attitude.by}"))
    q = quaternion.continuous(quaternion.normalize(q))
    return Reference(name, attitude.kind, t, q)
