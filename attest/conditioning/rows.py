"""What is asked of every row of an (n, 3) array, without arrays between."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]


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


@kernel
def split(v: Array, unit: Array, length: Array) -> None:
    """Fill the unit vectors (n, 3) and the lengths (n,) of vectors; zero stays zero."""
    for i in range(len(v)):
        length[i] = sqrt(v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2)
        r = 1.0 / length[i] if length[i] > 0.0 else 1.0
        unit[i, 0], unit[i, 1], unit[i, 2] = r * v[i, 0], r * v[i, 1], r * v[i, 2]
