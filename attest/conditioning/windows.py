"""Sums over windows in which a magnetometer's field stands still in the gyroscope's frame.

Symbols: those of `attest.conditioning.iron`; Z columns of X in a basis, y the field before.
"""

from math import atan2, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import inlined, kernel

Array = NDArray[np.float64]
Windows = NDArray[np.intp]


@kernel
def columns(D: Array, m: Array, X: Array) -> None:
    """Fill X (n, 3, 12), the field by (S h, S), from quaternions D (n, 4) and vectors m (n, 3)."""
    for i in range(len(m)):
        R = so3.matrix(so3.row4(D, i))
        for j in range(3):
            for k in range(3):
                r = R[3 * j + k]
                X[i, j, k] = -r
                for axis in range(3):
                    X[i, j, 3 + 3 * k + axis] = r * m[i, axis]


@kernel
def less(m: Array, hard: Array, soft: Array, field: Array) -> None:
    """Fill field (n, 3) with S (m - h) of vectors m (n, 3)."""
    h = (hard[0], hard[1], hard[2])
    S = mat3.matrix_row(soft.reshape(1, 9), 0)
    for i in range(len(m)):
        field[i, 0], field[i, 1], field[i, 2] = mat3.apply(S, so3.sub(so3.row(m, i), h))


@kernel
def normal(Z: Array, y: Array, weight: Array, starts: Windows, A: Array, slope: Array) -> None:
    """Fill A and slope of zeros with Z^T Z and Z^T y, less their weighted means over windows."""
    k = Z.shape[2]
    of_Z, of_y = np.zeros((3, k)), np.zeros(3)
    for window in range(len(starts) - 1):
        of_Z[:], of_y[:] = 0.0, 0.0
        total = 0.0
        for i in range(starts[window], starts[window + 1]):
            total += weight[i]
            for j in range(3):
                of_y[j] += weight[i] * y[i, j]
                for a in range(k):
                    of_Z[j, a] += weight[i] * Z[i, j, a]
            _add(weight[i], Z[i], y[i], A, slope)
        _add(-1.0 / total, of_Z, of_y, A, slope)
    for a in range(k):
        for b in range(a):
            A[b, a] = A[a, b]


@inlined
def _add(weight: float, Z: Array, y: Array, A: Array, slope: Array) -> None:
    """Add weight Z^T Z, up to its diagonal, and weight Z^T y to A and slope."""
    for a in range(Z.shape[1]):
        u, v, w = weight * Z[0, a], weight * Z[1, a], weight * Z[2, a]
        slope[a] += u * y[0] + v * y[1] + w * y[2]
        for b in range(a + 1):
            A[a, b] += u * Z[0, b] + v * Z[1, b] + w * Z[2, b]


@kernel
def left(
    Z: Array, y: Array, weight: Array, starts: Windows, z: Array, out: Array, size2: Array
) -> None:
    """Fill out (n, 3) with y + Z z less its weighted mean over each window, and its square."""
    for window in range(len(starts) - 1):
        mean, total = (0.0, 0.0, 0.0), 0.0
        for i in range(starts[window], starts[window + 1]):
            for j in range(3):
                out[i, j] = y[i, j]
                for a in range(len(z)):
                    out[i, j] += Z[i, j, a] * z[a]
            mean = so3.add(mean, so3.scale(weight[i], so3.row(out, i)))
            total += weight[i]
        for i in range(starts[window], starts[window + 1]):
            for j in range(3):
                out[i, j] -= mean[j] / total
            size2[i] = so3.dot(so3.row(out, i), so3.row(out, i))


@kernel
def scores(Z: Array, left: Array, weight: Array, starts: Windows, out: Array) -> None:
    """Add the sums of weighted Z^T left to out (windows, k)."""
    for window in range(len(starts) - 1):
        for i in range(starts[window], starts[window + 1]):
            for j in range(3):
                for a in range(Z.shape[2]):
                    out[window, a] += weight[i] * left[i, j] * Z[i, j, a]


@kernel
def moved(y: Array, up: Array, starts: Windows, length: Array, along: Array) -> float:
    """Return the mean distance of vectors (n, 3) from their window's mean.

    Fills their length (n,) and, unless ``up`` has no rows, their part along it (n,).
    """
    total = 0.0
    for window in range(len(starts) - 1):
        first, last = starts[window], starts[window + 1]
        mean = (0.0, 0.0, 0.0)
        for i in range(first, last):
            mean = so3.add(mean, so3.row(y, i))
        mean = so3.scale(1.0 / (last - first), mean)
        for i in range(first, last):
            v = so3.row(y, i)
            away = so3.sub(v, mean)
            total += sqrt(so3.dot(away, away))
            length[i] = sqrt(so3.dot(v, v))
            if len(up):
                along[i] = so3.dot(v, so3.row(up, i))
    return total / len(y)


@kernel
def angle(one: Array, other: Array, up: Array) -> float:
    """Return the angle between vectors (n, 3), about the vertical unless that has no rows, RMS."""
    total = 0.0
    for i in range(len(one)):
        a, b = so3.row(one, i), so3.row(other, i)
        if len(up):
            e = so3.row(up, i)
            a, b = so3.sub(a, so3.scale(so3.dot(a, e), e)), so3.sub(b, so3.scale(so3.dot(b, e), e))
        across = so3.cross(a, b)
        total += atan2(sqrt(so3.dot(across, across)), so3.dot(a, b)) ** 2
    return sqrt(total / len(one))
