"""What of a ULog is sound: whole messages of known kinds, in the sizes that their formats say.

The library that decodes them trusts its input, so it is given these alone. There are no checksums:
a message is known by its kind and its size; behind damage the chain is taken up again where two
messages follow each other.
"""

import re
import struct
from array import array
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from attest.readers.ulog_format import Catalogue, define, inform, needed, subscribe

Ints = NDArray[np.int64]

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
HEADER = 16
"""Bytes before the first message, each of which begins with its size and its kind."""
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
FORMAT, INFO, SUBSCRIPTION, DATA, DROPOUT, FLAGS, SYNCING = b"FIADOBS"
BEHIND = 5
"""Bytes of a data message before its row: size, kind, message id."""
LEAST = {
    FORMAT: 3, INFO: 3, SUBSCRIPTION: 4, DATA: 2, DROPOUT: 2, FLAGS: 40, SYNCING: 8,
    **dict(zip(b"MPQRLC", (4, 3, 4, 2, 9, 11), strict=True)),
}  # fmt: skip
"""Least size of each kind of message."""
LOOKS = {
    FORMAT: re.compile(rb"[A-Za-z0-9_]+:[^\0-\x1f]*\0*\Z"),
    SUBSCRIPTION: re.compile(rb"(?s:...)[A-Za-z0-9_]+\0*\Z"),
    **dict.fromkeys(b"IP", re.compile(rb"(?s:.)[a-z0-9_]+(\[\d+\])? [!-~]")),
    **dict.fromkeys(b"MQ", re.compile(rb"(?s:..)[a-z0-9_]+(\[\d+\])? [!-~]")),
    **dict.fromkeys(b"LC", re.compile(rb"[\0-\x07]|[0-7]")),
}
"""How the messages begin that have any size."""
APPENDED = 1
"""The one incompatible flag that is known."""

_HEAD = struct.Struct("<HB")
_START = struct.Struct("<HBH")
_KNOWN = np.zeros(256, np.bool_)
_KNOWN[list(LEAST)] = True


@dataclass(slots=True)
class Damage:
    """What is not sound, as far as the walk has come."""

    gaps: int = 0
    """Stretches in which no message can be told."""
    bytes_skipped: int = 0
    orphans: int = 0
    """Data of which the log does not say what it is."""
    cut: bool = False
    """Whether the last message is not whole."""


@dataclass(slots=True)
class _Walk:
    """One way through a log."""

    data: bytes
    wanted: Collection[str]
    catalogue: Catalogue = field(default_factory=Catalogue)
    damage: Damage = field(default_factory=Damage)
    places: dict[int, "array[int]"] = field(default_factory=dict)
    """Where the data messages of each id begin."""
    dropouts: list[int] = field(default_factory=list)
    """Milliseconds that the logger missed."""
    edges: list[int] = field(default_factory=list)
    """Where data was appended: the message before may be cut."""
    later: bool = False
    """Whether the log is of a kind from after this was written."""


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """What of a log is sound and wanted."""

    definitions: bytes
    """A log of its own: formats, subscriptions, what tells the vehicle, and one row of each."""
    at: dict[int, Ints]
    """Where the rows of each message id begin, behind the id."""
    counts: dict[str, int]
    """Data messages by topic, all of them."""
    dropouts: tuple[int, ...]
    """Milliseconds that the logger missed."""
    damage: Damage
    refused: tuple[str, ...]
    """Wanted topics that cannot be read as they are described."""
    later: bool


def sound(data: bytes, wanted: Collection[str]) -> Sound:
    """Find the rows of the wanted topics of a log, and what a library needs to read them."""
    walk = _Walk(data, wanted)
    _go(walk)
    names = walk.catalogue.names
    counts: Counter[str] = Counter()
    for number, places in walk.places.items():
        counts[names.get(number, "unknown")] += len(places)
        walk.damage.orphans += len(places) * (number not in names)
    subscribed = walk.catalogue.subscribed.keys() & walk.places.keys()
    at = {number: np.array(walk.places[number], np.int64) + BEHIND for number in sorted(subscribed)}
    refused = tuple(sorted(walk.catalogue.refused & set(wanted)))
    dropouts = tuple(walk.dropouts)
    return Sound(
        _definitions(walk, at), at, dict(counts), dropouts, walk.damage, refused, walk.later
    )


def _definitions(walk: _Walk, at: dict[int, Ints]) -> bytes:
    """Return all that the log says about what is wanted, and the first row of each."""
    catalogue, data = walk.catalogue, walk.data
    told = [(FORMAT, needed(catalogue)), (INFO, catalogue.info.values()),
            (SUBSCRIPTION, [catalogue.subscribed[number] for number in at])]  # fmt: skip
    parts = [_HEAD.pack(len(message), kind) + message for kind, group in told for message in group]
    for places in at.values():
        start = int(places[0]) - BEHIND
        parts.append(data[start : start + 3 + _HEAD.unpack_from(data, start)[0]])
    return b"".join([data[:7], b"\1", data[8:HEADER], *parts])


