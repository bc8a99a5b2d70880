"""The frames of a log, block by block, decoded for the wanted messages."""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.readers import mavlink
from attest.readers.mavlink import Bytes, Frames, Ints, Mask
from attest.readers.mavlink_frames import MARGIN, checked_frames, gaps_between, sound_frames

BLOCK = 3 << 20
"""Bytes read at a time."""


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
    frames = sound_frames(buffer, stamp)
    gap, *found = gaps_between(buffer, frames, stamp)
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


def _joined(tables: list[Table]) -> Table:
    # numpy joins rows of fields one field at a time, rows of bytes at once
    plain = [table.rows.view(f"V{table.rows.itemsize}") for table in tables]
    return Table(
        np.concatenate([table.at for table in tables]),
        np.concatenate([table.arrival for table in tables]),
        np.concatenate([table.sender for table in tables]),
        np.concatenate(plain).view(tables[0].rows.dtype),
    )
