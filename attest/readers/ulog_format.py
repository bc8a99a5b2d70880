"""What a ULog says about its own messages: formats, and which number stands for which topic."""

import re
from collections.abc import Collection
from dataclasses import dataclass, field

TYPES = {"int8_t": "i1", "uint8_t": "u1", "bool": "i1", "char": "i1", "int16_t": "<i2",
         "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4", "float": "<f4", "int64_t": "<i8",
         "uint64_t": "<u8", "double": "<f8"}  # fmt: skip
"""The plain types in memory, whose last digit is their size."""
MOST_FIELDS = 2_000
"""Of one topic; the largest of PX4 has some hundred."""
BUDGET = 200_000
"""Fields of all subscriptions together: what the library keeps for each is not small."""
DEEPEST = 8
"""Formats within formats."""
MOST_PADDING = 64
"""Bytes at the end that need not be logged; PX4 has up to seven."""
LONGEST = (1 << 16) - 1 - 2
"""Bytes of data in one message."""
INFO = {"sys_name": "char", "sys_uuid": "char", "ver_hw": "char", "ver_sw_release": "uint32_t"}
"""What tells the vehicle, and its type."""

_FIELD = re.compile(r"([A-Za-z0-9_]{1,255})(?:\[(\d{1,5})\])? ([A-Za-z0-9_]{1,255})")
_NAME = re.compile(r"[A-Za-z0-9_]{1,255}")
_INFO = re.compile(rb"(char)\[\d{1,5}\] ([a-z_]{1,99})|(uint32_t) ([a-z_]{1,99})")

Fields = list[tuple[str, int, str]]
"""Type, length of an array or 0, and name."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A format with all that is within it."""

    size: int
    padding: int = 0
    """Bytes at the end that need not be logged."""
    fields: int = 1
    timed: bool = False
    """Whether there is a time, and every name is its own."""


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All that a log has told about itself so far."""

    formats: dict[str, tuple[bytes, Fields]] = field(default_factory=dict)
    """Message and fields by name."""
    topics: dict[str, Topic | None] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    """Topics by message id."""
    sized: set[int] = field(default_factory=set)
    """Message ids whose size is known."""
    fits: dict[int, bool] = field(default_factory=dict)
    """Sizes that data may have, with the id's two bytes, above the message id's 16 bits."""
    subscribed: dict[int, bytes] = field(default_factory=dict)
    """Messages that subscribe, of what can be read."""
    info: dict[str, bytes] = field(default_factory=dict)
    refused: set[str] = field(default_factory=set)
    """Topics that cannot be read as they are described."""


def define(catalogue: Catalogue, message: bytes) -> None:
    """Learn a format; what is none is left out, and so is a second one of a name."""
    name, colon, rest = message.decode("latin-1").rstrip("\0").partition(":")
    parts = [_FIELD.fullmatch(part) for part in rest.split(";") if part]
    if colon and _NAME.fullmatch(name) and name not in catalogue.formats and all(parts):
        fields = [(m[1], int(m[2] or 0), m[3]) for m in parts if m is not None]
        catalogue.formats[name] = (f"{name}:{rest}".encode(), fields)


def inform(catalogue: Catalogue, message: bytes) -> None:
    """Keep what tells the vehicle, if its type is right."""
    end = 1 + message[0]
    key = _INFO.fullmatch(message[1:end])
    if key is None:
        return
    kind, name = (key[1] or key[3]).decode(), (key[2] or key[4]).decode()
    fits = kind == "char" or len(message) == end + int(TYPES[kind][-1])
    if INFO.get(name) == kind and fits:
        catalogue.info.setdefault(name, message)


def subscribe(catalogue: Catalogue, message: bytes, wanted: Collection[str]) -> None:
    """Learn which topic a message id stands for; the first word on it counts."""
    number = int.from_bytes(message[1:3], "little")
    name = message[3:].decode("latin-1").rstrip("\0")
    if number in catalogue.names or name not in catalogue.formats:
        return
    catalogue.names[number] = name
    topic = topic_of(catalogue, name)
    if topic is None or topic.padding > MOST_PADDING:
        catalogue.refused.add(name)
        return
    catalogue.sized.add(number)
    for size in range(2 + topic.size - topic.padding, 3 + topic.size):
        catalogue.fits[size << 16 | number] = True
    if name not in wanted:
        return
    spent = sum(_fields(catalogue, catalogue.names[other]) for other in catalogue.subscribed)
    if topic.timed and topic.fields <= MOST_FIELDS and spent + topic.fields <= BUDGET:
        catalogue.subscribed[number] = message[:3] + name.encode()
    else:
        catalogue.refused.add(name)


def topic_of(catalogue: Catalogue, name: str) -> Topic | None:
    """Sum up a format and those within; None where it cannot be one message."""
    return _topic(catalogue, name, DEEPEST)


def needed(catalogue: Catalogue) -> list[bytes]:
    """Return the formats that the subscriptions need, in the order of the log."""
    todo = {catalogue.names[number] for number in catalogue.subscribed}
    found: set[str] = set()
    while todo:
        found |= todo
        within = {kind for name in todo for kind, *_ in catalogue.formats[name][1]}
        todo = within - TYPES.keys() - found
    return [message for name, (message, _) in catalogue.formats.items() if name in found]


def _topic(catalogue: Catalogue, name: str, deeper: int) -> Topic | None:
    if name in TYPES:
        return Topic(int(TYPES[name][-1]))
    if name in catalogue.topics:
        return catalogue.topics[name]
    if not deeper or name not in catalogue.formats:
        return None
    size = padding = count = 0
    fields = catalogue.formats[name][1]
    for kind, times, called in fields:
        inner = _topic(catalogue, kind, deeper - 1)
        if inner is None or size + inner.size * max(times, 1) > LONGEST:
            catalogue.topics[name] = None
            return None
        bulk = inner.size * max(times, 1)
        size, count = size + bulk, count + inner.fields * max(times, 1)
        padding = padding + bulk if called.startswith("_padding") else 0
    names = [called for *_, called in fields]
    timed = len(set(names)) == len(names) and ("uint64_t", 0, "timestamp") in fields
    catalogue.topics[name] = Topic(size, padding, count, timed)
    return catalogue.topics[name]


def _fields(catalogue: Catalogue, name: str) -> int:
    topic = catalogue.topics[name]
    return topic.fields if topic is not None else 0
