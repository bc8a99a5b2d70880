"""3 x 3 matrices as tuples of 9 in rows, for kernels: numba keeps them in registers."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


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
def diagonal(v: Vector) -> Matrix:
    """Return the diagonal matrix of v."""
    return (v[0], 0.0, 0.0, 0.0, v[1], 0.0, 0.0, 0.0, v[2])


@kernel
def hat(v: Vector) -> Matrix:
    """Return hat(v), so that hat(v) b = v x b."""
    return (0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0)


@kernel
def vex2(A: Matrix) -> Vector:
    """Return vex(A - A^T) = (A32 - A23, A13 - A31, A21 - A12)."""
    return (A[7] - A[5], A[2] - A[6], A[3] - A[1])


@kernel
def symmetric(A: Matrix) -> Matrix:
    """Return Ps(A) = (A + A^T)/2."""
    b, c, f = 0.5 * (A[1] + A[3]), 0.5 * (A[2] + A[6]), 0.5 * (A[5] + A[7])
    return (A[0], b, c, b, A[4], f, c, f, A[8])


@kernel
def norm(A: Matrix) -> float:
    """Frobenius norm |A|."""
    total = 0.0
    for a in A:
        total += a * a
    return sqrt(total)


@kernel
def determinant(A: Matrix) -> float:
    """Return the determinant of A."""
    return float(
        A[0] * (A[4] * A[8] - A[5] * A[7])
        + A[1] * (A[5] * A[6] - A[3] * A[8])
        + A[2] * (A[3] * A[7] - A[4] * A[6])
    )


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
def positive(A: Matrix) -> bool:
    """Tell whether a symmetric matrix is positive definite (Sylvester); False for NaN."""
    second = A[0] * A[4] - A[1] * A[3]
    return bool(A[0] > 0.0 and second > 0.0 and 0.0 < determinant(A) < np.inf)
