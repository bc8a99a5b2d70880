"""MAVLink frames in bytes: layouts, checksums and fields, by array, as pymavlink defines them.

    MAVLink 1    FE len seq sys comp id           payload crc crc
    MAVLink 2    FD len inc cmp seq sys comp id×3 payload crc crc [signature×13]

The checksum is CRC-16/MCRF4XX over everything between the first byte and itself, and one more
byte that stands for the message's definition. MAVLink 2 leaves out zeros at a payload's end.
"""

import re
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

LONGEST = 10 + 255 + 2 + 13
"""Bytes of the longest frame."""
V1, V2 = 0xFE, 0xFD
FEW = 200
"""Frames of one length that are not worth their own turn."""
ROWS_AT_ONCE = 1 << 18
"""Bytes of frames gathered at a time: what stays in the cache."""
_CODES = {"b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8",
          "Q": "<u8", "f": "<f4", "d": "<f8", "c": "S1"}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Dialect:
    """What pymavlink knows about its messages."""

    extra: NDArray[np.int16]
    """The definition's byte in the checksum by message id, -1 for an unknown message."""
    names: dict[int, str]
    dtypes: dict[int, np.dtype[np.void]]


@cache
def dialect() -> Dialect:
    """Return the tables of the ArduPilot dialect, which holds the common one."""
    # the dialect alone: mavutil is slow to import and opens what it is given
    from pymavlink.dialects.v20 import ardupilotmega

    messages = ardupilotmega.mavlink_map
    extra = np.full(max(messages) + 1, -1, np.int16)
    for number, message in messages.items():
        extra[number] = message.crc_extra
    names = {number: message.msgname for number, message in messages.items()}
    return Dialect(extra, names, {number: _dtype(m) for number, m in messages.items()})


def _dtype(message: object) -> np.dtype[np.void]:
    """Fields in the order of the wire, from a struct format such as ``<Q4fB20s``."""
    layout = message.unpacker.format  # type: ignore[attr-defined]
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    names = message.ordered_fieldnames  # type: ignore[attr-defined]
    for name, (count, code) in zip(names, re.findall(r"(\d*)([a-zA-Z])", layout), strict=True):
        if code == "s":
            fields.append((name, f"S{count}"))
        elif count:
            fields.append((name, _CODES[code], (int(count),)))
        else:
            fields.append((name, _CODES[code]))
    return np.dtype(fields)


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Where frames lie in a buffer, in its order."""

    at: Ints
    """Index of the first byte."""
    end: Ints
    """Index behind the last byte, signature included."""
    number: Ints
    """Message id."""
    checked: Ints
    """How many bytes behind the first one the checksum covers."""

    def __len__(self) -> int:
        return len(self.at)

    def __getitem__(self, chosen: Ints | Mask | slice) -> "Frames":
        return Frames(self.at[chosen], self.end[chosen], self.number[chosen], self.checked[chosen])

    def where(self, chosen: Mask) -> "Frames":
        """Return the chosen frames; without a copy where that is all."""
        return self if chosen.all() else self[chosen]

    def moved(self, by: int) -> "Frames":
        """Return the same frames by their places in a longer buffer."""
        return Frames(self.at + by, self.end + by, self.number, self.checked)


def merged(a: Frames, b: Frames) -> Frames:
    """Return the frames of both, in file order."""
    order = np.argsort(np.concatenate([a.at, b.at]), kind="stable")
    return Frames(
        np.concatenate([a.at, b.at])[order],
        np.concatenate([a.end, b.end])[order],
        np.concatenate([a.number, b.number])[order],
        np.concatenate([a.checked, b.checked])[order],
    )


def marks(buffer: Bytes) -> Mask:
    """Where a frame could begin."""
    above = np.subtract(buffer, V2, dtype=np.uint8)
    # in place: fresh pages for a temporary cost more than the arithmetic
    return np.less(above, 2, out=above.view(np.bool_))


def ends(buffer: Bytes, at: Ints) -> Ints:
    """Where frames that begin at these marks end by their own account; -1: not a frame.

    The buffer must go on for 4 bytes behind each mark.
    """
    head = _words(buffer, "<u4")[at]
    length = (head >> 8 & 0xFF).astype(np.int64)
    second = head & 0xFF == V2
    flags = head >> 16 & 0xFF
    size = length + np.where(second, 12 + 13 * (flags & 1).astype(np.int64), 8)
    # an unknown flag means another layout: such a frame must not be read
    return np.where(second & (flags > 1), -1, at + size)


def headers(buffer: Bytes, at: Ints, end: Ints) -> Frames:
    """Read the headers of frames that lie inside the buffer."""
    second = buffer[at] == V2
    number = buffer[at + 5].astype(np.int64)
    wide = at[second]
    number[second] = (_words(buffer, "<u4")[wide + 7] & 0xFFFFFF).astype(np.int64)
    checked = buffer[at + 1].astype(np.int64) + np.where(second, 9, 5)
    return Frames(at, end, number, checked)


def known(number: Ints) -> Mask:
    """Whether the dialect defines these message ids, so that their checksum can be checked."""
    extra = dialect().extra
    return (number < len(extra)) & (extra[np.minimum(number, len(extra) - 1)] >= 0)


def valid(buffer: Bytes, frames: Frames) -> Mask:
    """Whether the checksums of frames with known message ids are right."""
    extra = dialect().extra[frames.number].astype(np.uint16)
    crc = np.zeros(len(frames), np.uint16)
    few = []
    for length, rows in by_value(frames.checked):
        if len(rows) < FEW:
            few.append(rows)
            continue
        step = max(1, ROWS_AT_ONCE // length)
        for first in range(0, len(rows), step):
            part = rows[first : first + step]
            crc[part] = _alike(buffer, frames.at[part] + 1, length)
    if few:
        part = np.concatenate(few[::-1])
        crc[part] = _unlike(buffer, frames.at[part] + 1, frames.checked[part])
    behind = frames.at + 1 + frames.checked
    crc = _finished(buffer, behind, crc, frames.checked, extra)
    good: Mask = crc == _words(buffer, "<u2")[behind]
    return good


def decode(buffer: Bytes, at: Ints, number: int) -> NDArray[np.void]:
    """Fields of frames of one message type, in wire order."""
    dtype = dialect().dtypes[number]
    payload = at + np.where(buffer[at] == V2, 10, 6)
    length = np.minimum(buffer[at + 1], dtype.itemsize)
    out = np.zeros((len(at), dtype.itemsize), np.uint8)
    for size, rows in by_value(length):
        if size:
            out[rows, :size] = _rows(buffer, payload[rows], size)
    return out.view(dtype)[:, 0]


def senders(buffer: Bytes, at: Ints) -> NDArray[np.uint16]:
    """System and component as ``system << 8 | component``."""
    return _words(buffer, ">u2")[at + np.where(buffer[at] == V2, 5, 3)].astype(np.uint16)


def stamps(buffer: Bytes, at: Ints) -> Ints:
    """Return the eight bytes before each frame: the receiver's clock, microseconds."""
    return _words(buffer, ">u8")[at - 8].astype(np.int64)


