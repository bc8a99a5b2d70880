"""The frames of a log: found through damage, checked, decoded for the wanted messages.

A sound log is a chain: each frame ends where the next one's stamp begins. So a mark that leads to
another mark is tried first; what that leaves uncovered is damage or foreign messages. A gap that
headers bridge from end to end holds frames that are damaged inside, or of an unknown message;
in any other gap every mark is tried.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.readers import mavlink
from attest.readers.mavlink import Bytes, Frames, Ints, Mask

BLOCK = 3 << 20
"""Bytes read at a time."""
MARGIN = 4 * (mavlink.LONGEST + 8)
"""Frames that end so close to the end of a block are left to the next one."""
MARKS = 1 << 19
"""The most places where a frame could begin that are looked at together: bounds the memory."""
BRIDGE = 64
"""The most frames without a right checksum between two with one."""


@dataclass(frozen=True, slots=True)
class Damage:
    """What of a log is not sound."""

    bad_frames: int = 0
    """Frames with a wrong checksum, and stretches in which no frame can be told."""
    unknown_frames: int = 0
    """Frames of messages that the dialect does not define: they cannot be checked."""
    bytes_skipped: int = 0
    """Bytes in neither a sound frame nor an unknown one."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Messages of one type, in file order."""

    at: Ints
    """Place in the file, bytes."""
    arrival: Ints
    """Receiver's stamp, microseconds as written; 0 where there is none or it cannot be trusted."""
    sender: NDArray[np.uint16]
    """System and component: ``system << 8 | component``."""
    rows: NDArray[np.void]
    """Fields by name."""

    def __len__(self) -> int:
        return len(self.at)

    def __getitem__(self, chosen: Ints | Mask | slice) -> "Table":
        return Table(self.at[chosen], self.arrival[chosen], self.sender[chosen], self.rows[chosen])


@dataclass(frozen=True, slots=True)
class Scan:
    """A whole log."""

    tables: dict[str, Table]
    """The wanted messages that are there, by name."""
    counts: Counter[tuple[int, str]]
    """Sound frames by sender and message name."""
    stamped: bool
    """Whether each frame follows a receiver's stamp."""
    damage: Damage


def scan(path: Path, wanted: Collection[str]) -> Scan:
    """Read the wanted messages of a log, in blocks."""
    names = mavlink.dialect().names
    numbers = {number: name for number, name in names.items() if name in wanted}
    parts: dict[str, list[Table]] = {name: [] for name in numbers.values()}
    counts: Counter[tuple[int, str]] = Counter()
    bad = unknown = used = done = 0
    with path.open("rb") as file:
        stamp = stamp_size(file)
        for start, buffer, last in _buffers(file):
            block = _block(start, buffer, last, stamp, numbers)
            kept = block.from_place(done)
            frames, gaps = block.frames[kept], slice(kept.start, kept.stop + block.last)
            bad, unknown = (
                bad + int(block.bad[gaps].sum()),
                unknown + int(block.unknown[gaps].sum()),
            )
            used += int((frames.end - frames.at + stamp).sum() + block.unknown_bytes[gaps].sum())
            for who, number, count in block.counts(kept):
                counts[who, names[number]] += count
            if len(frames):
                ends = [block.start + int(frames.at[0]), block.start + int(frames.end[-1])]
                for number, table in block.tables.items():
                    parts[numbers[number]].append(table[slice(*np.searchsorted(table.at, ends))])
                done = ends[1]
        damage = Damage(bad, unknown, max(0, file.tell() - used))
    tables = {name: _joined(tables) for name, tables in parts.items() if any(map(len, tables))}
    return Scan(tables, counts, stamp > 0, damage)


def stamp_size(file: BufferedReader) -> int:
    """Bytes of receiver's stamp before each frame: 8, or 0 for a raw stream."""
    head = np.frombuffer(file.read(1 << 18), np.uint8)
    file.seek(0)
    frames = checked_frames(head)
    links = {size: int(np.isin(frames.end + size, frames.at).sum()) for size in (8, 0)}
    if links[8] == links[0]:
        return 8 if len(frames) and frames.at[0] >= 8 else 0
    return 8 if links[8] > links[0] else 0


def checked_frames(buffer: Bytes) -> Frames:
    """Every frame with a right checksum, though frames may overlap."""
    at = np.flatnonzero(mavlink.marks(buffer[: max(0, len(buffer) - 7)]))
    end = mavlink.ends(buffer, at)
    inside = (end > 0) & (end <= len(buffer))
    return _checked(buffer, at[inside], end[inside])


