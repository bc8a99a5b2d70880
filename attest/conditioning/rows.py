"""What is asked of every row of an (n, 3) array, without arrays between."""

from itertools import accumulate, pairwise
from math import prod, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]


def together(*shapes: tuple[int, ...]) -> list[Array]:
    """Return arrays of these shapes, of one piece of memory.

    What is large comes in large pages, and is kept for the next log: a page costs the system
    microseconds, as much as it takes to fill it.
    """
    ends = [0, *accumulate(prod(shape) for shape in shapes)]
    memory = np.empty(ends[-1])
    return [memory[a:b].reshape(its) for (a, b), its in zip(pairwise(ends), shapes, strict=True)]


def largest(y: Array) -> Array:
    """Return the largest of the magnitudes in each row of (n, 3), NaN where one is not finite."""
    if y.ndim != 2 or y.shape[1] != 3:
        return np.asarray(np.abs(y).max(axis=1))
    out = np.empty(len(y))
    _largest(np.ascontiguousarray(y, np.float64), out)
    return out


@kernel
def _largest(y: Array, out: Array) -> None:
    for i in range(len(y)):
        a, b, c = abs(y[i, 0]), abs(y[i, 1]), abs(y[i, 2])
        out[i] = max(a, b, c) + 0.0 * (a + b + c)


def count_between(y: Array, least: float, most: float) -> int:
    """Count the rows of (n, 3) whose largest magnitude is between two."""
    if y.ndim != 2 or y.shape[1] != 3:
        size = largest(y)
        return int(np.count_nonzero((size > least) & (size < most)))
    return int(_count_between(np.ascontiguousarray(y, np.float64), least, most))


@kernel
def _count_between(y: Array, least: float, most: float) -> int:
    count = 0
    for i in range(len(y)):
        a, b, c = abs(y[i, 0]), abs(y[i, 1]), abs(y[i, 2])
        size = max(a, b, c) + 0.0 * (a + b + c)
        count += least < size < most
    return count


@kernel
def shortest_and_longest(t: Stamps) -> tuple[int, int]:
    """Return the least and the greatest time between neighbouring stamps, two at the least."""
    shortest = longest = t[1] - t[0]
    for i in range(1, len(t)):
        step = t[i] - t[i - 1]
        shortest, longest = min(shortest, step), max(longest, step)
    return shortest, longest


@kernel
def split(v: Array, unit: Array, length: Array) -> None:
    """Fill the unit vectors (n, 3) and the lengths (n,) of vectors; zero stays zero."""
    for i in range(len(v)):
        length[i] = sqrt(v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
        r = 1.0 / length[i] if length[i] > 0.0 else 1.0
        unit[i, 0], unit[i, 1], unit[i, 2] = r * v[i, 0], r * v[i, 1], r * v[i, 2]


@kernel
def place(out: Array, k: int, v: Array) -> None:
    """Fill out[:, k], of an array of shape (n, j, 3), with vectors (n, 3), or (1, 3) for all."""
    for i in range(len(out)):
        row = i if len(v) > 1 else 0
        out[i, k, 0], out[i, k, 1], out[i, k, 2] = v[row, 0], v[row, 1], v[row, 2]


def first_of_cells(t: Stamps, spacing: int) -> NDArray[np.intp]:
    """Return the first sample of each cell of time that has one, nanoseconds, t rising."""
    first = np.empty(min(len(t), 1 + int((t[-1] - t[0]) // spacing)), np.intp)
    return first[: _first_of_cells(t, spacing, first)]


@kernel
def _first_of_cells(t: Stamps, spacing: int, first: NDArray[np.intp]) -> int:
    """Fill the first samples of cells; return how many."""
    count, end = 0, t[0]
    for i in range(len(t)):
        if t[i] >= end:
            first[count] = i
            count += 1
            end = t[0] + ((t[i] - t[0]) // spacing + 1) * spacing
    return count


@kernel
def since(t: Stamps, restart: NDArray[np.bool_], h: Array) -> None:
    """Fill h (n,) with the time from the stamp before, s, zero at a restart."""
    for i in range(len(t)):
        h[i] = 0.0 if i == 0 or restart[i] else 1e-9 * (t[i] - t[i - 1])


def times_since(t: Stamps, restart: NDArray[np.bool_]) -> Array:
    """Return the time from the stamp before, s, zero at a restart, shape (n,)."""
    h = np.empty(len(t))
    since(t, restart, h)
    return h


@kernel
def middle(values: Array) -> float:
    """Return the upper one of the middle values, NaN among which are not found."""
    left, n, k = values.copy(), len(values), len(values) // 2
    while True:
        pivot, below, same = left[n // 2], 0, 0
        for i in range(n):
            below += left[i] < pivot
            same += left[i] == pivot
        if below <= k < below + same or not same:
            return float(pivot)
        # those on the side that has it are kept: without a branch that cannot be foreseen
        larger, kept = k >= below, 0
        for i in range(n):
            value = left[i]
            left[kept] = value
            kept += (value > pivot) if larger else (value < pivot)
        k, n = (k - below - same, kept) if larger else (k, kept)


@kernel
def median(values: Array) -> float:
    """Return the median."""
    upper, lower, below = middle(values), -np.inf, 0
    for value in values:
        if value < upper:
            lower, below = max(lower, value), below + 1
    whole = len(values) % 2 == 0 and below == len(values) // 2
    return 0.5 * (lower + upper) if whole else upper
