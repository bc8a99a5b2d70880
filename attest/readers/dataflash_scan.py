"""The messages of a binary DataFlash log: found through damage, decoded for the wanted names.

There are no checksums. A sound log is a chain: each message ends where the next one's header
begins. A message is taken if a header follows it, or else, in what the chain leaves uncovered, if
its time fits those of its neighbours and what lies behind it is as long as a message.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.readers.dataflash_format import (
    FMT,
    FMT_FORMAT,
    HEADER,
    Damage,
    Format,
    Ints,
    Mask,
    Scan,
    parse,
    with_units,
)
from attest.readers.dataflash_tables import rows, tables

Bytes = NDArray[np.uint8]

MARKS = (0xA3, 0x95)
BLOCK = 1 << 24
"""Bytes looked at together."""
REDEFINED = 100
"""A message number is defined anew at most this often."""
NEAR = 5_000_000
"""A message between two others is at most this far from one of them, microseconds."""
SHORTEST = HEADER + 8
"""Bytes of a message that has a time."""
NAME = HEADER + 2
"""Where the name begins in an FMT."""
TOGETHER = 100_000
"""Descriptions that are looked at together: bounds the memory."""

_NAMED = np.array([chr(code).isalnum() and code < 128 for code in range(256)])


@dataclass(frozen=True, slots=True, eq=False)
class _Frames:
    """Messages, or what could be some."""

    at: Ints
    kind: Bytes
    end: Ints

    def __len__(self) -> int:
        return len(self.at)

    def __getitem__(self, chosen: Mask | Ints) -> "_Frames":
        return _Frames(self.at[chosen], self.kind[chosen], self.end[chosen])


Definitions = dict[int, list[tuple[int, Format]]]
"""By message number: from which place on which format holds."""


def scan(path: Path, wanted: Collection[str]) -> Scan:
    """Read the wanted messages of a log."""
    data: Bytes = np.memmap(path, np.uint8, "r")
    places = marks(data)
    defined = definitions(data, places)
    maybe = _candidates(data, places, defined)
    frames = _sound(data, maybe, defined)
    named = [(form, frames.at[chosen]) for form, chosen in _by_name(frames, defined)]
    counts: Counter[str] = Counter()
    for form, at in named:
        counts[form.name] += len(at)
    decoded, formats, odd = tables(data, named, {*wanted, "UNIT", "MULT", "FMTU"})
    units = with_units(decoded, formats)
    found = {name: table for name, table in units.items() if name in wanted}
    return Scan(found, dict(counts), _damage(data, frames, defined), odd)


def marks(data: Bytes) -> Ints:
    """Find the places where a message could begin and its number is still in the file."""
    found = []
    for start in range(0, len(data), BLOCK):
        block = np.asarray(data[start : start + BLOCK + HEADER - 1])
        at = np.flatnonzero(block[: max(0, len(block) - HEADER + 1)] == MARKS[0])
        found.append(at[block[at + 1] == MARKS[1]] + start)
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def definitions(data: Bytes, places: Ints) -> Definitions:
    """Read every FMT that can be one."""
    at = places[data[places + 2] == FMT]
    at = at[at + FMT_FORMAT.length <= len(data)]
    at = at[_NAMED[data[at + NAME]]]
    known: dict[bytes, Format | None] = {}
    found: Definitions = {FMT: [(0, FMT_FORMAT)]}
    for some in np.split(at, range(TOGETHER, len(at), TOGETHER)):
        cells = rows(data, some, FMT_FORMAT.length).tolist()
        for place, row in zip(some.tolist(), cells, strict=True):
            if row not in known:
                known[row] = parse(row[3], row[4], row[5:9], row[9:25], row[25:89])
            _define(found, known[row], place)
    return found


def _define(found: Definitions, form: Format | None, place: int) -> None:
    if form is None or form.kind == FMT:
        return
    given = found.setdefault(form.kind, [])
    if len(given) < REDEFINED and (not given or given[-1][1] != form):
        given.append((place if given else 0, form))


def _candidates(data: Bytes, places: Ints, defined: Definitions) -> _Frames:
    """Everything with a known number that lies in the file as a whole."""
    kinds = data[places + 2]
    lengths = np.zeros(256, np.int64)
    for kind, given in defined.items():
        lengths[kind] = given[0][1].length
    length = lengths[kinds]
    for kind, given in defined.items():
        if len({form.length for _, form in given}) > 1:
            mine = np.flatnonzero(kinds == kind)
            index = np.searchsorted([at for at, _ in given], places[mine], side="right") - 1
            length[mine] = np.array([form.length for _, form in given])[index]
    whole = (length > 0) & (places + length <= len(data))
    return _Frames(places[whole], kinds[whole], (places + length)[whole])


def _sound(data: Bytes, maybe: _Frames, defined: Definitions) -> _Frames:
    """Tell messages from what only looks like one."""
    linked = _linked(data, maybe.end)
    chain = _disjoint(maybe[linked])
    rest = maybe[~linked]
    after = np.searchsorted(chain.at, rest.at)
    start = np.concatenate([[0], chain.end])[after]
    stop = np.concatenate([chain.at, [len(data)]])[after]
    inside = (rest.at >= start) & (rest.end <= stop)
    inside &= _before_one(chain)[rest.kind, np.clip(stop - rest.end, 0, 255)] | (stop == len(data))
    if not inside.any():
        return chain
    rest, after = rest[inside], after[inside]
    more = _disjoint(rest[_plausible(data, rest, chain, after, defined)])
    if not len(more):
        return chain
    together = _Frames(
        np.concatenate([chain.at, more.at]),
        np.concatenate([chain.kind, more.kind]),
        np.concatenate([chain.end, more.end]),
    )
    return together[np.argsort(together.at, kind="stable")]


def _before_one(chain: _Frames) -> Mask:
    """Tell for each kind how long the messages are that follow it elsewhere.

    Bytes of another length behind a message mean that it lost some, or that some were put in.
    """
    lengths = np.zeros((256, 256), np.bool_)
    lengths[chain.kind[:-1], (chain.end - chain.at)[1:]] = True
    return lengths


def _linked(data: Bytes, end: Ints) -> Mask:
    """Whether a header follows, or the end of the file."""
    last = len(data) - 1
    first, second = data[np.minimum(end, last)], data[np.minimum(end + 1, last)]
    follows = (first == MARKS[0]) & (second == MARKS[1]) & (end < last)
    linked: Mask = follows | (end == len(data))
    return linked


def _disjoint(frames: _Frames) -> _Frames:
    """Drop what begins inside another one; what begins where another one ends goes first."""
    if not np.any(frames.at[1:] < frames.end[:-1]):
        return frames
    furthest = np.maximum.accumulate(frames.end)
    doubtful = np.flatnonzero(frames.at[1:] < furthest[:-1]) + 1
    at, end, behind = frames.at, frames.end, np.zeros(len(frames), np.bool_)
    following = np.minimum(np.searchsorted(at, end), len(at) - 1)
    behind[following[at[following] == end]] = True
    kept = np.ones(len(frames), np.bool_)
    last = before = -2
    for i in (int(i) for i in doubtful):  # a list of all could be large
        last = last if before == i - 1 else i - 1
        before = i
        if at[i] >= end[last]:
            last = i
        elif behind[i] and not behind[last]:
            kept[last], last = False, i
        else:
            kept[i] = False
    return frames[kept]


def _plausible(
    data: Bytes, rest: _Frames, chain: _Frames, after: Ints, defined: Definitions
) -> Mask:
    """Whether the time of each fits those of the chain's messages around it."""
    t, timed = _micros(data, rest, defined)
    about, known = _micros(data, chain, defined)
    index = np.flatnonzero(known)
    if not len(index):
        return timed
    right = np.searchsorted(index, after)
    before = about[index[np.maximum(right - 1, 0)]]
    behind = about[index[np.minimum(right, len(index) - 1)]]
    near = np.minimum(_apart(t, before), _apart(t, behind)) < NEAR
    return timed & (near | ((t > before) & (t < behind)))