def _go(walk: _Walk) -> None:
    """Walk from message to message; learn what they define and where the data is."""
    data, start, at = walk.data, _START.unpack_from, HEADER
    last, edge = len(data), HEADER
    found = walk.catalogue.fits.get
    places: dict[int, Callable[[int], None]] = {}
    while at + 3 <= last:
        if at + 5 <= edge:  # nearly all are data of a known size, and pass here
            size, kind, number = start(data, at)
            end = at + 3 + size
            if kind == DATA and end <= edge and found(size << 16 | number):
                if number not in places:
                    places[number] = walk.places.setdefault(number, array("q")).append
                places[number](at)
                at = end
                continue
        edge = _edge(walk, at)
        if not _is_sound(walk, at, edge):
            at = _skip(walk, at, edge)
            continue
        size, kind = _HEAD.unpack_from(data, at)
        _learn(walk, at, kind, data[at + 3 : at + 3 + size])
        at += 3 + size
        edge = _edge(walk, at)
    walk.damage.cut |= at < last


def _number(data: bytes, at: int) -> int:
    """Tell the message id of data."""
    return data[at + 3] | data[at + 4] << 8


def _edge(walk: _Walk, at: int) -> int:
    """Tell where the part of the log ends that a place lies in."""
    while walk.edges and walk.edges[0] <= at:
        walk.edges.pop(0)
    return walk.edges[0] if walk.edges else len(walk.data)


def _is_sound(walk: _Walk, at: int, edge: int) -> bool:
    """Whether a message of a known kind and a fitting size lies here as a whole."""
    data = walk.data
    if at + 3 > edge:
        return False
    size, kind = _HEAD.unpack_from(data, at)
    end = at + 3 + size
    if kind not in LEAST or size < LEAST[kind] or end > edge:
        return False
    if kind in LOOKS:
        return LOOKS[kind].match(data, at + 3, end) is not None
    if kind != DATA:
        # the flags come first; elsewhere they are something else by chance
        return at == HEADER if kind == FLAGS else bool(size == LEAST[kind])
    number = _number(data, at)
    if number in walk.catalogue.sized:
        return size << 16 | number in walk.catalogue.fits
    # data of an unknown topic is known by what follows
    return end + 3 > edge or data[end + 2] in LEAST


def _skip(walk: _Walk, at: int, edge: int) -> int:
    """Return where the chain goes on behind something that is no message."""
    size, kind = _HEAD.unpack_from(walk.data, at) if at + 3 <= edge else (0, 0)
    found = _next(walk, at, edge)
    if found is None and (at + 3 > edge or (kind in LEAST and at + 3 + size > edge)):
        walk.damage.cut |= edge == len(walk.data)
        return edge
    found = edge if found is None else found
    walk.damage.gaps += 1
    walk.damage.bytes_skipped += found - at
    return found


def _next(walk: _Walk, at: int, edge: int) -> int | None:
    """Find two sound messages in a row behind a place."""
    start, width = at + 1, 512
    while start + 3 <= edge:
        stop = min(start + width, edge - 2)
        kinds = np.frombuffer(walk.data, np.uint8, stop - start, start + 2)
        for place in (np.flatnonzero(_KNOWN[kinds]) + start).tolist():
            if _is_link(walk, place, edge):
                return int(place)
        start, width = stop, min(2 * width, 1 << 20)
    return None


def _is_link(walk: _Walk, at: int, edge: int) -> bool:
    if not _is_sound(walk, at, edge):
        return False
    data = walk.data
    size, kind = _HEAD.unpack_from(data, at)
    if kind == SYNCING:
        return data[at + 3 : at + 11] == SYNC
    if kind == DATA and _number(data, at) not in walk.catalogue.sized:
        return False
    following = at + 3 + size
    return following == edge or _is_sound(walk, following, edge)


def _learn(walk: _Walk, at: int, kind: int, message: bytes) -> None:
    if kind == FORMAT:
        define(walk.catalogue, message)
    elif kind == SUBSCRIPTION:
        subscribe(walk.catalogue, message, walk.wanted)
    elif kind == INFO:
        inform(walk.catalogue, message)
    elif kind == DATA:
        number = int.from_bytes(message[:2], "little")
        walk.places.setdefault(number, array("q")).append(at)
    elif kind == DROPOUT:
        walk.dropouts.append(int.from_bytes(message, "little"))
    elif kind == FLAGS:
        _flags(walk, message[8:16], message[16:40])


def _flags(walk: _Walk, incompatible: bytes, offsets: bytes) -> None:
    """Learn whether the log is of a later kind, and where data was appended."""
    walk.later |= bool(incompatible[0] & ~APPENDED or any(incompatible[1:]))
    if incompatible[0] & APPENDED:
        edges = sorted(set(struct.unpack("<3Q", offsets)))
        walk.edges = [edge for edge in edges if HEADER < edge < len(walk.data)]
