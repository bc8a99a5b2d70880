"""Hölder-continuous terms of the finite-time stable observers, floored where a vector vanishes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.geometry import so3
from attest.geometry.jit import inlined, kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]

FLOOR = 1e-30
"""Least x.x that is divided by or raised to a negative power: 0^-a is not finite, while the limits
of the terms are."""
LEAST, MOST = -100, 64
"""Powers of two between which numbers are tabled; those of `FLOOR` and of what no residual is."""
CELLS = 128
"""Of a table, from one power of two to the next."""


class Powers(NamedTuple):
    """What gives x^-a for one a, thrice as quick as the power itself.

    With x = 2^k m, and m = (1 + r)/c for the c of its cell, it is 2^(-a k) c^a (1 + r)^-a, of which
    the last is a short series.
    """

    a: float
    twos: Array
    """2^(-a k), shape (MOST - LEAST,)."""
    cells: Array
    """c and c^a, shape (CELLS, 2)."""
    series: tuple[float, float, float, float, float, float]
    """Binomial coefficients of -a over 1 to 6; |r| is below 1/256."""


@kernel
def powers(a: float) -> Powers:
    """Return the table of an exponent."""
    twos, cells = np.empty(MOST - LEAST), np.empty((CELLS, 2))
    for k in range(LEAST, MOST):
        twos[k - LEAST] = 2.0 ** (-a * k)
    for j in range(CELLS):
        cells[j, 0] = 1.0 / (1.0 + (j + 0.5) / CELLS)
        cells[j, 1] = cells[j, 0] ** a
    b1 = -a
    b2 = b1 * (-a - 1.0) / 2.0
    b3 = b2 * (-a - 2.0) / 3.0
    b4 = b3 * (-a - 3.0) / 4.0
    b5 = b4 * (-a - 4.0) / 5.0
    return Powers(a, twos, cells, (b1, b2, b3, b4, b5, b5 * (-a - 5.0) / 6.0))


@inlined
def raised(x: float, table: Powers) -> float:
    """Return x^-a."""
    if not 2.0**LEAST <= x < 2.0**MOST:  # nor if it is not a number
        return float(x**-table.a)
    bits = np.float64(x).view(np.int64)
    cell = (bits >> 45) & (CELLS - 1)
    m = np.int64((bits & 0xFFFFFFFFFFFFF) | 0x3FF0000000000000).view(np.float64)
    r = m * table.cells[cell, 0] - 1.0
    b1, b2, b3, b4, b5, b6 = table.series
    r2 = r * r
    low, high = 1.0 + b1 * r, (b2 + b3 * r) + r2 * (b4 + b5 * r + r2 * b6)
    return float(table.twos[(bits >> 52) - 1023 - LEAST] * table.cells[cell, 1] * (low + r2 * high))


@inlined
def tabled(x: Vector, table: Powers) -> float:
    """Return (x.x)^-a, floored, as `power` does."""
    return raised(max(so3.dot(x, x), FLOOR), table)


@kernel
def power(x: Vector, a: float) -> float:
    """Return (x.x)^-a, floored."""
    return float(max(so3.dot(x, x), FLOOR) ** -a)


@kernel
def turned(x: Vector, y: Vector, a: float) -> Vector:
    """Return H(x) y with H(x) = I - 2a x x^T/(x.x), [FTS] (52), [ESO] (28)."""
    return so3.sub(y, so3.scale(2.0 * a * so3.dot(x, y) / max(so3.dot(x, x), FLOOR), x))