def _apart(t: NDArray[np.uint64], other: NDArray[np.uint64]) -> NDArray[np.uint64]:
    apart: NDArray[np.uint64] = np.maximum(t, other) - np.minimum(t, other)
    return apart


def _micros(data: Bytes, frames: _Frames, defined: Definitions) -> tuple[NDArray[np.uint64], Mask]:
    """Microseconds since boot of the messages that begin with them."""
    timed = np.zeros(256, np.bool_)
    for kind, given in defined.items():
        timed[kind] = all(form.timed and form.length >= SHORTEST for _, form in given)
    has = timed[frames.kind]
    t = np.zeros(len(frames), np.uint64)
    t[has] = rows(data, frames.at[has] + HEADER, 8).view("<u8")
    return t, has


def _by_name(frames: _Frames, defined: Definitions) -> Iterator[tuple[Format, Ints]]:
    """Yield the messages of each format."""
    order = np.argsort(frames.kind, kind="stable")
    edges = np.searchsorted(frames.kind[order], np.arange(257))
    for kind, given in defined.items():
        mine = order[edges[kind] : edges[kind + 1]]
        starts = [at for at, _ in given[1:]]
        cuts = np.searchsorted(frames.at[mine], starts)
        for (_, form), chosen in zip(given, np.split(mine, cuts), strict=True):
            if len(chosen):
                yield form, chosen


def _damage(data: Bytes, frames: _Frames, defined: Definitions) -> Damage:
    """Count what lies between the messages."""
    start = np.concatenate([[0], frames.end])
    stop = np.concatenate([frames.at, [len(data)]])
    gap = stop - start
    tail = data[int(start[-1]) :][:HEADER].tolist()
    begun = len(tail) == HEADER and tuple(tail[:2]) == MARKS and tail[2] in defined
    cut = bool(0 < gap[-1] < HEADER) or (begun and int(gap[-1]) < 256)
    if cut:
        gap = gap[:-1]
    return Damage(int((gap > 0).sum()), int(gap.sum()), cut)
