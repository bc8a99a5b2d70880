"""Hard and soft iron of a magnetometer, by consistency with the gyroscope.

In the frame that the gyroscope integrates, the field of the world stands still: D S (m - h) is
constant but for the gyroscope's slow drift. Less its mean over each window it is zero, which is
linear in S h and in S.

Symbols: D rotation from the body to the gyroscope's frame; m the magnetometer in the body, as a
share of the field's strength; h hard iron; S soft iron, symmetric with the trace 3, so that the
strength stays; X what the misfit changes by with the unknowns x = (S h, five of S).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.timeline import SECOND, Timeline
from attest.geometry import quaternion
from attest.recording import Signal

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW = 8.0
"""Over which the field stands still in the gyroscope's frame, s."""
MOST_SAMPLES = 20_000
SPACING = 0.02
"""Least time between the samples that are used, s."""
ROUNDS = 6
"""Of weighting; the weights settle in fewer."""
FAINT = 1e-8
"""Mean square of a turn that tells nothing, rad²."""
QUIET = 1e-3
"""Deviation of a magnetometer's samples at the least, as a share of the strength."""
TAIL = 3.0
"""Square of the misfit, in deviations, at which a sample counts half."""
_R2, _R6 = np.sqrt(0.5), np.sqrt(1.0 / 6.0)
SHAPES = np.array(
    [
        [[_R2, 0, 0], [0, -_R2, 0], [0, 0, 0]],
        [[_R6, 0, 0], [0, _R6, 0], [0, 0, -2.0 * _R6]],
        [[0, _R2, 0], [_R2, 0, 0], [0, 0, 0]],
        [[0, 0, _R2], [0, 0, 0], [_R2, 0, 0]],
        [[0, 0, 0], [0, 0, _R2], [0, _R2, 0]],
    ]
)
"""Symmetric matrices without trace, shape (5, 3, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Iron:
    """What a magnetometer reads besides the field: the field is ``soft @ (m - hard)``."""

    hard: Array
    """In the unit of what is measured, shape (3,)."""
    soft: Array
    """Shape (3, 3)."""

    def off(self, m: Array) -> Array:
        """Take it off vectors of shape (n, 3)."""
        field: Array = (m - self.hard) @ self.soft.T
        return field


NONE = Iron(np.zeros(3), np.eye(3))


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Samples of a magnetometer in the frame that the gyroscope integrates."""

    D: Array
    """Body to frame, shape (n, 3, 3)."""
    m: Array
    """In the body, as a share of `strength`, shape (n, 3)."""
    strength: float
    """Median length, tesla."""
    window: NDArray[np.intp]
    """Number of each sample's window, rising from 0 without gaps, shape (n,)."""
    up: Array | None
    """Unit vertical in the frame, a window's mean; None where it is not known, shape (n, 3)."""

    def part(self, chosen: Mask) -> "Field":
        """Return some of the samples."""
        window = np.unique(self.window[chosen], return_inverse=True)[1]
        up = None if self.up is None else self.up[chosen]
        return Field(self.D[chosen], self.m[chosen], self.strength, window, up)


