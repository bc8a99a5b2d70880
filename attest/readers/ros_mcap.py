"""MCAP with messages of ROS 1 or ROS 2, read from front to back, so that a cut one reads too."""

import struct
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

from attest.readers.ros_topics import Crate, Encoding, Intake, Topic
from attest.readers.ros_types import ros2_name

MAGIC = b"\x89MCAP0\r\n"

_ENCODINGS: dict[str, Encoding] = {"ros1": "ros1", "cdr": "cdr"}
_FORMS = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl", "omgidl": "idl"}
_BROKEN = (McapError, struct.error, ValueError, LookupError, OverflowError)
"""What the library raises over a record that is cut or broken."""
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")
_KINDS: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.CHUNK: Chunk}
_NO_OPCODE = 0
"""By the format's definition: what begins so is no record."""
_LATEST = 1 << 63
"""Stamps from here on are no time."""


class _Mcap:
    """What the records of a file have told so far."""

    def __init__(self, crate: Crate) -> None:
        self.crate, self.intake = crate, Intake()
        self.schemas: dict[int, Schema] = {}
        self.topics: dict[int, Topic] = {}

    def declare(self, record: Any) -> None:
        """Take in a schema or a channel."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        else:
            self.intake.close()
            self.intake = Intake()
            self.topics[record.id] = _topic(record, self.schemas, self.crate)


def read(path: Path, crate: Crate) -> None:
    """Take the messages of a file into the crate."""
    mcap = _Mcap(crate)
    with path.open("rb") as file:
        try:
            ended = _read_all(file, path.stat().st_size, mcap)
        except _BROKEN:
            ended = False
    mcap.intake.close()
    if not ended:
        text = "MCAP that is cut, broken or was not closed: read as far as it goes"
        crate.damage[text] = 1


def _read_all(file: BinaryIO, size: int, mcap: _Mcap) -> bool:
    """Take in every record; False where the file ends before its data do."""
    at = len(MAGIC)
    while at + _RECORD.size <= size:
        file.seek(at)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        if opcode == Opcode.DATA_END:
            return True
        if opcode == _NO_OPCODE:
            return False
        if opcode in _KINDS:
            record = _parsed(opcode, file.read(min(length, size)))
            if not isinstance(record, Chunk):
                mcap.declare(record)
            elif not mcap.crate.has_room():
                return True
            else:
                _chunk(record, mcap)
        elif opcode == Opcode.MESSAGE:
            file.seek(at)
            _walk(file.read(min(_RECORD.size + length, size)), mcap)
        at += _RECORD.size + length
    return False


def _parsed(opcode: int, data: bytes) -> Any:
    """Let the library take a record apart."""
    return _KINDS[opcode].read(ReadDataStream(BytesIO(data)))


def _topic(channel: Channel, schemas: dict[int, Schema], crate: Crate) -> Topic:
    schema = schemas.get(channel.schema_id)
    encoding = _ENCODINGS.get(channel.message_encoding, "other")
    if schema is None:
        return crate.topic(channel.topic, "", "other", ("", ""))
    form = _FORMS.get(schema.encoding, "")
    text = schema.data.decode("utf-8", "replace") if form else ""
    type_ = ros2_name(schema.name)
    return crate.topic(channel.topic, type_, encoding, (text, form if text else ""))


def _chunk(chunk: Chunk, mcap: _Mcap) -> None:
    data = mcap.crate.unpack(chunk.data, chunk.compression, chunk.uncompressed_size)
    if data is None:
        return
    whole = len(data) >= chunk.uncompressed_size
    if whole and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        mcap.crate.damage["chunk with a wrong checksum, left out"] += 1
        return
    try:
        _walk(data, mcap)
    except _BROKEN:
        mcap.crate.damage["chunk broken within, its rest left out"] += 1
    mcap.intake.close()


def _walk(data: bytes, mcap: _Mcap) -> None:
    """Take in the records of a chunk; a message's head is taken apart in one step."""
    at, size, take, held = 0, len(data), _MESSAGE.unpack_from, mcap.intake.held
    last = size - _MESSAGE.size
    while at <= last:
        opcode, length, channel, _, stamp, _ = take(data, at)
        start, at = at, at + _RECORD.size + length
        if at > size or opcode == _NO_OPCODE:
            break
        if opcode == Opcode.MESSAGE:
            lists = held.get(channel) or _lists(channel, mcap)
            if lists is not None and stamp < _LATEST:
                lists[1].append(stamp)
                lists[2].append(data[start + _MESSAGE.size : at])
        elif opcode in _KINDS:
            mcap.declare(_parsed(opcode, data[start + _RECORD.size : at]))
            held = mcap.intake.held
    if at != size:
        raise ValueError("a record that is none, or longer than its chunk")


def _lists(channel: int, mcap: _Mcap) -> tuple[Topic, list[int], list[bytes]] | None:
    """Return where the messages of a channel are gathered; None, and a count, where it is none."""
    topic = mcap.topics.get(channel)
    if topic is None:
        mcap.crate.damage["message of no channel, left out"] += 1
        return None
    return mcap.intake.of(channel, topic)
