"""Whether a vector turns as the gyroscope says: axes, signs and scale of one against the other.

A direction that is constant in the world turns in the body by u' = -Omega x u. With Omega = M w,
where w is what the gyroscope reads, that is linear in M: over every short cell of time

    du = sum_jk M_jk int (u x e_j) w_k dt + sum_j b_j int (u x e_j) dt,

b the gyroscope's bias. Where the two share axes and unit, M is the identity; where axes are
swapped or turned round, a signed permutation; where a unit is wrong, a multiple of these. A vector
whose own axes are at fault gives a proper M, and its negative the same; only a gyroscope's fault
gives an improper one.
"""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from attest.geometry import frames
from attest.recording import Signal, seconds

Array = NDArray[np.float64]
Cells = tuple[Array, Array]
"""Change of the vector by cell (3 n,), and the integrals of the 12 unknowns (3 n, 12)."""

BLOCK = 2000
"""Samples in a row that are taken or left together."""
MOST_BLOCKS = 10
"""Of the blocks, those with the most motion are taken."""
PERIOD_STAMPS = 1_000
FINEST = 0.01
"""Faster gyroscopes are averaged to this step, s."""
CELL = 0.2
"""Shortest cell, s: turns must show over the noise."""
LONGEST_CELL = 1.0
"""A log so slow that its cells would be longer tells nothing, s."""
FEWEST = 60
"""Cells that a fit needs."""
FITS = 0.5
"""Share of a vector's turning that the gyroscope explains, from which they are one body's."""
CLEAR = 0.8
"""Share that other axes or another scale must explain before they are named."""
AS_GOOD, NEARLY = 0.02, 0.05
"""Explained shares that differ by less are the same, and are not told apart."""
SIGNED = np.array(
    [
        np.diag(signs)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
)
"""The 48 signed permutations of the axes, the identity first."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """How well a vector's turning follows from the gyroscope."""

    as_read: float
    """Share of the vector's turning that the gyroscope explains as it is read; can be negative."""
    best: float
    """The same with the axes and the scale that explain the most."""
    axes: Array
    """These axes, a signed permutation P: the vector turns by -(P w) x u."""
    unique: bool
    """Whether no other axes explain about as much."""
    scale: float
    """What the gyroscope must be multiplied by, with these axes."""
    turns: bool = True
    """Whether the shares are of the vector's turning, or else of what the next axes leave."""

    @property
    def shared(self) -> bool:
        """Whether the log's own axes do as well as any."""
        return bool(np.array_equal(self.axes, SIGNED[0]))


def fit(gyro: Signal, vector: Signal) -> Fit | None:
    """Fit a vector's turning to the gyroscope; None where there is too little to tell."""
    cells = _cells(gyro, vector)
    if cells is None:
        return None
    y, X = _without_bias(*cells)
    G, c, yy = X.T @ X, X.T @ y, float(y @ y)
    if not (np.isfinite(G).all() and np.isfinite(c).all() and yy > 0.0):
        return None
    M = SIGNED.reshape(48, 9)
    power, along = np.einsum("pi,ij,pj->p", M, G, M), M @ c
    scale = np.where((along > 0.0) & (power > 0.0), along / np.where(power > 0.0, power, 1.0), 0.0)
    explained = scale * along / yy
    best = int(np.argmax(explained))
    if explained[0] > explained[best] - AS_GOOD:
        best = 0
    return Fit(
        as_read=float((2.0 * along[0] - power[0]) / yy),
        best=float(explained[best]),
        axes=SIGNED[best],
        unique=bool(np.sum(explained > explained[best] - NEARLY) == 1),
        scale=float(scale[best]),
    )


def written(axes: Array) -> str:
    """Write x, y, z of the right axes in those that were read, such as ``(y, -x, z)``."""
    return f"({', '.join(frames.letters(axes))})"


def moving(gyro: Array, size: int) -> NDArray[np.intp]:
    """Return where the blocks with the most motion begin."""
    whole = len(gyro) // size
    if whole <= MOST_BLOCKS:
        return np.arange(0, len(gyro), size)
    thin = max(1, size // BLOCK) * 10
    some = gyro[: whole * size : thin]
    spread = some[: len(some) // whole * whole].reshape(whole, -1, 3).var(axis=1).sum(axis=1)
    return np.sort(np.argsort(spread)[-MOST_BLOCKS:]) * size


def thinned(gyro: Signal) -> Signal:
    """Average a gyroscope that is faster than is needed."""
    merged = max(1, int(FINEST / period(gyro.t)))
    return Signal(*_merged(gyro.t, gyro.y, merged), gyro.source)


def means(stamps: Array, y: Array, edges: Array) -> Array:
    """Return the means of (n, k) values between edges, by their integral."""
    turned = np.zeros_like(y)
    np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(stamps)[:, np.newaxis], axis=0, out=turned[1:])
    whole = np.stack([np.interp(edges, stamps, column) for column in turned.T], axis=1)
    mean: Array = np.diff(whole, axis=0) / np.diff(edges)[:, np.newaxis]
    return mean


def _cells(gyro: Signal, vector: Signal) -> Cells | None:
    """Return what a fit is made of; None where there is too little."""
    if len(gyro.t) < FEWEST or len(vector.t) < FEWEST:
        return None
    step = [period(s.t) for s in (gyro, vector)]
    width = max(CELL, 3.0 * max(step))
    if width > LONGEST_CELL:
        return None
    merged = max(1, int(FINEST / step[0]))
    blocks = (
        _block(gyro, vector, slice(first, first + merged * BLOCK), merged, width)
        for first in moving(gyro.y, merged * BLOCK)
    )
    found = [block for block in blocks if block is not None]
    if sum(len(y) for y, _ in found) < 3 * FEWEST:
        return None
    y, X = (np.concatenate(part) for part in zip(*found, strict=True))
    return y, X


def period(t: NDArray[np.int64]) -> float:
    """Return the usual time between stamps, s, by the first ones."""
    return float(np.median(np.diff(t[:PERIOD_STAMPS]))) * 1e-9


def _block(gyro: Signal, vector: Signal, part: slice, merged: int, width: float) -> Cells | None:
    """Return change and integrals of one block."""
    t, w = _merged(gyro.t[part], gyro.y[part], merged)
    inside = (t >= vector.t[0]) & (t <= vector.t[-1])
    t, w = t[inside], w[inside]
    if len(t) < 4:
        return None
    origin = int(t[0])
    at = seconds(t, origin)
    first = max(int(np.searchsorted(vector.t, t[0])) - 1, 0)
    known = slice(first, int(np.searchsorted(vector.t, t[-1])) + 1)
    stamps = seconds(vector.t[known], origin)
    u = np.stack([np.interp(at, stamps, column) for column in vector.y[known].T])
    # u w_k and u, with the component of u before k
    rate = np.concatenate([(u[:, np.newaxis] * w.T).reshape(9, -1), u])
    integral = np.zeros_like(rate)
    np.cumsum((rate[:, 1:] + rate[:, :-1]) * (0.5 * np.diff(at)), axis=1, out=integral[:, 1:])
    begins = np.flatnonzero(np.diff(np.floor(at / width), prepend=-1.0))
    together = np.diff(at[begins]) < 2.0 * width  # not across a gap
    du = np.diff(_mean(u, begins))[:, together]
    di = np.diff(_mean(integral, begins))[:, together]
    return du.T.ravel(), _crossed(di)


def _merged(t: NDArray[np.int64], y: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """Average so many samples in a row, and their stamps to the nanosecond."""
    if count == 1:
        return t, y
    stamps = t[: len(t) // count * count].reshape(-1, count)
    values = y[: stamps.size].reshape(-1, count, y.shape[1])
    late = (stamps - stamps[:, :1]).mean(axis=1).astype(np.int64)
    return stamps[:, 0] + late, values.mean(axis=1)


def _crossed(di: Array) -> Array:
    """Return integrals of (u x e_j) w_k and u x e_j, (3 n, 12), from those of u w_k and u."""
    products, alone = di[:9].reshape(3, 3, -1), di[9:]
    crossed = np.zeros((di.shape[1], 3, 12))
    for j in range(3):
        after, before = (j + 1) % 3, (j + 2) % 3
        crossed[:, after, 3 * j : 3 * j + 3] = products[before].T
        crossed[:, before, 3 * j : 3 * j + 3] = -products[after].T
        crossed[:, after, 9 + j], crossed[:, before, 9 + j] = alone[before], -alone[after]
    return crossed.reshape(-1, 12)


def _mean(y: Array, begins: NDArray[np.intp]) -> Array:
    """Average along the last axis from each beginning to the next."""
    mean: Array = np.add.reduceat(y, begins, axis=1) / np.diff(begins, append=y.shape[1])
    return mean


def _without_bias(y: Array, X: Array) -> Cells:
    """Leave out of change and integrals what a constant rate, the last three, explains."""
    Z, whole = X[:, 9:], np.column_stack([y, X[:, :9]])
    G = Z.T @ Z
    if not np.isfinite(G).all():
        return y, X[:, :9]  # and the fit will tell
    rest: Array = whole - Z @ (np.linalg.pinv(G, hermitian=True) @ (Z.T @ whole))
    return rest[:, 0], rest[:, 1:]
