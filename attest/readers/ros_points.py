"""Feature points: clouds, arrays of poses, and the markers of motion capture."""

from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from attest.readers.ros_decode import Array, Group, Ints, Table
from attest.readers.ros_offers import Offer, text_of
from attest.recording import Note

MOST_POINTS = 200
"""A cloud of more is a scan, and no set of feature points."""
MILLIMETRES = 50.0
"""From which a motion capture's distances cannot be metres."""

Part = tuple[str, Ints, Array]
"""A point's name, the messages that hold it, and where it is in each."""

_FLOATS = {7: "f4", 8: "f8"}
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", **_FLOATS}
"""Types of a cloud's fields."""
_NAMES = ("marker_name", "name", "id", "marker_index", "index")
USE_INDEX = 1
"""Of mocap4r2_msgs' id_type: a marker's name is its index, and the other one is empty."""
_PLACES = ("translation", "position", "pose.position", "point")


def points(table: Table, notes: list[Note]) -> tuple[list[Offer], int]:
    """Return an offer for each feature point of a topic, and how often one was hidden.

    There is none where the points have no names and their number changes.
    """
    take = _taker(table.type)
    parts: dict[str, list[tuple[Ints, Array]]] = {}
    hidden = nameless = 0
    for group in table.groups:
        for name, rows, place in take(group):
            if not name:
                nameless += len(rows)
                continue
            seen = np.isfinite(place).all(axis=1)
            hidden += int((~seen).sum())
            parts.setdefault(name, []).append((rows[seen], place[seen]))
            if len(parts) > MOST_POINTS:
                notes.append(Note(f"{table.topic} has over {MOST_POINTS} points: not feature "
                                  "points, not used"))  # fmt: skip
                return [], 0
    if nameless:
        notes.append(Note(f"{table.topic} point without a name: not used", nameless))
    if not _named(table) and len({_count(group) for group in table.groups}) > 1:
        text = f"{table.topic} has now more, now fewer points and no names for them: not used"
        notes.append(Note(text))
        return [], 0
    return [_offer(table, name, parts[name], notes) for name in sorted(parts, key=_rank)], hidden


def _offer(table: Table, name: str, parts: list[tuple[Ints, Array]], notes: list[Note]) -> Offer:
    rows = np.concatenate([rows for rows, _ in parts])
    y = np.concatenate([place for _, place in parts])
    order = np.argsort(rows, kind="stable")
    rows, y = rows[order], y[order]
    once = ~np.isin(rows, rows[1:][np.diff(rows) == 0])
    if not once.all():
        text = f"{table.topic} has several points named {name!r} in one message: dropped"
        notes.append(Note(text, int((~once).sum())))
        rows, y = rows[once], y[once]
    if "vicon" in table.type and len(y) and np.median(np.linalg.norm(y, axis=1)) > MILLIMETRES:
        notes.append(Note(f"{table.topic} in millimetres, by its size", doubt=True))
        y = y * 1e-3
    stamp = np.zeros(len(table.record), np.int64)
    for group in table.groups:
        path = "header.stamp" if group.has("header.stamp.sec") else "markers.0.header.stamp"
        if group.has(f"{path}.sec"):
            stamp[group.rows] = group.stamp(path)
    frame = text_of(table, "header.frame_id")
    return Offer("point", table.topic, table.type, table.record[rows], stamp[rows], y, frame,
                 name=name)  # fmt: skip


def _taker(type_: str) -> Callable[[Group], Iterator[Part]]:
    if type_ == "sensor_msgs/msg/PointCloud2":
        return _cloud
    if type_ == "geometry_msgs/msg/PoseArray":
        return _poses
    return _lists if PurePosixPath(type_).name == "MarkersList" else _markers


def _named(table: Table) -> bool:
    if table.type == "sensor_msgs/msg/PointCloud2":
        return any("id" in _fields(g) or "label" in _fields(g) for g in table.groups)
    return PurePosixPath(table.type).name != "PoseArray"


def _count(group: Group) -> int:
    """Return how many points the messages of a group have."""
    if group.has("width"):
        return int(group.numbers("width")[0]) * int(group.numbers("height")[0])
    return group.length("poses")


def _rank(name: str) -> tuple[bool, int, str]:
    """Order names as people count: 2 before 10."""
    number = int(name) if name.removeprefix("-").isdecimal() and len(name) < 20 else None
    return number is None, number or 0, name


def _poses(group: Group) -> Iterator[Part]:
    for i in range(group.length("poses")):
        yield str(i), group.rows, group.vector(f"poses.{i}.position")


def _markers(group: Group) -> Iterator[Part]:
    """Take markers by whatever their message calls name and place."""
    for i in range(group.length("markers")):
        path = f"markers.{i}"
        place = next((p for p in _PLACES if group.has(f"{path}.{p}.x")), None)
        if place is None:
            return
        xyz = group.vector(f"{path}.{place}")
        xyz[_unseen(group, path)] = np.nan
        for text, rows in _names(group, path):
            yield text, group.rows[rows], xyz[rows]


