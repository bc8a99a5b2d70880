"""Messages as they come out of a ROS container: by topic, still encoded, within bounds."""

import bz2
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import lz4.frame
import numpy as np
import zstandard

from attest.readers.ros_types import is_wanted

Encoding = Literal["ros1", "cdr", "other"]

ZSTD = b"\x28\xb5\x2f\xfd"
LARGEST_CLOUD = 1 << 16
"""Bytes; a larger cloud of points is a scan, and holds no feature points."""
BLOCK = 16 << 20
"""Bytes of messages that are held before they are decoded: the numbers take less room, and a
processor's cache has room for them."""
UNPACK_ERRORS = (OSError, ValueError, EOFError, RuntimeError, zstandard.ZstdError)
"""What bz2, lz4 and zstd raise over bytes that are not theirs."""
_MEGABYTE = 1 << 20
CHUNK, ROOM, EFFORT = (1, 64 * _MEGABYTE), (6, 96 * _MEGABYTE), (250, 256 * _MEGABYTE)
"""What one chunk, all numbers, and all that is unpacked may take: so many times the file's size,
and so many bytes more."""


@dataclass(slots=True, eq=False)
class Topic:
    """The messages of one topic and type, in the order of the container."""

    name: str
    type: str
    """As ROS 2 spells it: ``sensor_msgs/msg/Imu``."""
    encoding: Encoding
    definition: str
    form: str
    """Of the definition: ``msg``, ``idl``, or empty where the file has none."""
    seen: int = 0
    """Messages in the container, kept or not."""
    too_large: int = 0
    data: bytearray = field(default_factory=bytearray)
    ends: "array[int]" = field(default_factory=lambda: array("q"))
    """Where each message ends in the data."""
    record: "array[int]" = field(default_factory=lambda: array("q"))
    """When each was recorded, ns since 1970."""

    wanted: bool = field(init=False)
    """Whether some signal can be had from such messages."""

    def __post_init__(self) -> None:
        self.wanted = self.encoding != "other" and is_wanted(self.type)

    def extend(self, stamps: Sequence[int], messages: Sequence[bytes]) -> None:
        """Keep some messages."""
        if self.type == "sensor_msgs/msg/PointCloud2":
            small = [i for i, message in enumerate(messages) if len(message) <= LARGEST_CLOUD]
            self.too_large += len(messages) - len(small)
            stamps, messages = [stamps[i] for i in small], [messages[i] for i in small]
        sizes = np.fromiter(map(len, messages), np.int64, len(messages))
        self.ends.frombytes((len(self.data) + np.cumsum(sizes)).tobytes())
        self.data += b"".join(messages)
        self.record.extend(stamps)

    def clear(self) -> None:
        """Drop the messages."""
        self.data, self.ends, self.record = bytearray(), array("q"), array("q")


class Intake:
    """The messages of one chunk, handed to their topics at its end: at once is quicker."""

    def __init__(self) -> None:
        self.held: dict[int, tuple[Topic, list[int], list[bytes]]] = {}

    def of(self, number: int, topic: Topic) -> tuple[Topic, list[int], list[bytes]]:
        """Return the lists to which a connection's stamps and messages are appended."""
        return self.held.setdefault(number, (topic, [], []))

    def close(self) -> None:
        """Hand the messages to their topics, which count those that nobody wants."""
        for topic, stamps, messages in self.held.values():
            topic.seen += len(stamps)
            if topic.wanted:
                topic.extend(stamps, messages)
        self.held.clear()


class Crate:
    """The topics of one log, and what its bytes may grow to.

    A few bytes of bz2, lz4 or zstd can stand for gigabytes, so what is kept is bounded by the
    file's size, and what is unpacked on the way too.
    """

    def __init__(self, size: int, settle: Callable[[Iterable[Topic]], int]) -> None:
        self.topics: dict[tuple[str, ...], Topic] = {}
        self.damage: Counter[str] = Counter()
        """What could not be read, counted."""
        self.settle = settle
        """Decodes what topics hold so far, drops it, and returns the bytes that stay."""
        self.settled = 0
        self.largest_chunk, self.room, self.effort = (
            times * size + more for times, more in (CHUNK, ROOM, EFFORT)
        )

    def topic(
        self, name: str, type_: str, encoding: Encoding, definition: tuple[str, str]
    ) -> Topic:
        """Return the topic of a connection; those that differ in nothing are one."""
        text, form = definition
        key = (name, type_, encoding, text)
        return self.topics.setdefault(key, Topic(name, type_, encoding, text, form))

    def has_room(self) -> bool:
        """Whether more may be taken in, once what is held is decoded; noted where not."""
        if sum(len(topic.data) for topic in self.topics.values()) > BLOCK:
            self.settled += self.settle(self.topics.values())
        if self.effort > 0 and self.settled <= self.room:
            return True
        self.damage["log that unpacks to far more than its size, read in part"] = 1
        return False

    def close(self) -> None:
        """Decode what is left."""
        self.settled += self.settle(self.topics.values())

    def unpack(self, data: bytes, compression: str, limit: int) -> bytes | None:
        """Return a chunk in plain; None, and a count, where it is broken or too large."""
        limit = min(limit, self.largest_chunk, max(self.effort, 0))
        try:
            plain = _decompress(data, compression, limit + 1)
        except UNPACK_ERRORS:
            self.damage["chunk that does not unpack, left out"] += 1
            return None
        if plain is None:
            self.damage[f"chunk in unknown compression {compression[:20]!r}, left out"] += 1
            return None
        self.effort -= len(plain)
        if len(plain) < limit and compression not in {"", "none"}:
            self.damage["chunk shorter than it says, read as far as it goes"] += 1
        if len(plain) > limit:
            self.damage["chunk larger than it says, left out"] += 1
            return None
        return plain


def _decompress(data: bytes, compression: str, limit: int) -> bytes | None:
    """Return at most so many bytes."""
    if compression in {"", "none"}:
        return data
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data, limit)
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, limit))
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            return _all_of(reader, limit)
    return None


def _all_of(reader: zstandard.ZstdDecompressionReader, limit: int) -> bytes:
    """Read by pieces, for a reader takes the memory that it is asked for."""
    pieces, left = [], limit
    while left > 0 and (piece := reader.read(min(left, _MEGABYTE))):
        pieces.append(piece)
        left -= len(piece)
    return b"".join(pieces)
