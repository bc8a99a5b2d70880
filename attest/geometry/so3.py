"""SO(3) on scalars and tuples, for kernels.

A vector is a tuple of 3 floats, a quaternion (w, x, y, z) a tuple of 4: numba keeps such tuples in
registers, so that a step of an observer costs what it costs in C. The same source runs in plain
Python, bit for bit. Matrices are in `attest.geometry.mat3`.
"""

from math import atan2, cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)


CLOSE = 0.9994
"""Cosine of half the angle between rotations up to which their chord stands for the way."""


def as_vector(a: Array) -> Vector:
    """Return an array (3,) as a vector."""
    x, y, z = a.tolist()
    return (x, y, z)


def as_quaternion(a: Array) -> Quaternion:
    """Return an array (4,) as a quaternion."""
    w, x, y, z = a.tolist()
    return (w, x, y, z)


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Inner product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def flat(v: Vector, up: Array, i: int) -> Vector:
    """Return what of a vector is across the unit vector of row i; all of it if there are none."""
    if not len(up):
        return v
    e = row(up, i)
    return sub(v, scale(dot(v, e), e))


@kernel
def unit_of(v: Vector) -> tuple[Vector, float]:
    """Return the unit vector, zero for zero, and the length."""
    length = sqrt(dot(v, v))
    return scale(1.0 / length if length > 0.0 else 0.0, v), length


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product a x b = hat(a) b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(c: float, a: Vector) -> Vector:
    """Multiple c a."""
    return (c * a[0], c * a[1], c * a[2])


@kernel
def row(a: Array, i: int) -> Vector:
    """Row i of an (n, 3) array as a vector."""
    return (a[i, 0], a[i, 1], a[i, 2])


@kernel
def row4(a: Array, i: int) -> Quaternion:
    """Row i of an (n, 4) array as a quaternion."""
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3])


@kernel
def item(a: Array, i: int, j: int) -> Vector:
    """Vector j of row i of an (n, k, 3) array."""
    return (a[i, j, 0], a[i, j, 1], a[i, j, 2])


@kernel
def mean_row(a: Array, i: int) -> Vector:
    """Mean of rows i and i + 1 of an (n, 3) array; the last row itself."""
    return scale(0.5, add(row(a, i), row(a, min(i + 1, len(a) - 1))))


@kernel
def exp(phi: Vector) -> Quaternion:
    """Return the unit quaternion of the rotation vector phi, rad (Rodrigues, half angles)."""
    x = 0.25 * (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])  # half the angle, squared
    if x < 0.0125:  # up to 12.8°: Taylor, what is left out is below 1e-20; thrice as quick
        w = 1.0 - x * (0.5 - x * (1 / 24 - x * (1 / 720 - x * (1 / 40320 - x / 3628800))))
        k = 0.5 - x * (1 / 12 - x * (1 / 240 - x * (1 / 10080 - x * (1 / 725760 - x / 79833600))))
    else:
        half = sqrt(x)
        w = cos(half)
        k = 0.5 * sin(half) / half
    return (w, k * phi[0], k * phi[1], k * phi[2])


@kernel
def log(q: Quaternion) -> Vector:
    """Return the rotation vector of a unit quaternion's shorter way, rad, of length at most pi."""
    s2 = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    k = 2.0 / q[0] if s2 < 1e-24 else 2.0 * atan2(sqrt(s2), abs(q[0])) / sqrt(s2)
    if s2 >= 1e-24 and q[0] < 0.0:
        k = -k
    return (k * q[1], k * q[2], k * q[3])


@kernel
def between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    """Return a exp(share log(a^-1 b)), the way from a to b at a constant rate.

    Closer than 4°, the chord is as good to 3e-6 rad, and quicker.
    """
    if dot4(a, b) > CLOSE:
        c = 1.0 - share
        w, x = c * a[0] + share * b[0], c * a[1] + share * b[1]
        return normalize((w, x, c * a[2] + share * b[2], c * a[3] + share * b[3]))
    return multiply(a, exp(scale(share, log(multiply(conjugate(a), b)))))


@kernel
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a b."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def dot4(a: Quaternion, b: Quaternion) -> float:
    """Inner product of quaternions."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@kernel
def conjugate(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


@kernel
def normalize(q: Quaternion) -> Quaternion:
    """Scale to unit length."""
    r = 1.0 / sqrt(dot4(q, q))
    return (r * q[0], r * q[1], r * q[2], r * q[3])


@kernel
def renormalize(q: Quaternion) -> Quaternion:
    """Scale to unit length what is off by rounding only: a step of Newton's, without a root."""
    r = 1.5 - 0.5 * dot4(q, q)
    return (r * q[0], r * q[1], r * q[2], r * q[3])


@kernel
def integrate(h: Array, mean: Array, D: Array) -> None:
    """Fill D (n, 4) with quaternions: D[0] = 1, D[i+1] = D[i] exp(h[i] mean[i])."""
    q = (1.0, 0.0, 0.0, 0.0)
    for i in range(len(D)):
        D[i, 0], D[i, 1], D[i, 2], D[i, 3] = q
        if i + 1 < len(D):
            q = renormalize(multiply(q, exp(scale(h[i], row(mean, i)))))


@kernel
def from_matrix(R: Matrix) -> Quaternion:
    """Return the unit quaternion of a rotation matrix, from its largest component (Shepperd)."""
    trace = R[0] + R[4] + R[8]
    if trace > max(R[0], R[4], R[8]):
        q = (1.0 + trace, R[7] - R[5], R[2] - R[6], R[3] - R[1])
    elif R[0] >= R[4] and R[0] >= R[8]:
        q = (R[7] - R[5], 1.0 + 2.0 * R[0] - trace, R[1] + R[3], R[2] + R[6])
    elif R[4] >= R[8]:
        q = (R[2] - R[6], R[1] + R[3], 1.0 + 2.0 * R[4] - trace, R[5] + R[7])
    else:
        q = (R[3] - R[1], R[2] + R[6], R[5] + R[7], 1.0 + 2.0 * R[8] - trace)
    return normalize(q)


@kernel
def matrix(q: Quaternion) -> Matrix:
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