def _lists(group: Group) -> Iterator[Part]:
    """Take markers of vicon_receiver: lists of x, y, z, and of the numbers they go by."""
    if not all(group.has(name) for name in ("x", "y", "z", "indices")):
        return
    x, y, z, indices = (_rows(group, name) for name in ("x", "y", "z", "indices"))
    if not x.shape == y.shape == z.shape == indices.shape:
        return
    xyz = np.stack([x, y, z], axis=2)
    for number in np.unique(indices)[: MOST_POINTS + 1]:
        at, place = np.nonzero(indices == number)
        yield f"{number:g}", group.rows[at], xyz[at, place]


def _rows(group: Group, path: str) -> Array:
    return group.numbers(path).reshape(len(group.rows), -1).astype(np.float64)


def _names(group: Group, path: str) -> Iterator[tuple[str, Ints]]:
    """Yield the different names of a marker, behind its subject's, and which rows have each."""
    subjects = [("", np.arange(len(group.rows)))]
    if group.has(f"{path}.subject_name"):
        subjects = _texts(group, f"{path}.subject_name")
    for name, rows in _own_names(group, path):
        for subject, others in subjects:
            both = np.intersect1d(rows, others, assume_unique=True)
            if len(both):
                yield f"{subject}/{name}" if subject and name else name, both


def _own_names(group: Group, path: str) -> Iterator[tuple[str, Ints]]:
    held = [name for name in _NAMES if group.has(f"{path}.{name}")]
    if "marker_index" in held and group.has(f"{path}.id_type"):
        by_index = group.numbers(f"{path}.id_type") == USE_INDEX
        for key, mine in (("marker_index", by_index), ("marker_name", ~by_index)):
            if key in held:
                yield from (
                    (name, rows[mine[rows]]) for name, rows in _texts(group, f"{path}.{key}")
                )
    elif held:
        yield from _texts(group, f"{path}.{held[0]}")


def _unseen(group: Group, path: str) -> NDArray[np.bool_]:
    """Mark markers that are occluded, or that a display is told to take away."""
    unseen = np.zeros(len(group.rows), np.bool_)
    if group.has(f"{path}.occluded"):
        unseen |= group.numbers(f"{path}.occluded") != 0
    if group.has(f"{path}.action"):
        unseen |= group.numbers(f"{path}.action") != 0
    return unseen


def _texts(group: Group, path: str) -> list[tuple[str, Ints]]:
    """Return the different values of a text or a number, and which rows have each."""
    if group.place(path).format.startswith("S"):
        return group.texts(path)
    different, which = np.unique(group.numbers(path), return_inverse=True)
    return [(str(value), np.flatnonzero(which == i)) for i, value in enumerate(different)]


def _fields(group: Group) -> dict[str, tuple[int, int]]:
    """Return offset and type of each field of a cloud, as its first message has them."""
    fields = {}
    for i in range(group.length("fields")):
        name = group.texts(f"fields.{i}.name")[0][0]
        offset = int(group.numbers(f"fields.{i}.offset")[0])
        fields[name] = (offset, int(group.numbers(f"fields.{i}.datatype")[0]))
    return fields


def _cloud(group: Group) -> Iterator[Part]:
    """Take a cloud's points apart: by ``id`` or ``label``, else by their order."""
    fields, count, step = _fields(group), _count(group), int(group.numbers("point_step")[0])
    same = _alike(group)
    raw = group.numbers("data").reshape(len(group.rows), -1)[same]
    if count > MOST_POINTS or not count or count * step > raw.shape[1]:
        return
    order = ">" if group.numbers("is_bigendian")[0] else "<"
    each = np.ascontiguousarray(raw[:, : count * step]).reshape(len(raw), count, step)
    columns = [_column(each, fields.get(name), _FLOATS, order) for name in "xyz"]
    if any(column is None for column in columns):
        return
    xyz = np.stack([column for column in columns if column is not None], axis=2)
    names = _column(each, fields.get("id", fields.get("label")), _NUMBERS, order)
    rows = group.rows[same]
    if names is None:
        yield from ((str(i), rows, xyz[:, i]) for i in range(count))
        return
    for name in np.unique(names[np.isfinite(names)])[: MOST_POINTS + 1]:
        at, place = np.nonzero(names == name)
        yield f"{name:g}", rows[at], xyz[at, place]


def _alike(group: Group) -> NDArray[np.bool_]:
    """Mark the messages whose points are laid out as those of the first."""
    same = np.ones(len(group.rows), np.bool_)
    told = ["width", "height", "point_step", "is_bigendian"]
    for i in range(group.length("fields")):
        told += [f"fields.{i}.{what}" for what in ("offset", "datatype")]
    for path in told:
        values = group.numbers(path)
        same &= values == values[0]
    return same


def _column(
    each: NDArray[np.uint8], field: tuple[int, int] | None, known: dict[int, str], order: str
) -> Array | None:
    """Return one field of every point, shape (messages, points)."""
    if field is None or field[1] not in known:
        return None
    form = np.dtype(order + known[field[1]])
    end = field[0] + form.itemsize
    if end > each.shape[2]:
        return None
    raw = np.ascontiguousarray(each[:, :, field[0] : end])
    return raw.view(form)[:, :, 0].astype(np.float64)
