"""Sums over windows in which a magnetometer's field stands still in the gyroscope's frame.

Symbols: those of `attest.conditioning.iron`; Z columns of X in a basis, y the field before, z the
change in the basis; spans the first sample of each window and the one behind it, shape (w, 2).
"""

from math import atan2, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import inlined, kernel

Array = NDArray[np.float64]
Windows = NDArray[np.intp]

FAINT = 1e-8
"""Mean square of a turn that tells nothing, rad²."""
QUIET = 1e-3
"""Deviation of a magnetometer's samples at the least, as a share of the strength."""
TAIL = 3.0
"""Square of the misfit, in deviations, at which a sample counts half."""


@kernel
def columns(D: Array, m: Array, X: Array, y: Array) -> None:
    """Fill X (n, 3, 12), the field by (S h, S), from quaternions D (n, 4) and vectors m (n, 3).

    And y (n, 3), the field as it is.
    """
    for i in range(len(m)):
        R = so3.matrix(so3.row4(D, i))
        y[i, 0], y[i, 1], y[i, 2] = mat3.apply(R, so3.row(m, i))
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
def fit(
    Z: Array, y: Array, spans: Windows, rounds: int, weight: Array, inverse: Array, z: Array
) -> float:
    """Fill z (k,) with what leaves least of y + Z z less its mean over each window.

    Samples of Cauchy's distribution: those of disturbed places count little. ``weight`` (n,) is
    what they count at first, and then at last; ``inverse`` (k, k) is filled with z's covariance but
    for the factor that is returned.
    """
    slope, left, sizes = np.empty(len(z)), np.empty_like(y), np.empty(len(y))
    n = 0
    for window in range(len(spans)):
        n += spans[window, 1] - spans[window, 0]
    for _ in range(rounds):
        _normal(Z, y, weight, spans, inverse, slope)
        for a in range(len(z)):
            inverse[a, a] += FAINT * n
        invert(inverse)
        for a in range(len(z)):
            z[a] = 0.0
            for b in range(len(z)):
                z[a] -= inverse[a, b] * slope[b]
        _left(Z, y, weight, spans, z, left, sizes)
        usual = max(TAIL * middle(sizes[:n]), QUIET**2)
        for window in range(len(spans)):
            for i in range(spans[window, 0], spans[window, 1]):
                weight[i] = 1.0 / (1.0 + so3.dot(so3.row(left, i), so3.row(left, i)) / usual)
    # what hardly moves has scores of hardly anything: no less than the samples' own scatter
    between, within = _scatter(Z, left, weight, spans, inverse)
    return float(max(between / len(z), within / (3.0 * n), QUIET**2))


@kernel
def _normal(Z: Array, y: Array, weight: Array, spans: Windows, A: Array, slope: Array) -> None:
    """Fill A and slope with Z^T Z and Z^T y, less their weighted means over windows."""
    k = Z.shape[2]
    A[:], slope[:] = 0.0, 0.0
    of_Z, of_y = np.empty((3, k)), np.empty(3)
    for window in range(len(spans)):
        of_Z[:], of_y[:] = 0.0, 0.0
        total = 0.0
        for i in range(spans[window, 0], spans[window, 1]):
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
def invert(A: Array) -> None:
    """Invert a symmetric positive definite matrix in place, by Gauss and Jordan."""
    for p in range(len(A)):
        r, A[p, p] = 1.0 / A[p, p], 1.0
        for b in range(len(A)):
            A[p, b] *= r
        for a in range(len(A)):
            if a != p:
                c, A[a, p] = A[a, p], 0.0
                for b in range(len(A)):
                    A[a, b] -= c * A[p, b]


@kernel
def _left(
    Z: Array, y: Array, weight: Array, spans: Windows, z: Array, out: Array, sizes: Array
) -> None:
    """Fill out (n, 3) with y + Z z less its weighted mean over each window.

    And sizes, from the first on, with the squares.
    """
    count = 0
    for window in range(len(spans)):
        mean, total = (0.0, 0.0, 0.0), 0.0
        for i in range(spans[window, 0], spans[window, 1]):
            for j in range(3):
                moved = y[i, j]
                for a in range(len(z)):
                    moved += Z[i, j, a] * z[a]
                out[i, j] = moved
            mean = so3.add(mean, so3.scale(weight[i], so3.row(out, i)))
            total += weight[i]
        for i in range(spans[window, 0], spans[window, 1]):
            for j in range(3):
                out[i, j] -= mean[j] / total
            sizes[count] = so3.dot(so3.row(out, i), so3.row(out, i))
            count += 1


@kernel
def _scatter(
    Z: Array, left: Array, weight: Array, spans: Windows, inverse: Array
) -> tuple[float, float]:
    """Return the sums of s^T inverse s, s of each window Z^T left, and of left^T left; weighted."""
    s, between, within = np.empty(len(inverse)), 0.0, 0.0
    for window in range(len(spans)):
        s[:] = 0.0
        for i in range(spans[window, 0], spans[window, 1]):
            within += weight[i] * so3.dot(so3.row(left, i), so3.row(left, i))
            for j in range(3):
                for a in range(len(s)):
                    s[a] += weight[i] * left[i, j] * Z[i, j, a]
        for a in range(len(s)):
            for b in range(len(s)):
                between += s[a] * inverse[a, b] * s[b]
    return between, within


@kernel
def middle(values: Array) -> float:
    """Return the upper one of the middle values, which puts them in another order."""
    k, low, high = len(values) // 2, 0, len(values) - 1
    while low < high:
        pivot, i, j = values[k], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < k:
            low = i
        if k < i:
            high = j
    return float(values[k])


@kernel
def _spread(values: Array) -> float:
    """Return the mean distance from the middle value, which puts them in another order."""
    among, total = middle(values), 0.0
    for value in values:
        total += abs(value - among)
    return total / len(values)


@kernel
def misfits(y: Array, up: Array, spans: Windows, edges: Windows, out: Array) -> None:
    """Fill out (g, 3) with how far vectors y (n, 3) are from standing still, on mean.

    From their window's mean; in length; and unless ``up`` has no rows, in their part along it.

    Parameters
    ----------
    edges : shape (g + 1,)
        Window at which each group begins, and the one behind the last group.
    """
    length, along = np.empty(len(y)), np.empty(len(y))
    for group in range(len(edges) - 1):
        count, total = 0, 0.0
        for window in range(edges[group], edges[group + 1]):
            first, last = spans[window, 0], spans[window, 1]
            mean = (0.0, 0.0, 0.0)
            for i in range(first, last):
                mean = so3.add(mean, so3.row(y, i))
            mean = so3.scale(1.0 / (last - first), mean)
            for i in range(first, last):
                v = so3.row(y, i)
                away = so3.sub(v, mean)
                total += sqrt(so3.dot(away, away))
                length[count] = sqrt(so3.dot(v, v))
                along[count] = so3.dot(v, so3.row(up, i)) if len(up) else 0.0
                count += 1
        out[group, 0], out[group, 1] = total / count, _spread(length[:count])
        out[group, 2] = _spread(along[:count])


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
