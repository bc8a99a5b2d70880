"""Windows in which a magnetometer's field stands still in the gyroscope's frame.

Symbols: those of `attest.conditioning.iron`; D by rows, (n, 9); spans the first sample of each
window and the one behind it, shape (w, 2).
"""

from math import atan2, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.rows import middle
from attest.geometry import mat3, so3
from attest.geometry.jit import kernel

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Windows = NDArray[np.intp]


@kernel
def samples(q: Array, m: Array, D: Array, c: Array) -> None:
    """Fill D from quaternions (n, 4), and c from vectors m (n, 3)."""
    for i in range(len(m)):
        R = so3.matrix(so3.row4(q, i))
        for j in range(9):
            D[i, j] = R[j]
        c[i, 0], c[i, 1], c[i, 2], c[i, 3] = -1.0, m[i, 0], m[i, 1], m[i, 2]


@kernel
def less(m: Array, hard: Array, soft: Array, field: Array) -> None:
    """Fill field (n, 3) with S (m - h) of vectors m (n, 3)."""
    h = (hard[0], hard[1], hard[2])
    S = mat3.matrix_row(soft.reshape(1, 9), 0)
    for i in range(len(m)):
        field[i, 0], field[i, 1], field[i, 2] = mat3.apply(S, so3.sub(so3.row(m, i), h))


@kernel
def up(
    line: tuple[Stamps, Array], force: tuple[Array, Array], when: Stamps, spans: Windows, out: Array
) -> None:
    """Fill out (n, 3) with the mean direction of forces in the frame, over the window of each time.

    Parameters
    ----------
    line
        Stamps and quaternions of the frame, (j,) and (j, 4).
    force
        Directions in the body there, and their lengths, (j, 3) and (j,).
    when : shape (n,)
        Rising.
    """
    t, q = line
    unit, length = force
    i = 0
    for window in range(len(spans)):
        total = so3.ZERO
        for k in range(spans[window, 0], spans[window, 1]):
            i = frame.last_before(t, when[k], i)
            fixed = mat3.apply(so3.matrix(so3.row4(q, i)), so3.row(unit, i))
            total = so3.add(total, so3.scale(length[i], fixed))
        mean, _ = so3.unit_of(total)
        for k in range(spans[window, 0], spans[window, 1]):
            out[k, 0], out[k, 1], out[k, 2] = mean


@kernel
def _spread(values: Array) -> float:
    """Return the mean distance from the middle value."""
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
