"""Hölder-continuous terms of the finite-time stable observers, floored where a vector vanishes."""

from attest.geometry import so3
from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector

FLOOR = 1e-30
"""Least x.x that is divided by or raised to a negative power: 0^-a is not finite, while the limits
of the terms are."""


@kernel
def power(x: Vector, a: float) -> float:
    """Return (x.x)^-a, floored."""
    return float(max(so3.dot(x, x), FLOOR) ** -a)


@kernel
def turned(x: Vector, y: Vector, a: float) -> Vector:
    """Return H(x) y with H(x) = I - 2a x x^T/(x.x), [FTS] (52), [ESO] (28)."""
    return so3.sub(y, so3.scale(2.0 * a * so3.dot(x, y) / max(so3.dot(x, x), FLOOR), x))
