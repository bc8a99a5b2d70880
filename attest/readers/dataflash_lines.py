"""The lines of a DataFlash log as text, sorted by the name that each begins with."""

from collections import Counter
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel
from attest.readers.dataflash_format import Ints
from attest.readers.decimals import Bytes, Words, words_of

Spans = Ints
"""Where the cells of each line begin, and where the next line does, shape (n, 2)."""

BLOCK = 1 << 20
"""Bytes searched for lines at once."""
_NAMED = 5
"""Bytes in which a line has its name, of four at most, and a comma."""
_SLOTS, _MOST = 1024, 512
"""Places in the table of names, and how many are told apart at most: a vehicle has some 200."""
_SHIFT, _MIX = np.uint64(54), np.uint64(0x9E3779B97F4A7C15)
_ONE, _SEVEN, _TOP_BYTE = np.uint64(1), np.uint64(7), np.uint64(56)
_PLACES = np.uint64(0x0001020304050607)
_LINES, _LOW, _COMMAS, _FIRST, _TOPS = (
    np.uint64(sum(byte << 8 * i for i in range(count)))
    for byte, count in ((10, 8), (0x7F, 8), (ord(","), _NAMED), (1, _NAMED), (0x80, _NAMED))
)


def by_name(text: Bytes, wanted: Collection[str]) -> tuple[dict[str, Spans], Counter[str], int]:
    """Find the lines of the wanted names, count all names, and the bytes in lines without one.

    Parameters
    ----------
    text
        Eight line feeds end it.
    """
    words, slots = words_of(text), np.zeros(_SLOTS, np.uint64)
    counts, tally = np.zeros(_SLOTS, np.int64), np.zeros(2, np.int64)
    names = {_placed(slots, name.encode()): name for name in wanted}
    keep = np.isin(np.arange(_SLOTS), [*names])
    tally[0] = len(names)
    spans, which = np.empty((BLOCK, 2), np.int64), np.empty(BLOCK, np.int16)
    found: dict[str, list[Spans]] = {}
    begin = 0
    for low in range(0, len(words), BLOCK):
        high = min(low + BLOCK, len(words))
        held, begin = _sort(words, low, high, begin, slots, counts, tally, keep, spans, which)
        order = np.argsort(which[:held], kind="stable")
        there, first = np.unique(which[order], return_index=True)
        for slot, rows in zip(there.tolist(), np.split(order, first[1:]), strict=False):
            mine = spans[rows]
            mine[:, 0] += len(names[slot]) + 1
            found.setdefault(names[slot], []).append(mine)
    told = {int(slots[i]): int(counts[i]) for i in np.flatnonzero(counts).tolist()}
    texts = {key.to_bytes(8, "little").rstrip(b"\0"): count for key, count in told.items()}
    named = Counter({name.decode("latin-1"): count for name, count in texts.items()})
    return {name: np.concatenate(parts) for name, parts in found.items()}, named, int(tally[1])


def _placed(slots: Words, name: bytes) -> int:
    """Put a name into the table, and return where it is."""
    key = int.from_bytes(name, "little")
    slot = (key * int(_MIX) & (2**64 - 1)) >> int(_SHIFT)
    while slots[slot]:
        slot = (slot + 1) % _SLOTS
    slots[slot] = key
    return slot


@kernel
def _sort(
    words: Words,
    low: int,
    high: int,
    begin: int,
    slots: Words,
    counts: Ints,
    tally: Ints,
    keep: NDArray[np.bool_],
    spans: Spans,
    which: NDArray[np.int16],
) -> tuple[int, int]:
    """Go through the lines that end in some bytes: how many are kept, and where the next begins."""
    held = 0
    for at in range(low, high, 8):
        other = words[at] ^ _LINES
        ends = ~(((other & _LOW) + _LOW) | other | _LOW)  # the highest bit of each line feed
        while ends:
            end = at + int(np.int64(_first(ends)))
            ends &= ends - _ONE
            if end >= high:
                break
            key = _name(words[begin])
            slot = int(np.int64((key * _MIX) >> _SHIFT))
            while key and slots[slot] and slots[slot] != key:
                slot = (slot + 1) % _SLOTS
            if not key:
                tally[1] += end - begin
            elif slots[slot] or tally[0] < _MOST:
                tally[0] += not slots[slot]
                slots[slot] = key
                counts[slot] += 1
                if keep[slot]:
                    spans[held, 0], spans[held, 1], which[held] = begin, end + 1, slot
                    held += 1
            begin = end + 1
    return held, begin


@kernel
def _first(marks: np.uint64) -> np.uint64:
    """Return the place of the first byte whose highest bit is set."""
    return (((marks & (~marks + _ONE)) >> _SEVEN) * _PLACES) >> _TOP_BYTE


@kernel
def _name(word: np.uint64) -> np.uint64:
    """Return of the first bytes of a line those before a comma; 0 where none is near."""
    other = word ^ _COMMAS
    comma = (other - _FIRST) & ~other & _TOPS  # the highest bit of a comma, of the first at least
    before = ((comma & (~comma + _ONE)) >> _SEVEN) - _ONE
    return word & before if comma else comma