def by_value(values: NDArray[np.integer]) -> list[tuple[int, Ints]]:
    """Group indices by value, which must fit in 16 bits."""
    if len(values) and values.min() == values.max():
        return [(int(values[0]), np.arange(len(values)))]
    order = np.argsort(values.astype(np.uint16), kind="stable")  # a radix sort
    ranked = values[order]
    first = np.flatnonzero(np.diff(ranked, prepend=-1)).tolist()
    stops = [*first, len(order)][1:]
    return [(int(ranked[i]), order[i:stop]) for i, stop in zip(first, stops, strict=True)]


def _words(buffer: Bytes, dtype: str) -> NDArray[np.unsignedinteger]:
    """View the buffer as words that begin at every byte."""
    size = np.dtype(dtype).itemsize
    return np.ndarray((max(0, len(buffer) - size + 1),), dtype, buffer, strides=(1,))


def _rows(buffer: Bytes, start: Ints, size: int) -> Bytes:
    """Copy ``size`` bytes from each start; one item per row is what makes it quick."""
    rows = np.ndarray((len(buffer) - size + 1,), f"V{size}", buffer, strides=(1,))[start]
    return rows.view(np.uint8).reshape(-1, size)


def _alike(buffer: Bytes, start: Ints, length: int) -> NDArray[np.uint16]:
    """CRC-16/MCRF4XX from each start over the whole words of one length, two bytes a step."""
    two = _crc_tables()[1]
    words = _rows(buffer, start, length & ~1).view("<u2")
    crc = np.full(len(start), 0xFFFF, np.uint16)
    for j in range(length // 2):
        crc = two.take(crc ^ words[:, j], mode="wrap")
    return crc


def _unlike(buffer: Bytes, start: Ints, length: Ints) -> NDArray[np.uint16]:
    """Do the same for lengths that never rise: at each step fewer frames take part."""
    two, words = _crc_tables()[1], _words(buffer, "<u2")
    crc = np.full(len(start), 0xFFFF, np.uint16)
    parts = np.searchsorted(-length, -2 * np.arange(1, length[0] // 2 + 1), side="right")
    for j, count in enumerate(parts.tolist()):
        crc[:count] = two.take(crc[:count] ^ words[start[:count] + 2 * j], mode="wrap")
    return crc


def _finished(
    buffer: Bytes, behind: Ints, crc: NDArray[np.uint16], length: Ints, extra: NDArray[np.uint16]
) -> NDArray[np.uint16]:
    """Add to checksums over whole words the byte that may be left, and the extra byte."""
    odd = np.flatnonzero(length & 1)
    crc[odd] = _one_more(crc[odd], buffer[behind[odd] - 1].astype(np.uint16))
    return _one_more(crc, extra)


def _one_more(crc: NDArray[np.uint16], byte: NDArray[np.uint16]) -> NDArray[np.uint16]:
    low = _crc_tables()[0].take((crc ^ byte) & 0xFF, mode="wrap")
    more: NDArray[np.uint16] = np.bitwise_xor(crc >> 8, low)
    return more


@cache
def _crc_tables() -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Remainders after one zero byte by low byte, and after two by whole state."""
    one = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        one = np.where(one & 1, one >> 1 ^ 0x8408, one >> 1).astype(np.uint16)
    two = np.arange(65536, dtype=np.uint16)
    for _ in range(2):
        two = two >> 8 ^ one[two & 0xFF]
    return one, two
