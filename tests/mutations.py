"""What can befall a file: each function changes a bytearray by what a generator draws."""

import bz2
import struct
from functools import cache

import lz4.frame
import numpy as np
import zstandard

LONGEST = 300_000
"""Bytes; what is repeated grows no further."""
_EXTREMES = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
             (1 << 62) - 1, (1 << 63) - 1, (1 << 64) - 1)  # fmt: skip
_NUMBERS = (float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 1e38, 5e-324, 0.0, -1.0)
_TEXTS = ("nan", "inf", "-inf", "1e999", "-1e-999", "", '"', "'", " ", "٣", "0x10", "1_000", "\0",
          "9" * 400, "," * 50, "\n", "\r", "-", "1,5", "1e18", "9" * 20, "abc")  # fmt: skip


def flips(data, rng):
    for _ in range(rng.choice((1, 1, 3, 10, 100))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def extremes(data, rng):
    for _ in range(rng.choice((1, 3, 10))):
        at, size = rng.randrange(len(data)), rng.choice((1, 2, 4, 8, 32))
        data[at : at + size] = bytes([rng.choice((0, 1, 0x7F, 0x80, 0xFF))]) * size


def cut(data, rng):
    del data[rng.randrange(1, len(data)) :]


def hole(data, rng):
    at = rng.randrange(len(data))
    del data[at : at + rng.choice((1, 2, 7, 8, 64, 1000))]


def junk(data, rng):
    at = rng.randrange(len(data))
    data[at:at] = rng.randbytes(rng.choice((1, 2, 7, 8, 64, 1000)))


def length(data, rng):
    """Write an absurd integer anywhere."""
    for _ in range(rng.choice((1, 3))):
        size = rng.choice((1, 2, 4, 8))
        at = rng.randrange(max(1, len(data) - size))
        value = rng.choice(_EXTREMES) & ((1 << 8 * size) - 1)
        data[at : at + size] = value.to_bytes(size, rng.choice(("little", "big")))


def nearly(data, rng):
    """Change what may be a length: an integer that is smaller than the file."""
    for _ in range(100):
        size = rng.choice((2, 4, 8))
        at = rng.randrange(max(1, len(data) - size))
        value = int.from_bytes(data[at : at + size], "little")
        if 0 < value < len(data):
            other = value + rng.choice((-8, -1, 1, 8, value, len(data), -value))
            data[at : at + size] = max(0, other).to_bytes(8, "little")[:size]
            return


def repeated(data, rng):
    """Repeat a part, in place."""
    at = rng.randrange(len(data))
    part = data[at : at + rng.choice((16, 100, 1000, 10_000))]
    times = rng.choice((1, 2, 20, 1000))
    data[at:at] = part * max(1, min(times, LONGEST // len(part)))


def numbers(data, rng):
    """Write what is no usable number, in a row as vectors are."""
    form = rng.choice(("<f", "<d", ">d"))
    value = struct.pack(form, rng.choice(_NUMBERS if "d" in form else _NUMBERS[:3]))
    for _ in range(rng.choice((1, 10, 100))):
        at = rng.randrange(max(1, len(data) - 32))
        count = rng.choice((1, 3, 4))
        data[at : at + count * len(value)] = value * count


def swapped(data, rng):
    """Let a later part come first: times go backwards."""
    size = rng.choice((8, 100, 1000, 5000))
    if len(data) > 2 * size:
        i, j = rng.randrange(len(data) - size), rng.randrange(len(data) - size)
        data[i : i + size], data[j : j + size] = data[j : j + size], data[i : i + size]


def earlier(data, rng):
    """Move what may be a time: an integer of 64 bits from 1e6 to 4e18."""
    raw = np.frombuffer(bytes(data), np.uint8)
    if len(raw) < 8:
        return
    words = np.lib.stride_tricks.sliding_window_view(raw, 8).copy().view("<u8")[:, 0]
    times = np.flatnonzero((words > 10**6) & (words < 4 * 10**18))
    for _ in range(rng.choice((1, 10))):
        if len(times):
            at = int(times[rng.randrange(len(times))])
            new = rng.choice((0, int(words[at]) // 2, int(words[at]) + 10**12, (1 << 63) - 1, 1))
            data[at : at + 8] = struct.pack("<Q", new)


def text(data, rng):
    """Write odd cells between commas, or turn the lines about."""
    lines = bytes(data).split(b"\n")
    if rng.random() < 0.2:
        part = lines[1:]
        lines[1:] = rng.choice((part[::-1], sorted(part, key=lambda line: line[-3:]), part + part))
    for _ in range(rng.choice((1, 5, 50))):
        i = rng.choice((0, rng.randrange(len(lines)), rng.randrange(len(lines))))
        cells = lines[i].split(b",")
        cells[rng.randrange(len(cells))] = rng.choice(_TEXTS).encode()
        lines[i] = b",".join(cells)
    data[:] = b"\n".join(lines)


def bomb(data, rng):
    """Insert a chunk of a bag or an MCAP that unpacks to far more than the file."""
    name = rng.choice(("bz2", "lz4", "zstd"))
    packed, size = _packed(name, 1 << rng.choice((20, 26, 28 if name == "zstd" else 26)))
    told = rng.choice((size, 1 << 31, (1 << 32) - 1, len(packed), 0))
    if data[:8] == b"#ROSBAG ":
        _into_bag(data, name, packed, told)
    elif data[:5] == b"\x89MCAP":
        body = struct.pack("<QQQI", 0, 1 << 62, told, 0) + _string(name)
        body += struct.pack("<Q", len(packed)) + packed
        at = 17 + struct.unpack_from("<Q", data, 9)[0] if len(data) > 17 else 8
        data[at:at] = b"\x06" + struct.pack("<Q", len(body)) + body


def _into_bag(data, name, packed, told):
    """Put a chunk first, and take away the index, so that the bag is read from its front."""
    pairs = (b"op=\x05", b"compression=" + name.encode(), b"size=" + struct.pack("<I", told))
    header = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    record = struct.pack("<I", len(header)) + header + struct.pack("<I", len(packed)) + packed
    index = data.find(b"index_pos=")
    if index > 0:
        data[index + 10 : index + 18] = bytes(8)
    at = data.find(b"op=\x05") - 8 if b"op=\x05" in data else 4117
    pad = 13 + 4 + struct.unpack_from("<I", data, 13)[0] if len(data) > 4200 else at
    at = pad + 4 + struct.unpack_from("<I", data, pad)[0] if len(data) > pad + 4 else at
    data[at:at] = record


def _string(value):
    return struct.pack("<I", len(value)) + value.encode()


@cache
def _packed(name, size):
    """Return zeros, packed, and how many."""
    pack = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress}[name]
    return pack(bytes(size)), size


COMMON = (flips, extremes, cut, hole, junk, length, nearly, repeated, numbers, swapped, earlier)