def _checked(buffer: Bytes, at: Ints, end: Ints) -> Frames:
    frames = mavlink.headers(buffer, at, end)
    frames = frames.where(mavlink.known(frames.number))
    return frames.where(mavlink.valid(buffer, frames))


@dataclass(frozen=True, slots=True, eq=False)
class _Block:
    """Sound frames of one stretch of the file, and what lies before each."""

    start: int
    """Place of the buffer in the file."""
    size: int
    last: bool
    """Whether the file ends here."""
    frames: Frames
    sender: NDArray[np.uint16]
    groups: list[tuple[int, Ints]]
    """Indices of the frames by message id."""
    tables: dict[int, Table]
    """The wanted messages by message id."""
    bad: Ints
    """Bad frames in the gap before each frame, and behind the last."""
    unknown: Ints
    unknown_bytes: Ints

    def from_place(self, done: int) -> slice:
        """Frames behind a place in the file, less those that the next block sees whole."""
        stop = len(self.frames)
        if not self.last:
            stop = int(np.searchsorted(self.frames.end, self.size - MARGIN, side="right"))
        return slice(min(stop, int(np.searchsorted(self.frames.at, done - self.start))), stop)

    def counts(self, kept: slice) -> Iterator[tuple[int, int, int]]:
        """How often each sender sent each message: sender, message id, count."""
        for number, rows in self.groups:
            sender = self.sender[rows[slice(*np.searchsorted(rows, [kept.start, kept.stop]))]]
            if not len(sender):
                continue
            if sender.min() == sender.max():  # the usual case, and quick
                yield int(sender[0]), number, len(sender)
                continue
            for who, count in zip(*np.unique_counts(sender), strict=True):
                yield int(who), number, int(count)


def _buffers(file: BufferedReader) -> Iterator[tuple[int, Bytes, bool]]:
    """Cut the file into parts that overlap, with their places, and whether one is the last.

    All are the same memory: a part is gone when the next one is asked for.
    """
    start, overlap, last = 0, 0, False
    buffer = np.empty(2 * MARGIN + BLOCK, np.uint8)
    while not last:
        wanted = overlap + BLOCK
        size = overlap + file.readinto(buffer[overlap:wanted].data)
        last = size < wanted
        yield start, buffer[:size], last
        overlap = min(2 * MARGIN, size)
        start += size - overlap
        buffer[:overlap] = buffer[size - overlap : size].copy()


def _block(start: int, buffer: Bytes, last: bool, stamp: int, wanted: Collection[int]) -> _Block:
    """Find and decode everything in one part."""
    frames = _bounded(buffer, stamp)
    gap, *found = _gaps(buffer, frames, stamp)
    sender = mavlink.senders(buffer, frames.at)
    groups = mavlink.by_value(frames.number)
    tables = {}
    for number, rows in groups:
        if number in wanted:
            at = frames.at[rows]
            arrival = np.zeros(len(at), np.int64)
            if stamp:
                # where bytes are missing before the frame, its stamp is not one
                whole = (gap[rows] >= 0) & (at >= stamp)
                arrival[whole] = mavlink.stamps(buffer, at[whole])
            decoded = mavlink.decode(buffer, at, number)
            tables[number] = Table(at + start, arrival, sender[rows], decoded)
    return _Block(start, len(buffer), last, frames, sender, groups, tables, *found)


def _bounded(buffer: Bytes, stamp: int) -> Frames:
    """Find sound frames by halves where marks are so dense that they would fill the memory."""
    mark = mavlink.marks(buffer)
    if len(buffer) < 4 * MARGIN or np.count_nonzero(mark) <= MARKS:
        return _sound(buffer, mark, stamp)
    middle = len(buffer) // 2
    left = _bounded(buffer[: middle + MARGIN], stamp)
    left = left[left.at < middle]
    first = max(middle, int(left.end[-1]) if len(left) else 0)
    right = _bounded(buffer[middle - MARGIN :], stamp).moved(middle - MARGIN)
    return mavlink.merged(left, right[right.at >= first])


