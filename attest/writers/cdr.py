"""CDR, the encoding of ROS 2 messages, as rows of numpy structured arrays.

A number is aligned to its own size, counted from behind the four bytes that name the encoding; a
string is its length with the closing zero, then its bytes; a sequence is its length, then its
items. Within one topic of ours every string and sequence keeps its length, so a message is a row of
fixed size and a thousand messages are one assignment per field.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ENCAPSULATION = b"\x00\x01\x00\x00"
"""Plain CDR, little-endian."""


@dataclass(frozen=True, slots=True)
class Field:
    """Some numbers, or bytes, that stand at the same place in every message of a topic."""

    name: str
    format: str
    """As numpy spells it, such as ``<f8``, or ``S6`` for bytes."""
    shape: tuple[int, ...] = ()
    value: object = None
    """What stands there unless a row says otherwise; None for zero."""


def text(name: str, value: str) -> tuple[Field, ...]:
    """Lay out a string that is the same in every message."""
    content = value.encode("utf-8", "replace") + b"\x00"
    return (
        Field(f"{name}.size", "<u4", value=len(content)),
        Field(name, f"S{len(content)}", value=content),
    )


def texts(name: str, values: Sequence[str]) -> tuple[Field, ...]:
    """Lay out a sequence of strings that is the same in every message."""
    items = [field for i, value in enumerate(values) for field in text(f"{name}.{i}", value)]
    return (Field(f"{name}.count", "<u4", value=len(values)), *items)


def sequence(name: str, form: str, count: int) -> tuple[Field, ...]:
    """Lay out a sequence of numbers that has the same length in every message."""
    items = (Field(name, form, (count,)),) if count else ()
    return (Field(f"{name}.count", "<u4", value=count), *items)


def row(fields: Sequence[Field], before: Sequence[Field] = ()) -> NDArray[np.void]:
    """Lay out one message behind some packed fields, with every constant in its place."""
    packed = [*before, Field("encapsulation", f"V{len(ENCAPSULATION)}", value=ENCAPSULATION)]
    sizes = [_size(field) for field in packed]
    start = sum(sizes)
    offsets = [sum(sizes[:i]) for i in range(len(sizes))] + _aligned(fields, start)
    every = [*packed, *fields]
    form = np.dtype(
        {
            "names": [field.name for field in every],
            "formats": [(field.format, field.shape) for field in every],
            "offsets": offsets,
            "itemsize": offsets[-1] + _size(every[-1]),
        }
    )
    one = np.zeros(1, form)
    for field in every:
        if field.value is not None:
            one[field.name] = field.value
    return one


def repeat(one: NDArray[np.void], count: int) -> NDArray[np.void]:
    """Copy a row, padding included, so that equal messages are equal bytes."""
    return np.frombuffer(bytearray(one.tobytes()) * count, one.dtype)


def _aligned(fields: Sequence[Field], start: int) -> list[int]:
    offsets, end = [], 0
    for field in fields:
        align = 1 if field.format.startswith("S") else np.dtype(field.format).itemsize
        end += -end % align
        offsets.append(start + end)
        end += _size(field)
    return offsets


def _size(field: Field) -> int:
    return np.dtype((field.format, field.shape)).itemsize
