"""Which of a step's vectors are directions of their own, and which of them go together best.

Symbols: E vectors in the world, (n, k, 3), or (1, k, 3) where constant; U the same as measured in
the body, (n, k, 3); valid which of them to use, (n, k).
"""

from math import asin, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import so3
from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]

TINY = 1e-300

MIN_SINE = 0.1
"""Two directions closer than this sine (5.7°) count as one: their cross product is mostly noise."""


@kernel
def _sine2(a: Vector, b: Vector) -> float:
    """Squared sine of the angle between two vectors."""
    pair = so3.cross(a, b)
    return so3.dot(pair, pair) / max(so3.dot(a, a) * so3.dot(b, b), TINY)


@kernel
def close(a: Vector, b: Vector) -> bool:
    """Tell whether two vectors are within `MIN_SINE` of each other, or one has no length."""
    pair = so3.cross(a, b)
    return bool(so3.dot(pair, pair) <= MIN_SINE * MIN_SINE * so3.dot(a, a) * so3.dot(b, b))


@kernel
def apart(U: Array, i: int, first: int, second: int) -> bool:
    """Tell whether two vectors of row i are further apart than `MIN_SINE`."""
    return not close(so3.item(U, i, first), so3.item(U, i, second))


@kernel
def widest(E: Array, i: int, valid: NDArray[np.bool_], step: int) -> tuple[int, int]:
    """Return the first valid vector, and the one most at a right angle to it; -1 for none."""
    first, second, widest = -1, -1, MIN_SINE * MIN_SINE
    for j in range(valid.shape[1]):
        if not valid[step, j]:
            continue
        if first < 0:
            first = j
            continue
        apart = _sine2(so3.item(E, i, first), so3.item(E, i, j))
        if apart > widest:
            second, widest = j, apart
    return first, second


@kernel
def independent(E: Array, U: Array, valid: NDArray[np.bool_], out: Array) -> None:
    """Fill out (n, 2) with how many directions a step has (0, 1, or 2 for more), and their angle.

    The angle is that of the first vector and the one most at a right angle to it, rad, as known;
    NaN where there are no two.
    """
    for i in range(len(U)):
        row = i if len(E) > 1 else 0
        first, second = widest(E, row, valid, i)
        out[i, 0], out[i, 1] = (0.0 if first < 0 else 1.0), np.nan
        if second >= 0 and apart(U, i, first, second):
            out[i, 0] = 2.0
            sine2 = _sine2(so3.item(E, row, first), so3.item(E, row, second))
            out[i, 1] = asin(sqrt(min(sine2, 1.0)))
