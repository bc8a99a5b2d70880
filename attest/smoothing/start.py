"""A first guess of a whole log's attitude, from vectors averaged over seconds.

The vectors are averaged, past and future alike, in the frame that the gyroscope integrates, where
the body's own motion does not blur them, and Wahba's problem is solved for the averages.

Symbols: D body to the gyroscope's frame; B attitude profile, sum of e u^T, of that frame.
"""

from collections.abc import Mapping
from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, quaternion, so3
from attest.geometry.jit import kernel

Array = NDArray[np.float64]

REACH = 4.0
"""Time constant of the averages, s."""
HELD = 0.02
"""What the attitude before counts for, against the vectors, where they leave it open."""


class Vectors(NamedTuple):
    """What is measured and what it should be, at n steps."""

    h: Array
    """s, (n,); zero before a restart."""
    u: Array
    """In the body, (n, k, 3), of lengths by which they count."""
    e: Array
    """Unit vectors in the world, (n, k, 3) or (1, k, 3)."""
    valid: NDArray[np.bool_]
    """(n, k)."""


def attitudes(
    vectors: Vectors, rate: Array, at: NDArray[np.int64], first: Mapping[int, Array]
) -> Array:
    """Return the attitude at the nodes, (N, 4).

    Parameters
    ----------
    vectors, rate
        Measurements; the gyroscope less its bias, as far as that is known, rad/s, (n, 3).
    at
        The step of each node.
    first
        By step, the attitude from which a stretch starts; the first step is one.
    """
    n = len(rate)
    D = np.empty((n, 4))
    so3.integrate(vectors.h, rate, D)
    starts = np.isin(np.arange(n), list(first))
    B = np.empty((len(at), 9))
    _profiles(vectors, D, starts, at, np.zeros((n, 9)), B)
    q, R = np.empty((len(at), 4)), np.eye(3)
    for k, i in enumerate(at.tolist()):
        if i in first:
            start = quaternion.multiply(first[i], quaternion.conjugate(D[i]))
            R = quaternion.to_matrix(start)
        R = _wahba(B[k].reshape(3, 3), R)
        q[k] = so3.from_matrix(mat3.matrix_row(R.reshape(1, 9), 0))
    return quaternion.normalize(quaternion.multiply(q, D[at]))


def _wahba(B: Array, before: Array) -> Array:
    """Return the rotation that fits a profile, and what was before where that leaves it open."""
    size = float(np.linalg.norm(B))
    if not size > 1e-100 or not np.isfinite(size):
        return before
    left, _, right = np.linalg.svd(B / size + HELD * before)
    signs = np.array([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)])
    found: Array = (left * signs) @ right
    return found


@kernel
def _profiles(
    vectors: Vectors,
    D: Array,
    starts: NDArray[np.bool_],
    at: NDArray[np.int64],
    past: Array,
    B: Array,
) -> None:
    """Fill B (N, 9) with averaged profiles; past (n, 9), zero, is room for the averages so far."""
    n, k, h = len(D), len(at) - 1, vectors.h
    for i in range(n):
        if not starts[i]:
            for j in range(9):
                past[i, j] = past[i - 1, j] * exp(-h[i - 1] / REACH)
        _add(vectors, D, i, past[i])
    future = np.zeros(9)
    for i in range(n - 1, -1, -1):
        if k >= 0 and at[k] == i:
            for j in range(9):
                B[k, j] = past[i, j] + future[j]
            k -= 1
        _add(vectors, D, i, future)
        for j in range(9):
            future[j] *= 0.0 if starts[i] else exp(-h[i - 1] / REACH)


@kernel
def _add(vectors: Vectors, D: Array, i: int, B: Array) -> None:
    """Add the profile of step i, e u^T D^T, to B (9,)."""
    R = so3.matrix(so3.row4(D, i))
    for j in range(vectors.u.shape[1]):
        if not vectors.valid[i, j]:
            continue
        u = mat3.apply(R, so3.item(vectors.u, i, j))
        e = so3.item(vectors.e, i if len(vectors.e) > 1 else 0, j)
        for a in range(3):
            for c in range(3):
                B[3 * a + c] += max(vectors.h[i], 1e-6) * e[a] * u[c]