def field(line: Timeline, mag: Signal, force: Array | None) -> Field | None:
    """Choose samples of a magnetometer, none where the gyroscope is silent.

    Parameters
    ----------
    line
        The gyroscope.
    mag
        The magnetometer, at its right time.
    force : shape (n, 3)
        Specific force at the gyroscope's stamps, vertical on average; None where that is not known.
    """
    inside = np.flatnonzero((mag.t >= line.t[0]) & (mag.t <= line.t[-1]))
    if len(inside) < 2:
        return None
    t = mag.t[inside]
    spacing = max(round(SPACING * SECOND), int(t[-1] - t[0]) // MOST_SAMPLES)
    # a log of several stretches has fewer: they are set far apart
    chosen = inside[np.unique((t - t[0]) // spacing, return_index=True)[1]]
    t, y = mag.t[chosen], mag.y[chosen]
    cells = (t - t[0]) // round(WINDOW * SECOND)
    window = np.unique(cells, return_inverse=True)[1].astype(np.intp)
    strength = float(np.median(np.linalg.norm(y, axis=1)))
    up = None
    if force is not None:
        near = frame.nearest(line.t, t)[0]
        up = _unit(_means(quaternion.rotate(line.D[near], force[near]), window, np.ones(len(t))))
    D = quaternion.to_matrix(frame.at(line.t, line.D, t))
    return Field(D, y / strength, strength, window, up)


def fit(field: Field, basis: Array) -> tuple[Array, Array]:
    """Return x, in the span of a basis of shape (8, k), and its covariance, (k, k), in the basis.

    Samples of Cauchy's distribution: those of disturbed places count little. The covariance is
    widened by how much the windows scatter, for errors within one are of one sort.
    """
    X, y = _columns(field) @ basis, _turned(field, field.m)
    weight = np.ones(len(y))
    for _ in range(ROUNDS):
        Xc, yc = (v - _means(v, field.window, weight) for v in (X, y))
        A = np.tensordot(Xc * weight[:, np.newaxis, np.newaxis], Xc, ((0, 1), (0, 1)))
        slope = np.einsum("nij,ni->nj", Xc, yc * weight[:, np.newaxis])
        inverse = np.asarray(np.linalg.inv(A + FAINT * len(y) * np.eye(len(A))), np.float64)
        z = -inverse @ slope.sum(axis=0)
        left = yc + Xc @ z
        size2 = np.sum(left**2, axis=1)
        weight = 1.0 / (1.0 + size2 / max(TAIL * float(np.median(size2)), QUIET**2))
    scores = _sums(np.einsum("nij,ni->nj", Xc, left * weight[:, np.newaxis]), field.window)
    scatter = float(np.sum((scores @ inverse) * scores)) / len(z)
    # what hardly moves has scores of hardly anything: no less than the samples' own scatter
    scatter = max(scatter, float(np.mean(weight * size2)) / 3.0, QUIET**2)
    return basis @ z, scatter * inverse


def iron(x: Array, strength: float) -> Iron:
    """Return what the unknowns stand for."""
    soft = np.eye(3) + np.tensordot(x[3:], SHAPES, 1)
    return Iron(np.asarray(strength * np.linalg.solve(soft, x[:3]), np.float64), soft)


def misfit(field: Field, iron: Iron) -> Array:
    """Return how far the field is from standing still, in strength and in its part along the up.

    Mean absolute, as shares of the strength; shape (3,) or, without the vertical, (2,).
    """
    m = taken_off(field, iron)
    y = _turned(field, m)
    moved = np.linalg.norm(y - _means(y, field.window, np.ones(len(y))), axis=1)
    spreads = [float(moved.mean()), _spread(np.linalg.norm(m, axis=1))]
    if field.up is not None:
        spreads.append(_spread(np.sum(y * field.up, axis=1)))
    return np.array(spreads)


def heading(field: Field, one: Iron, other: Iron) -> float:
    """Return by how much two calibrations differ in heading, or in all without up, RMS, rad."""
    a, b = (_turned(field, taken_off(field, each)) for each in (one, other))
    if field.up is not None:
        a, b = (v - np.sum(v * field.up, axis=1, keepdims=True) * field.up for v in (a, b))
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))
    return float(np.sqrt(np.mean(angle**2)))


def taken_off(field: Field, iron: Iron) -> Array:
    """Return the samples less the iron, as shares of the strength, (n, 3)."""
    return Iron(iron.hard / field.strength, iron.soft).off(field.m)


def _columns(field: Field) -> Array:
    """Return X, shape (n, 3, 8)."""
    shaped = np.einsum("kij,nj->nik", SHAPES, field.m)
    return np.concatenate([-field.D, field.D @ shaped], axis=2)


def _turned(field: Field, m: Array) -> Array:
    turned: Array = np.einsum("nij,nj->ni", field.D, m)
    return turned


def _sums(values: Array, window: NDArray[np.intp]) -> Array:
    """Return the sum of (n, ...) over each window."""
    sums: Array = np.add.reduceat(values, np.flatnonzero(np.diff(window, prepend=-1)), axis=0)
    return sums


def _means(values: Array, window: NDArray[np.intp], weight: Array) -> Array:
    """Return for each of (n, ...) the weighted mean of its window."""
    share = weight.reshape(-1, *[1] * (values.ndim - 1))
    means: Array = (_sums(values * share, window) / _sums(share, window))[window]
    return means


def _spread(values: Array) -> float:
    return float(np.abs(values - np.median(values)).mean())


def _unit(v: Array) -> Array:
    unit: Array = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)
    return unit
