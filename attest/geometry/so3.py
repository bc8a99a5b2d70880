"""SO(3) on scalars and tuples, for kernels.

A vector is a tuple of 3 floats, a matrix a tuple of 9 in rows, a quaternion (w, x, y, z) a tuple of
4: numba keeps such tuples in registers, so that a step of an observer costs what it costs in C.
The same source runs in plain Python, bit for bit.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ZERO: Vector = (0.0, 0.0, 0.0)


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
def item(a: Array, i: int, j: int) -> Vector:
    """Vector j of row i of an (n, k, 3) array."""
    return (a[i, j, 0], a[i, j, 1], a[i, j, 2])


@kernel
def mean_row(a: Array, i: int) -> Vector:
    """Mean of rows i and i + 1 of an (n, 3) array; the last row itself."""
    return scale(0.5, add(row(a, i), row(a, min(i + 1, len(a) - 1))))


@kernel
def matrix_row(a: Array, i: int) -> Matrix:
    """Return the first nine of row i of an array as a matrix."""
    return (
        a[i, 0],
        a[i, 1],
        a[i, 2],
        a[i, 3],
        a[i, 4],
        a[i, 5],
        a[i, 6],
        a[i, 7],
        a[i, 8],
    )


@kernel
def blend(A: Matrix, B: Matrix, f: float) -> Matrix:
    """Return (1 - f) A + f B."""
    c = 1.0 - f
    return (
        c * A[0] + f * B[0],
        c * A[1] + f * B[1],
        c * A[2] + f * B[2],
        c * A[3] + f * B[3],
        c * A[4] + f * B[4],
        c * A[5] + f * B[5],
        c * A[6] + f * B[6],
        c * A[7] + f * B[7],
        c * A[8] + f * B[8],
    )


@kernel
def plus(A: Matrix, B: Matrix) -> Matrix:
    """Sum A + B."""
    return (
        A[0] + B[0],
        A[1] + B[1],
        A[2] + B[2],
        A[3] + B[3],
        A[4] + B[4],
        A[5] + B[5],
        A[6] + B[6],
        A[7] + B[7],
        A[8] + B[8],
    )


@kernel
def times(c: float, A: Matrix) -> Matrix:
    """Multiple c A."""
    return (
        c * A[0],
        c * A[1],
        c * A[2],
        c * A[3],
        c * A[4],
        c * A[5],
        c * A[6],
        c * A[7],
        c * A[8],
    )


@kernel
def diagonal(v: Vector) -> Matrix:
    """Return the diagonal matrix of v."""
    return (v[0], 0.0, 0.0, 0.0, v[1], 0.0, 0.0, 0.0, v[2])


@kernel
def hat(v: Vector) -> Matrix:
    """Return hat(v), so that hat(v) b = v x b."""
    return (0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0)


@kernel
def symmetric(A: Matrix) -> Matrix:
    """Return Ps(A) = (A + A^T)/2."""
    b, c, f = 0.5 * (A[1] + A[3]), 0.5 * (A[2] + A[6]), 0.5 * (A[5] + A[7])
    return (A[0], b, c, b, A[4], f, c, f, A[8])


@kernel
def inverse(A: Matrix) -> Matrix:
    """Return A^-1 by its adjugate; not finite where A is singular."""
    a = A[4] * A[8] - A[5] * A[7]
    b = A[5] * A[6] - A[3] * A[8]
    c = A[3] * A[7] - A[4] * A[6]
    r = 1.0 / (A[0] * a + A[1] * b + A[2] * c)
    return (
        r * a,
        r * (A[2] * A[7] - A[1] * A[8]),
        r * (A[1] * A[5] - A[2] * A[4]),
        r * b,
        r * (A[0] * A[8] - A[2] * A[6]),
        r * (A[2] * A[3] - A[0] * A[5]),
        r * c,
        r * (A[1] * A[6] - A[0] * A[7]),
        r * (A[0] * A[4] - A[1] * A[3]),
    )


@kernel
def determinant(A: Matrix) -> float:
    """Return the determinant of A."""
    return dot((A[0], A[1], A[2]), cross((A[3], A[4], A[5]), (A[6], A[7], A[8])))


@kernel
def positive(A: Matrix) -> bool:
    """Tell whether a symmetric matrix is positive definite (Sylvester); False for NaN."""
    second = A[0] * A[4] - A[1] * A[3]
    return bool(A[0] > 0.0 and second > 0.0 and 0.0 < determinant(A) < np.inf)


@kernel
def matmul(A: Matrix, B: Matrix) -> Matrix:
    """Product A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@kernel
def transpose(A: Matrix) -> Matrix:
    """Transpose of A."""
    return (A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8])


@kernel
def apply(A: Matrix, v: Vector) -> Vector:
    """Product A v."""
    return (
        A[0] * v[0] + A[1] * v[1] + A[2] * v[2],
        A[3] * v[0] + A[4] * v[1] + A[5] * v[2],
        A[6] * v[0] + A[7] * v[1] + A[8] * v[2],
    )


@kernel
def vex2(A: Matrix) -> Vector:
    """Return vex(A - A^T) = (A32 - A23, A13 - A31, A21 - A12)."""
    return (A[7] - A[5], A[2] - A[6], A[3] - A[1])


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
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a b."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def conjugate(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


@kernel
def normalize(q: Quaternion) -> Quaternion:
    """Scale to unit length."""
    r = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (r * q[0], r * q[1], r * q[2], r * q[3])


@kernel
def integrate(h: Array, gyro: Array, D: Array) -> None:
    """Fill D (n, 4) with quaternions: D[0] = 1, D[i+1] = D[i] exp(h[i] (gyro[i] + gyro[i+1])/2)."""
    q = (1.0, 0.0, 0.0, 0.0)
    for i in range(len(D)):
        D[i, 0], D[i, 1], D[i, 2], D[i, 3] = q
        if i + 1 < len(D):
            mean = scale(0.5 * h[i], add(row(gyro, i), row(gyro, i + 1)))
            q = normalize(multiply(q, exp(mean)))


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
