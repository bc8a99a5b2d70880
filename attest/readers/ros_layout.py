"""Where each field of a message lies, found by walking one message by its definition.

Messages whose strings and sequences are as long as another's have their fields at the same places:
one walk then serves them all. Nothing is compiled from a definition, so it can run nothing.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

from attest.readers.ros_types import PX4, Definitions

LARGEST_DEFINITION = 1 << 18
"""Characters; the longest in use is a tenth of this."""
MOST_FIELDS = 20_000
"""In one message; there are as many steps to a walk."""
_ZEROS = bytes(4096)
DEEPEST = 20
"""Types within types."""
_PARSE_ERRORS = (TypesysError, ValueError, LookupError, TypeError, AttributeError, RecursionError,
                 AssertionError)  # fmt: skip

FORMATS = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip


class LayoutError(Exception):
    """A message that is not as its definition says."""


@dataclass(frozen=True, slots=True)
class Place:
    """Some numbers, or the bytes of a string, within a message."""

    format: str
    """As numpy spells it."""
    offset: int
    count: int
    """Of numbers, or of bytes."""


@dataclass(slots=True, eq=False)
class Layout:
    """Where everything lies in messages of one form."""

    order: str
    """Of bytes: ``<`` or ``>``."""
    aligned: bool
    places: dict[str, Place] = field(default_factory=dict)
    """By path, such as ``header.stamp.sec`` or ``transforms.0.child_frame_id``."""
    blocks: dict[str, tuple[int, Mapping[str, Place]]] = field(default_factory=dict)
    """Structures of fixed size by path: where each begins, and what lies where from there."""
    lengths: dict[str, int] = field(default_factory=dict)
    """How many items each sequence has."""
    fixed: list[tuple[int, int]] = field(default_factory=list)
    """Places and values of the lengths, which are the same in all messages of the form."""

    def find(self, path: str) -> Place | None:
        """Return where a field lies; None where the messages have no such numbers or text."""
        if path in self.places:
            return self.places[path]
        outer = path
        while outer:
            outer = outer.rpartition(".")[0]
            if outer in self.blocks:
                start, places = self.blocks[outer]
                inner = places.get(path[len(outer) + 1 :])
                return inner and Place(inner.format, start + inner.offset, inner.count)
        return None


_TIMES = get_types_from_msg("int32 sec\nuint32 nanosec\n", "builtin_interfaces/msg/Time") | (
    get_types_from_msg("int32 sec\nuint32 nanosec\n", "builtin_interfaces/msg/Duration")
)
"""ROS 1's ``time`` and ``duration``, which no definition holds."""


@lru_cache(maxsize=64)
def parse(type_: str, text: str, form: str) -> Definitions | None:
    """Parse a definition, or take the usual one where the file has none; None if there is none."""
    if not text:
        return _known(type_)
    if len(text) > LARGEST_DEFINITION:
        return None
    try:
        if form == "msg":
            return _TIMES | get_types_from_msg(text, type_)
        types: dict[str, Any] = {}
        for part in text.split("=" * 80 + "\n"):
            types |= get_types_from_idl(part.split("\n", 1)[1] if part[:5] == "IDL: " else part)
    except _PARSE_ERRORS:
        return None
    return types


def _known(type_: str) -> Definitions | None:
    from rosbags.typesys.stores.ros2_humble import FIELDDEFS

    if type_ in PX4:
        return get_types_from_msg(PX4[type_], type_)
    return FIELDDEFS if type_ in FIELDDEFS else None


Blocks = dict[tuple[str, int, str, bool], tuple[Mapping[str, Place], int] | None]
"""Structures of fixed size by type, place within eight bytes, and encoding; None for others."""


def walk(
    message: bytes, types: Definitions, type_: str, encoding: str, prefix: bool, blocks: Blocks
) -> Layout:
    """Find every field of a message.

    Parameters
    ----------
    prefix
        Whether more may follow that the definition does not know.
    blocks
        What is known of structures already, and added to.

    Raises
    ------
    LayoutError
        The message is not as its definition says.
    """
    cdr = encoding == "cdr"
    if cdr and (len(message) < 4 or message[:2] not in {b"\0\0", b"\0\1"}):
        raise LayoutError("no plain CDR")
    layout = Layout("<" if not cdr or message[1] else ">", cdr)
    walker = _Walker(message, types, layout, 4 if cdr else 0, blocks)
    walker.structure(type_, "", 0)
    spare = len(message) - walker.at
    if spare < 0 or (spare > (3 if cdr else 0) and not prefix):
        raise LayoutError("another size than the definition's")
    return layout


