"""Messages of a topic decoded by array: those of one form at once, as columns of numbers."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from attest.readers import ros_layout
from attest.readers.ros_layout import Blocks, Layout, LayoutError, Place
from attest.readers.ros_topics import Topic
from attest.readers.ros_types import PX4, Definitions

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_FORMS = 64
"""Of messages of one size; where there are more, each message is walked on its own."""
BLOCK = 1 << 20
"""Bytes gathered at once."""
_SECOND = 1_000_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Messages of one form: each a row of bytes, with their fields at the same places."""

    rows: Ints
    """Which messages of the table they are."""
    bytes: NDArray[np.uint8]
    """Shape (n, size)."""
    layout: Layout

    def has(self, path: str) -> bool:
        """Whether the messages have a field of numbers or a string."""
        return self.layout.find(path) is not None

    def place(self, path: str) -> Place:
        """Return where a field lies.

        Raises
        ------
        KeyError
            The messages have none.
        """
        found = self.layout.find(path)
        if found is None:
            raise KeyError(path)
        return found

    def numbers(self, path: str) -> NDArray[np.generic]:
        """Return a field, shape (n,), or (n, k) for an array of numbers."""
        place = self.place(path)
        form = np.dtype(place.format)
        end = place.offset + place.count * form.itemsize
        raw = np.ascontiguousarray(self.bytes[:, place.offset : end])
        values = raw.view(form) if place.count else np.empty((len(raw), 0), form)
        return values[:, 0] if place.count == 1 else values

    def vector(self, path: str, names: str = "xyz") -> Array:
        """Return the fields of a vector or a quaternion as columns."""
        places = [self.place(f"{path}.{name}") for name in names]
        start = min(place.offset for place in places)
        columns = [(place.offset - start) // 8 for place in places]
        together = {place.format[1:] for place in places} == {"f8"} and sorted(columns) == list(
            range(len(names))
        )
        if not together:
            each = [self.numbers(f"{path}.{name}").astype(np.float64) for name in names]
            return np.stack(each, axis=1)
        raw = np.ascontiguousarray(self.bytes[:, start : start + 8 * len(names)])
        values = raw.view(places[0].format).astype(np.float64, copy=False)
        return values if columns == sorted(columns) else values[:, columns]

    def first(self, path: str) -> NDArray[np.generic]:
        """Return the first number of an array, shape (n,)."""
        place = self.place(path)
        form = np.dtype(place.format)
        end = place.offset + form.itemsize
        return np.ascontiguousarray(self.bytes[:, place.offset : end]).view(form)[:, 0]

    def texts(self, path: str) -> list[tuple[str, Ints]]:
        """Return the different texts of a string, and which rows have each."""
        place = self.place(path)
        raw = np.ascontiguousarray(self.bytes[:, place.offset : place.offset + place.count])
        if not place.count or (raw == raw[0]).all():
            return [(_text(raw[0]), np.arange(len(raw)))]
        different, which = np.unique(raw, axis=0, return_inverse=True)
        return [(_text(one), rows) for one, rows in zip(different, alike(which), strict=True)]

    def length(self, path: str) -> int:
        """Return how many items a sequence has in these messages."""
        return self.layout.lengths.get(path, 0)

    def stamp(self, path: str = "header.stamp") -> Ints:
        """Return a stamp in nanoseconds."""
        seconds = self.numbers(f"{path}.sec").astype(np.int64)
        return seconds * _SECOND + self.numbers(f"{path}.nanosec").astype(np.int64)


def alike(which: Ints) -> list[Ints]:
    """Return the rows of each number from 0 on, in order; each number has one."""
    order = np.argsort(which.ravel(), kind="stable")
    return np.split(order, np.cumsum(np.bincount(which.ravel()))[:-1])


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The decoded messages of one topic, in the order in which they were recorded."""

    topic: str
    type: str
    record: Ints
    """When each was recorded, ns since 1970, shape (n,)."""
    groups: tuple[Group, ...]
    broken: int = 0
    """Messages that are not as their definition says."""
    assumed: bool = False
    """Whether the definition is not the file's."""

    def __len__(self) -> int:
        return sum(len(group.rows) for group in self.groups)


def decode(topic: Topic) -> Table | None:
    """Decode the messages of a topic; None where nothing tells what is in them."""
    types = ros_layout.parse(topic.type, topic.definition, topic.form)
    if types is None:
        return None
    record = np.array(topic.record, np.int64)
    order = np.arange(len(record))
    if (record[1:] < record[:-1]).any():
        order = np.argsort(record, kind="stable")
    ends = np.array(topic.ends, np.int64)
    sizes = np.diff(ends, prepend=0)
    starts, sizes = (ends - sizes)[order], sizes[order]
    data = np.frombuffer(topic.data, np.uint8)
    form = _Form(types, topic.type, topic.encoding, topic.type in PX4 and not topic.definition)
    groups = [
        group
        for size in (sizes[:1] if (sizes == sizes[0]).all() else np.unique(sizes))
        for group in _groups(data, starts, np.flatnonzero(sizes == size), int(size), form)
    ]
    broken = len(record) - sum(len(group.rows) for group in groups)
    assumed = not topic.definition
    return Table(topic.name, topic.type, record[order], tuple(groups), broken, assumed)


@dataclass(frozen=True, slots=True)
class _Form:
    """How messages are walked."""

    types: Definitions
    type: str
    encoding: str
    prefix: bool
    blocks: Blocks = field(default_factory=dict)

    def walk(self, message: NDArray[np.uint8]) -> Layout | None:
        """Find every field; None where the message is not as defined."""
        try:
            return ros_layout.walk(
                message.tobytes(), self.types, self.type, self.encoding, self.prefix, self.blocks
            )
        except LayoutError:
            return None


def _groups(
    data: NDArray[np.uint8], starts: Ints, rows: Ints, size: int, form: _Form
) -> Iterator[Group]:
    """Sort messages of one size by their form: one walk tells that of many."""
    taken = _bytes(data, starts[rows], size)
    left = np.arange(len(rows))
    for _ in range(MOST_FORMS):
        if not len(left):
            return
        layout = form.walk(taken[left[0]])
        if layout is None:
            left = left[1:]
            continue
        same = _same(taken, left, layout)
        chosen = left[same]
        yield Group(rows[chosen], taken if len(chosen) == len(taken) else taken[chosen], layout)
        left = left[~same]
    yield from _one_by_one(taken, rows, left, form)


def _one_by_one(taken: NDArray[np.uint8], rows: Ints, left: Ints, form: _Form) -> Iterator[Group]:
    """Walk each message where the forms are many."""
    layouts: dict[tuple[tuple[int, int], ...], tuple[Layout, list[int]]] = {}
    for i in left.tolist():
        if (layout := form.walk(taken[i])) is not None:
            layouts.setdefault((*layout.fixed, (0, ord(layout.order))), (layout, []))[1].append(i)
    for layout, alike in layouts.values():
        yield Group(rows[alike], taken[alike], layout)


def _same(taken: NDArray[np.uint8], left: Ints, layout: Layout) -> NDArray[np.bool_]:
    """Mark the messages whose strings and sequences are as long as those of the layout."""
    if len(left) == 1:
        return np.ones(1, np.bool_)
    rows = taken if len(left) == len(taken) else taken[left]
    same = np.ones(len(rows), np.bool_)
    if layout.aligned:
        same &= (rows[:, :2] == rows[0, :2]).all(axis=1)
    for offset, value in layout.fixed:
        length = np.ascontiguousarray(rows[:, offset : offset + 4]).view(layout.order + "u4")
        same &= length[:, 0] == value
    return same


def _bytes(data: NDArray[np.uint8], starts: Ints, size: int) -> NDArray[np.uint8]:
    """Return messages of one size as rows, without a copy where they lie in a row already."""
    count = len(starts)
    first = int(starts[0])
    if not size or np.array_equal(starts, first + size * np.arange(count)):
        return data[first : first + size * count].reshape(count, size)
    rows = np.empty((count, size), np.uint8)
    step = max(1, BLOCK // size)
    for i in range(0, count, step):
        rows[i : i + step] = data[starts[i : i + step, np.newaxis] + np.arange(size)]
    return rows


def _text(raw: NDArray[np.uint8]) -> str:
    return raw.tobytes().decode("utf-8", "replace")
