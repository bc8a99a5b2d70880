"""Decimal numbers in lines of text as columns, each the float64 that is nearest, as ``float`` has.

[Lemire21]    D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and
              Experience 51(8), 2021. Algorithm 1.
[Mushtak23]   N. Mushtak, D. Lemire, "Fast number parsing without fallback", Software: Practice and
              Experience 53(7), 2023. Why 128 bits of a power of five always tell.

Symbols, as there: w the digits as an integer, q the exponent of ten, T the powers of five.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Mask = NDArray[np.bool_]
Flag = bool | np.bool_

TYPES = (np.float64, np.int64, np.uint64)
"""What a column may hold."""

_REAL, _SIGNED, _UNSIGNED = range(3)
_TENS = 80
"""Greatest exponent of ten, either way: more than a float32 needs, so none is subnormal."""
_NOT = 2**20
"""Exponent of what is no number."""
_THREADS = 2
_ROWS = 4096
"""Not worth a thread each."""
_POINT, _PLUS, _MINUS, _E = (ord(char) for char in ".+-e")
_COMMA, _LINE, _BLANK, _TAB, _RETURN = (ord(char) for char in ",\n \t\r")
_U0, _U1, _U3, _U7, _U8, _U9, _U10, _U16, _U32, _U52, _U56, _U63, _U64 = (
    np.uint64(bits) for bits in (0, 1, 3, 7, 8, 9, 10, 16, 32, 52, 56, 63, 64)
)
_ZEROS, _ABOVE, _TOPS = (np.uint64(byte * 0x0101010101010101) for byte in (0x30, 0x46, 0x80))
_PLACES = np.uint64(0x0001020304050607)
_PAIRS, _ODD, _EVEN = (
    np.uint64(low | high << 32) for low, high in ((255, 255), (100, 10**6), (1, 10**4))
)
_TEN_TO = 10 ** np.arange(9, dtype=np.uint64)
_FULL = np.uint64(2**64 - 1) // _TEN_TO
_LETTERS, _SMALL, _NAN_TEXT = (
    np.uint64(int.from_bytes(text, "little")) for text in (b"\xff\xff\xff", b"   ", b"nan")
)
_LOW, _CLOSE = np.uint64(2**32 - 1), np.uint64(2**9 - 1)
_NAN, _HIDDEN, _FRACTION = (np.uint64(bits) for bits in (0x7FF8 << 48, 1 << 53, (1 << 52) - 1))


def _powers() -> Words:
    """Return T: 128 bits of five to the powers from -_TENS on, high and low."""
    rows = []
    for q in range(-_TENS, _TENS + 1):
        five = 5 ** abs(q)
        z = (five - 1).bit_length()
        value = five if q >= 0 else (1 << (z + 127 if q >= -27 else 2 * z + 128)) // five + 1
        shift = value.bit_length() - 128
        value = value >> shift if shift > 0 else value << -shift
        rows.append((value >> 64, value & (2**64 - 1)))
    return np.array(rows, np.uint64)


_T = _powers()


def columns(text: Bytes, start: Ints, types: Sequence[Any]) -> tuple[list[NDArray[Any]], Mask]:
    """Read cells between commas.

    Parameters
    ----------
    text
        Eight line feeds end it.
    start
        Where the first cell of each line is, shape (n,).
    types
        Of each column, one of `TYPES`.

    Returns
    -------
    Columns of shape (n,), and the lines that are plain decimals, as many as there are columns;
    what the columns hold for others means nothing.
    """
    words = words_of(text)
    bits = np.empty((len(types), len(start)), np.uint64)
    plain = np.empty(len(start), np.bool_)
    of = np.array([TYPES.index(kind) for kind in types], np.int64)
    cuts = np.linspace(0, len(start), _THREADS + 1 if len(start) > _ROWS else 2).astype(int)
    parts = [slice(a, b) for a, b in pairwise(cuts.tolist())]
    with ThreadPoolExecutor(len(parts)) as pool:
        for done in [pool.submit(_rows, text, words, start[part], of, bits[:, part], plain[part])
                     for part in parts]:  # fmt: skip
            done.result()
    return [row.view(kind) for row, kind in zip(bits, types, strict=True)], plain


def words_of(text: Bytes) -> Words:
    """Return the eight bytes from each place on, the first one the lowest."""
    words: Words = np.ndarray((len(text) - 7,), "<u8", text, strides=(1,))
    return words


@kernel
def _rows(text: Bytes, words: Words, start: Ints, kinds: Ints, bits: Words, plain: Mask) -> None:
    """Read the lines one by one, as far as each is plain.

    All that touches an array is here: to hand one on costs as much as to read a number.
    """
    last = len(kinds) - 1
    for i in range(len(start)):
        at = np.uint64(start[i])  # of signed ones numba looks whether they count from the end
        good: Flag = True
        for j in range(last + 1):
            while _is_blank(text[at]):
                at += _U1
            sign = text[at]
            at += _is_sign(sign)
            first, point, w, count = at, _U0, _U0, _U8
            exact: Flag = True
            while count == _U8 or (text[at] == _POINT and not point):
                if count < _U8:
                    at += _U1
                    point = at
                w, count, fits = _appended(w, words[at])
                at, exact = at + count, exact and fits
            q = int(np.int64(point - at)) if point else 0
            digits, whole = at - first - np.uint64(point > _U0), not point
            if digits and text[at] | 32 == _E:
                at += _U1 + _is_sign(text[at + _U1])
                power, count, _ = _appended(_U0, words[at])
                q += -int(np.int64(power)) if text[at - _U1] == _MINUS else int(np.int64(power))
                at, exact, whole = at + count, exact and _U1 <= count <= _U3, False
            elif not digits and words[at] & _LETTERS | _SMALL == _NAN_TEXT:
                at, q, digits, whole = at + _U3, _NOT, _U3, False
            while _is_blank(text[at]):
                at += _U1
            bits[j, i], sound = _bits(w, q, kinds[j], sign == _MINUS, whole)
            ended = text[at] == (_LINE if j == last else _COMMA)
            good = ended and sound and exact and digits > _U0
            if not good:
                break
            at += _U1
        plain[i] = good


@kernel
def _is_blank(char: int) -> bool:
    return char in (_BLANK, _TAB, _RETURN)


@kernel
def _is_sign(char: int) -> np.uint64:
    return np.uint64(char in (_MINUS, _PLUS))


@kernel
def _appended(w: np.uint64, word: np.uint64) -> tuple[np.uint64, np.uint64, Flag]:
    """Append the digits that begin eight bytes to w: how many, and whether 64 bits hold them."""
    digits = word - _ZEROS
    other = ((word + _ABOVE) | digits) & _TOPS  # marks the first byte that is no digit
    if other:
        count = (((other & (~other + _U1)) >> _U7) * _PLACES) >> _U56
        if not count:
            return w, _U0, True
        digits <<= _U64 - (count << _U3)
    else:
        count = _U8
    pairs = digits * _U10 + (digits >> _U8)
    value = ((pairs & _PAIRS) * _ODD + ((pairs >> _U16) & _PAIRS) * _EVEN) >> _U32
    return w * _TEN_TO[count] + value, count, w < _FULL[count]


@kernel
def _bits(w: np.uint64, q: int, kind: int, negative: bool, whole: bool) -> tuple[np.uint64, Flag]:
    """Return a number as its column holds it, and whether it does."""
    if kind == _REAL:
        if q == _NOT:
            return _NAN, True
        value = _float(w, q) if abs(q) <= _TENS else _U0
        return value | _U1 << _U63 if negative else value, abs(q) <= _TENS
    if negative:
        return _U0 - w, whole and kind == _SIGNED and w <= _U1 << _U63
    return w, whole and (kind == _UNSIGNED or w < _U1 << _U63)


@kernel
def _float(w: np.uint64, q: int) -> np.uint64:
    """Return the bits of the float64 nearest to w * 10**q, of ties the even one [Lemire21]."""
    if w == _U0:
        return _U0
    zeros = _leading_zeros(w)
    w <<= zeros
    high, low = _product(w, _T[q + _TENS, 0])
    if high & _CLOSE == _CLOSE:  # more bits of the power may carry
        carry = _product(w, _T[q + _TENS, 1])[0]
        low += carry
        if low < carry:
            high += _U1
    upper = high >> _U63
    m = high >> (upper + _U9)
    exact = m << (upper + _U9) == high
    if low <= _U1 and -4 <= q <= 23 and m & _U3 == _U1 and exact:
        m -= _U1  # half way: to the even one
    m = (m + (m & _U1)) >> _U1
    exponent = np.uint64(((217706 * q) >> 16) + 63 + 1023) + upper - zeros
    if m >= _HIDDEN:
        m, exponent = m >> _U1, exponent + _U1
    return (exponent << _U52) | (m & _FRACTION)


@kernel
def _leading_zeros(w: np.uint64) -> np.uint64:
    zeros = _U0
    for step in (32, 16, 8, 4, 2, 1):  # without a branch, which would be guessed wrong
        more = np.uint64(w >> np.uint64(64 - step) == _U0) * np.uint64(step)
        w <<= more
        zeros += more
    return zeros


@kernel
def _product(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return the high and low halves of the 128 bits of a product."""
    a1, a0, b1, b0 = a >> _U32, a & _LOW, b >> _U32, b & _LOW
    cross = a1 * b0 + ((a0 * b0) >> _U32)
    middle = a0 * b1 + (cross & _LOW)
    return a1 * b1 + (cross >> _U32) + (middle >> _U32), a * b