class _Walker:
    """A place in a message, on its way through the definition."""

    def __init__(
        self,
        message: bytes,
        types: Definitions,
        layout: Layout,
        start: int,
        blocks: Blocks | None = None,
    ) -> None:
        self.message, self.types, self.layout, self.blocks = message, types, layout, blocks
        self.at = self.start = start

    def structure(self, type_: str, path: str, depth: int) -> None:
        """Walk the fields of a type, or step over it where it has a fixed size."""
        block = self.block(type_) if depth else None
        if block is not None:
            self.count()
            self.layout.blocks[path] = self.at, block[0]
            self.skip(block[1])
            return
        if type_ not in self.types or depth > DEEPEST:
            raise LayoutError(f"{type_} is not defined")
        for name, (kind, what) in self.types[type_][1]:
            inner = f"{path}.{name}" if path else name
            if kind == Nodetype.ARRAY:
                self.items(what[0], what[1], inner, depth)
            elif kind == Nodetype.SEQUENCE:
                self.layout.lengths[inner] = count = self.length()
                self.items(what[0], count, inner, depth)
            else:
                self.one((kind, what), inner, depth)

    def one(self, item: tuple[Nodetype, Any], path: str, depth: int) -> None:
        """Walk a number, a string or a type."""
        kind, what = item
        if kind == Nodetype.NAME:
            self.structure(what, path, depth + 1)
        elif what[0] == "string":
            count = self.length()
            shown = count - 1 if self.layout.aligned else count
            if shown < 0:
                raise LayoutError("a string without an end")
            self.place(path, f"S{shown}" if shown else "S1", shown)
            self.skip(count)
        else:
            self.numbers(what[0], 1, path)

    def items(self, item: tuple[Nodetype, Any], count: int, path: str, depth: int) -> None:
        """Walk an array or a sequence."""
        kind, what = item
        if kind == Nodetype.BASE and what[0] != "string":
            self.numbers(what[0], count, path)
            return
        for i in range(count):
            before = self.at
            self.one(item, f"{path}.{i}", depth)
            if self.at == before:
                raise LayoutError("items of no size")

    def numbers(self, name: str, count: int, path: str) -> None:
        """Note a place of numbers, and go behind them."""
        form = FORMATS.get(name)
        if form is None:
            raise LayoutError(f"{name} is not known")
        size = int(form[1])
        if count:
            self.align(size)
        self.place(path, self.layout.order + form, count)
        self.skip(count * size)

    def length(self) -> int:
        """Read the length of a string or a sequence."""
        self.align(4)
        at = self.at
        self.skip(4)
        order = "little" if self.layout.order == "<" else "big"
        value = int.from_bytes(self.message[at : self.at], order)  # type: ignore[arg-type]
        self.layout.fixed.append((at, value))
        return value

    def block(self, type_: str) -> tuple[Mapping[str, Place], int] | None:
        """Return what lies where in a type of fixed size, found by walking zeros."""
        if self.blocks is None:
            return None
        phase = (self.at - self.start) % 8
        key = (type_, phase, self.layout.order, self.layout.aligned)
        if key not in self.blocks:
            layout = Layout(self.layout.order, self.layout.aligned)
            walker = _Walker(_ZEROS, self.types, layout, 0)
            walker.at = phase
            with suppress(LayoutError):
                walker.structure(type_, "", 1)
                places = {path: replace(p, offset=p.offset - phase)
                          for path, p in layout.places.items()}  # fmt: skip
                self.blocks[key] = (places, walker.at - phase)
            if layout.fixed:
                self.blocks[key] = None
        return self.blocks.setdefault(key, None)

    def count(self) -> None:
        """Refuse a message of too many fields."""
        if len(self.layout.places) + len(self.layout.blocks) >= MOST_FIELDS:
            raise LayoutError("too many fields")

    def place(self, path: str, form: str, count: int) -> None:
        """Note where a field lies."""
        self.count()
        self.layout.places[path] = Place(form, self.at, count)

    def align(self, size: int) -> None:
        """Go to the next multiple of a size, as CDR has it."""
        if self.layout.aligned:
            self.at += -(self.at - self.start) % size

    def skip(self, size: int) -> None:
        """Go on, never beyond the end."""
        self.at += size
        if self.at > len(self.message):
            raise LayoutError("cut off")
