"""Static solutions: the attitude from the vectors of one moment.

[Black64]  H. D. Black, "A passive system for determining the attitude of a satellite",
           AIAA J. 2(7).
[Davenport68]  P. B. Davenport, "A vector approach to the algebra of rotations", NASA TN D-4696.

Symbols: R attitude, body to world; e_i, u_i unit vectors in the world and measured in the body;
L = sum w_i e_i u_i^T (or E W U^T with any weights W); N Davenport's matrix, whose eigenvector of
the largest eigenvalue is R as a quaternion.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.geometry.wahba import ZERO, outer_sum

Array = NDArray[np.float64]

SWEEPS = 30
"""Of Jacobi rotations; half a dozen do."""
ALIKE = 1e-9
"""Eigenvalues that differ by less, in units of the largest entry, are one."""
TINY = 1e-300


@kernel
def _jacobi(N: Array, V: Array) -> None:
    """Turn a symmetric N (4, 4) into the diagonal of its eigenvalues; V gets the eigenvectors.

    Cyclic Jacobi rotations: for four rows a dozen lines, and exact to rounding.
    """
    V[:] = 0.0
    for i in range(4):
        V[i, i] = 1.0
    size = np.abs(N).max()
    for _ in range(SWEEPS):
        left = 0.0
        for i in range(3):
            for j in range(i + 1, 4):
                left = max(left, abs(N[i, j]))
        if left <= 1e-18 * size:
            return
        for i in range(3):
            for j in range(i + 1, 4):
                _rotate(N, V, i, j)


@kernel
def _rotate(N: Array, V: Array, i: int, j: int) -> None:
    """Make N[i, j] zero by a turn in that plane."""
    if abs(N[i, j]) <= 1e-150 * (abs(N[i, i]) + abs(N[j, j])):  # whose square would overflow
        N[i, j] = N[j, i] = 0.0
        return
    theta = 0.5 * (N[j, j] - N[i, i]) / N[i, j]
    tangent = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + sqrt(theta * theta + 1.0))
    c = 1.0 / sqrt(tangent * tangent + 1.0)
    s = tangent * c
    for k in range(4):
        N[k, i], N[k, j] = c * N[k, i] - s * N[k, j], s * N[k, i] + c * N[k, j]
    for k in range(4):
        N[i, k], N[j, k] = c * N[i, k] - s * N[j, k], s * N[i, k] + c * N[j, k]
    for k in range(4):
        V[k, i], V[k, j] = c * V[k, i] - s * V[k, j], s * V[k, i] + c * V[k, j]


@kernel
def closest(L: Matrix, near: Quaternion, N: Array, V: Array) -> Quaternion:
    """Return the rotation R that maximises <R, L>, by the q method [Davenport68].

    What the vectors leave open (all of it where L is zero) is as in the rotation ``near``. N and V
    are (4, 4), for work.
    """
    trace = L[0] + L[4] + L[8]
    N[0, 0] = trace
    N[0, 1] = N[1, 0] = L[7] - L[5]
    N[0, 2] = N[2, 0] = L[2] - L[6]
    N[0, 3] = N[3, 0] = L[3] - L[1]
    for i in range(3):
        for j in range(3):
            N[i + 1, j + 1] = L[3 * i + j] + L[3 * j + i] - (trace if i == j else 0.0)
    size = max(np.abs(N).max(), TINY)
    _jacobi(N, V)
    first = 0
    for i in range(1, 4):
        if N[i, i] > N[first, first]:
            first = i
    w, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        # eigenvectors of (nearly) the largest value span what the vectors cannot tell apart
        if N[i, i] > N[first, first] - ALIKE * size:
            part = V[0, i] * near[0] + V[1, i] * near[1] + V[2, i] * near[2] + V[3, i] * near[3]
            w, x, y, z = (
                w + part * V[0, i],
                x + part * V[1, i],
                y + part * V[2, i],
                z + part * V[3, i],
            )
    if w * w + x * x + y * y + z * z < 1e-18:  # a half turn from near: no way is the nearest
        return (V[0, first], V[1, first], V[2, first], V[3, first])
    return so3.normalize((w, x, y, z))


def attitude(E: Array, U: Array, weights: Array | None = None) -> Array:
    """Solve Wahba's problem by Davenport's q method [Davenport68].

    Parameters
    ----------
    E, U
        Unit vectors in the world and in the body, shape (k, 3).
    weights
        One non-negative weight per vector, shape (k,); ones by default.

    Returns
    -------
    q : shape (4,)
        The rotation, body to world, that minimises sum w_i |e_i - R u_i|². With one direction only,
        the shortest one that fits; with none, the identity.
    """
    w = np.ones(len(E)) if weights is None else weights
    C = (w[:, np.newaxis] * E).T @ U
    L = mat3.matrix_row(C.reshape(1, 9), 0)
    return np.array(closest(L, (1.0, 0.0, 0.0, 0.0), np.empty((4, 4)), np.empty((4, 4))))


@kernel
def triad(e1: Vector, e2: Vector, u1: Vector, u2: Vector) -> Matrix:
    """Return the rotation, body to world, that fits u1 exactly and u2 as well as it can [Black64].

    All are unit vectors that are not parallel; e1, e2 in the world, u1, u2 in the body.
    """
    e3, u3 = _unit(so3.cross(e1, e2)), _unit(so3.cross(u1, u2))
    R = outer_sum(outer_sum(ZERO, e1, u1), e3, u3)
    return outer_sum(R, so3.cross(e1, e3), so3.cross(u1, u3))


@kernel
def _unit(a: Vector) -> Vector:
    return so3.scale(1.0 / sqrt(so3.dot(a, a)), a)