def _sound(buffer: Bytes, mark: Mask, stamp: int) -> Frames:
    """Find the frames with a right checksum that do not overlap."""
    at = np.flatnonzero(mark[: max(0, len(buffer) - 7)])
    end = mavlink.ends(buffer, at)
    inside = (end > 0) & (end <= len(buffer))
    at, end = at[inside], end[inside]
    # what leads behind the buffer is not known to break the chain
    following = end + stamp
    linked = mark[np.minimum(following, len(mark) - 1)] | (following >= len(mark))
    frames = _disjoint(_checked(buffer, at[linked], end[linked]), stamp)
    start, stop, broken = _gap_edges(buffer, frames, stamp)
    if not broken.any():
        return frames
    broken[broken] = ~_bridged(buffer, start[broken], stop[broken], stamp)[0]
    if not broken.any():
        return frames
    loose = np.flatnonzero(~linked)
    before = np.searchsorted(frames.at, at[loose], side="right")
    within = broken[before] & (at[loose] >= start[before]) & (end[loose] <= stop[before] + stamp)
    tried = loose[within]
    more = _checked(buffer, at[tried], end[tried])
    return _disjoint(mavlink.merged(frames, more), stamp) if len(more) else frames


def _disjoint(frames: Frames, stamp: int) -> Frames:
    """Drop frames that begin inside another one; a frame in the chain goes before one that is not.

    A wrong frame passes the checksum once in 65,536, so few are looked at one by one.
    """
    if not np.any(frames.at[1:] < frames.end[:-1]):
        return frames
    furthest = np.maximum.accumulate(frames.end)
    doubtful = np.flatnonzero(frames.at[1:] < furthest[:-1]) + 1
    links = np.isin(frames.at - stamp, frames.end).astype(np.int64)
    links += np.isin(frames.end + stamp, frames.at)
    kept = np.ones(len(frames), np.bool_)
    for i in doubtful:
        j = i - 1
        while j >= 0 and not kept[j]:
            j -= 1
        if j >= 0 and frames.at[i] < frames.end[j]:
            kept[j if links[i] > links[j] else i] = False
    return frames[kept]


def _gap_edges(buffer: Bytes, frames: Frames, stamp: int) -> tuple[Ints, Ints, Mask]:
    """Where each gap begins and ends, before each frame and behind the last, and if it is one."""
    start = np.concatenate([[0], frames.end])
    stop = np.concatenate([frames.at - stamp, [len(buffer)]])
    return start, stop, start != stop


def _gaps(buffer: Bytes, frames: Frames, stamp: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Bytes, bad frames, unknown frames and their bytes in each gap."""
    start, stop, broken = _gap_edges(buffer, frames, stamp)
    bad, unknown, unknown_bytes = (np.zeros(len(start), np.int64) for _ in range(3))
    if broken.any():
        bridged, *counts = _bridged(buffer, start[broken], stop[broken], stamp)
        bad[broken] = np.where(bridged, counts[0], 1)
        unknown[broken] = np.where(bridged, counts[1], 0)
        unknown_bytes[broken] = np.where(bridged, counts[2], 0)
    return stop - start, bad, unknown, unknown_bytes


def _bridged(buffer: Bytes, start: Ints, stop: Ints, stamp: int) -> tuple[Mask, Ints, Ints, Ints]:
    """Walk from header to header through each gap.

    Returns
    -------
    Whether the walk comes out at the gap's end, and how many frames it met of known messages
    (their checksums are wrong), of unknown messages, and the bytes of these.
    """
    place = start.copy()
    bad, unknown, unknown_bytes = (np.zeros(len(start), np.int64) for _ in range(3))
    walking = np.flatnonzero(start < stop)
    for _ in range(BRIDGE):
        at = place[walking] + stamp
        there = at + 12 <= len(buffer)
        walking, at = walking[there], at[there]
        end = np.where(buffer[at] - np.uint8(mavlink.V2) < 2, mavlink.ends(buffer, at), -1)
        fits = (end > 0) & (end <= stop[walking])
        walking, at, end = walking[fits], at[fits], end[fits]
        foreign = ~mavlink.known(mavlink.headers(buffer, at, end).number)
        bad[walking] += ~foreign
        unknown[walking] += foreign
        unknown_bytes[walking] += np.where(foreign, end - at + stamp, 0)
        place[walking] = end
        walking = walking[end < stop[walking]]
        if not len(walking):
            break
    return place == stop, bad, unknown, unknown_bytes


def _joined(tables: list[Table]) -> Table:
    # numpy joins rows of fields one field at a time, rows of bytes at once
    plain = [table.rows.view(f"V{table.rows.itemsize}") for table in tables]
    return Table(
        np.concatenate([table.at for table in tables]),
        np.concatenate([table.arrival for table in tables]),
        np.concatenate([table.sender for table in tables]),
        np.concatenate(plain).view(tables[0].rows.dtype),
    )
