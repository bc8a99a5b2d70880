"""Messages of a binary DataFlash log, found already, as columns of numbers."""

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.readers.dataflash_format import DIVISORS, Format, Ints, Table

Bytes = NDArray[np.uint8]


def rows(data: Bytes, at: Ints, length: int) -> NDArray[np.void]:
    """Take so many bytes from each place."""
    shape = (max(0, len(data) - length + 1),)
    every: NDArray[np.void] = np.ndarray(shape, f"V{length}", data, strides=(1,))
    return every[at]


def tables(
    data: Bytes, named: list[tuple[Format, Ints]], wanted: Collection[str]
) -> tuple[dict[str, Table], dict[str, Format], tuple[str, ...]]:
    """Decode; a name with several formats keeps the columns that all of them have.

    Parameters
    ----------
    named
        Formats, and the places of their messages.

    Returns
    -------
    Tables and the last formats by name, and the names whose format does not fit its length.
    """
    parts: dict[str, list[Table]] = {}
    formats, odd = {}, []
    for form, at in named:
        if form.name not in wanted:
            continue
        if form.dtype is None:
            odd.append(form.name)
            continue
        formats[form.name] = form
        parts.setdefault(form.name, []).append(_decode(data, at, form, form.dtype))
    return {name: _joined(found) for name, found in parts.items()}, formats, tuple(odd)


def _decode(data: Bytes, at: Ints, form: Format, dtype: np.dtype[np.void]) -> Table:
    raw = rows(data, at, form.length).view(dtype)
    columns: dict[str, NDArray[Any]] = {}
    for name, char in zip(form.columns, form.chars, strict=False):
        column = np.ascontiguousarray(raw[name])
        columns[name] = column / DIVISORS[char] if char in DIVISORS else column
    return Table(at, columns)


def _joined(parts: list[Table]) -> Table:
    if len(parts) == 1:
        return parts[0]
    order = np.argsort(np.concatenate([part.at for part in parts]), kind="stable")
    columns = {}
    for name in parts[0].columns:
        values = [part.columns[name] for part in parts if name in part.columns]
        if (
            len(values) == len(parts)
            and len({(value.dtype.kind == "S", value.ndim) for value in values}) == 1
        ):
            columns[name] = np.concatenate(values)[order]
    return Table(np.concatenate([part.at for part in parts])[order], columns)
