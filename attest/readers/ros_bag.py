"""ROS 1 bags, version 2.0, read from front to back: one that was cut or never closed reads too.

A record is a header of ``name=value`` fields and some data, each behind its length. Messages lie
in chunks, each connection before its first message; the index at the end is needed for neither.
"""

import struct
from collections.abc import Iterator
from itertools import permutations
from pathlib import Path
from typing import BinaryIO

from attest.readers.ros_topics import Crate, Intake, Topic
from attest.readers.ros_types import ros2_name

MAGIC = b"#ROSBAG V2.0\n"
FILE_HEADER, CHUNK, CONNECTION = 3, 5, 7

_SECOND = 1_000_000_000
_U4 = struct.Struct("<I")
_KEYS = {"op": b"\x04\0\0\0op=\2", "conn": b"\x09\0\0\0conn=", "time": b"\x0d\0\0\0time="}
_VALUES = {"conn": "I", "time": "Q"}
_HEADER = 38
"""Bytes of a message's header, whose three fields may come in any order."""


class _Layout:
    """A message's header in one order of its fields: two values between what never changes."""

    def __init__(self, order: tuple[str, ...]) -> None:
        self.fixed = [_U4.pack(_HEADER), b"", b""]
        """What stands before the first value, between the two, and behind them."""
        names = [name for name in order if name != "op"]
        for name in order:
            self.fixed[0 if name == order[0] else _before(name, order)] += _KEYS[name]
        form = [f"{len(fixed)}s" for fixed in self.fixed]
        values = [_VALUES[name] for name in names]
        self.unpack = struct.Struct(
            f"<{form[0]}{values[0]}{form[1]}{values[1]}{form[2]}I"
        ).unpack_from
        self.conn_first = names[0] == "conn"


def _before(name: str, order: tuple[str, ...]) -> int:
    """Count the values before a field."""
    return sum(other != "op" for other in order[: order.index(name)])


_LAYOUTS = [_Layout(order) for order in permutations(_KEYS)]


def read(path: Path, crate: Crate) -> None:
    """Take the messages of a bag into the crate."""
    size = path.stat().st_size
    connections: dict[int, Topic] = {}
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        for header, start, length in _records(file, size, crate):
            if (op := _op(header)) == FILE_HEADER:
                _indexed(file, header, size, connections, crate)
            elif op == CHUNK and crate.has_room():
                file.seek(start)
                _chunk(file.read(length), header, connections, crate)


def _records(
    file: BinaryIO, size: int, crate: Crate
) -> Iterator[tuple[dict[str, bytes], int, int]]:
    """Yield each record's header, and where its data lie; stop where the file is broken off."""
    at = file.tell()
    while at < size:
        header = _header(_take(file, at, size))
        start = file.tell() + 4
        data = file.read(4)
        length = _U4.unpack(data)[0] if len(data) == 4 else size
        if header is None or start + length > size:
            crate.damage["bytes at the end of a bag that is cut or broken"] = size - at
            if header is not None and _op(header) == CHUNK and start < size:
                yield header, start, size - start  # some of it may unpack
            return
        yield header, start, length
        at = start + length


def _take(file: BinaryIO, at: int, size: int) -> bytes:
    """Read what lies behind its length, or nothing."""
    file.seek(at)
    data = file.read(4)
    if len(data) < 4 or at + 4 + _U4.unpack(data)[0] > size:
        return b""
    return file.read(_U4.unpack(data)[0])


def _header(data: bytes) -> dict[str, bytes] | None:
    """Take a header apart; None where it is none."""
    fields, at = {}, 0
    while at + 4 <= len(data):
        end = at + 4 + _U4.unpack_from(data, at)[0]
        name, equals, value = data[at + 4 : end].partition(b"=")
        if end > len(data) or not equals:
            return None
        fields[name.decode("latin-1")] = value
        at = end
    return fields if fields and at == len(data) else None


def _op(header: dict[str, bytes]) -> int:
    return (header.get("op") or b"\0")[0]


def _number(header: dict[str, bytes], name: str) -> int | None:
    """Return a field as a number; None where it is missing or of another size."""
    value = header.get(name, b"")
    return int.from_bytes(value, "little") if len(value) in {4, 8} else None


def _indexed(
    file: BinaryIO, header: dict[str, bytes], size: int, connections: dict[int, Topic], crate: Crate
) -> None:
    """Take the connections from the index too: a chunk that tells one may be broken."""
    index = _number(header, "index_pos") or 0
    if not len(MAGIC) < index < size:
        crate.damage["bag without an index, as it was not closed: read from front to back"] = 1
        return
    file.seek(index)
    for head, start, length in _records(file, size, Crate(0, lambda _: 0)):
        if _op(head) != CONNECTION:
            return
        file.seek(start)
        _connect(head, file.read(length), connections, crate)


def _connect(
    header: dict[str, bytes], data: bytes, connections: dict[int, Topic], crate: Crate
) -> None:
    """Remember a connection's topic and type."""
    number, told = _number(header, "conn"), _header(data)
    if number is None or told is None or "topic" not in header or "type" not in told:
        crate.damage["broken connection in the bag"] += 1
        return
    name = header["topic"].decode("utf-8", "replace")
    type_ = ros2_name(told["type"].decode("utf-8", "replace"))
    text = told.get("message_definition", b"").decode("utf-8", "replace")
    connections[number] = crate.topic(name, type_, "ros1", (text, "msg" if text else ""))


def _chunk(
    data: bytes, header: dict[str, bytes], connections: dict[int, Topic], crate: Crate
) -> None:
    compression = header.get("compression", b"none").decode("latin-1")
    chunk = crate.unpack(data, compression, _number(header, "size") or 0)
    if chunk is not None:
        _messages(chunk, connections, crate)


def _messages(chunk: bytes, connections: dict[int, Topic], crate: Crate) -> None:
    """Walk the records of a chunk; a message's header is taken apart in one step."""
    layout, at, last, intake = _LAYOUTS[0], 0, len(chunk) - _HEADER - 8, Intake()
    while at <= last:
        before, first, between, second, behind, size = layout.unpack(chunk, at)
        if [before, between, behind] != layout.fixed:
            found = _layout_at(chunk, at)
            layout = found or layout
            if found is None:
                at = _other(chunk, at, connections, crate)
            continue
        start = at + _HEADER + 8
        at = start + size
        number, time = (first, second) if layout.conn_first else (second, first)
        if number not in connections or at > len(chunk):
            crate.damage["message cut off or of no connection, left out"] += 1
            continue
        held = intake.held.get(number) or intake.of(number, connections[number])
        held[1].append((time & 0xFFFFFFFF) * _SECOND + (time >> 32))
        held[2].append(chunk[start:at])
    intake.close()


def _layout_at(chunk: bytes, at: int) -> _Layout | None:
    """Return the order of the fields of the message at a place, if one is there."""
    for layout in _LAYOUTS:
        before, _, between, _, behind, _ = layout.unpack(chunk, at)
        if [before, between, behind] == layout.fixed:
            return layout
    return None


def _other(chunk: bytes, at: int, connections: dict[int, Topic], crate: Crate) -> int:
    """Take in a record of a chunk that is no message, and return where the next one is."""
    start = at + 4 + _U4.unpack_from(chunk, at)[0]
    header = _header(chunk[at + 4 : start])
    if header is None or start + 4 > len(chunk):
        crate.damage["chunk broken within, its rest left out"] += 1
        return len(chunk)
    end: int = start + 4 + _U4.unpack_from(chunk, start)[0]
    if _op(header) == CONNECTION:
        _connect(header, chunk[start + 4 : end], connections, crate)
    return end
