"""Hard and soft iron of a magnetometer, by consistency with the gyroscope.

In the frame that the gyroscope integrates, the field of the world stands still: D S (m - h) is
constant but for the gyroscope's slow drift. Less its mean over each window it is zero, which is
linear in S h and in S.

Symbols: D rotation from the body to the gyroscope's frame; m the magnetometer in the body, as a
share of the field's strength; h hard iron; S soft iron, symmetric with the trace 3, so that the
strength stays; x = (S h, S by rows); X what the field in the gyroscope's frame is of it, X x.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, windows
from attest.conditioning.measured import Measured, unit
from attest.conditioning.rows import first_of_cells
from attest.conditioning.timeline import SECOND, Timeline
from attest.conditioning.windows import Windows
from attest.geometry import quaternion
from attest.recording import Signal

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW = 8.0
"""Over which the field stands still in the gyroscope's frame, s."""
MOST_SAMPLES = 3_000
SPACING = 0.2
"""Least time between the samples that are used, s."""
ROUNDS, LAST_ROUNDS = 5, 3
"""Of weighting, which settles in fewer; and from weights that are nearly known."""
FAINT = 1e-8
"""Mean square of a turn that tells nothing, rad²."""
QUIET = 1e-3
"""Deviation of a magnetometer's samples at the least, as a share of the strength."""
TAIL = 3.0
"""Square of the misfit, in deviations, at which a sample counts half."""
HARD = np.eye(12, 3)
"""Basis of the changes that hard iron makes of x."""
_R2, _R6 = np.sqrt(0.5), np.sqrt(1.0 / 6.0)
_SHAPES = np.array(
    [
        [_R2, 0, 0, 0, -_R2, 0, 0, 0, 0],
        [_R6, 0, 0, 0, _R6, 0, 0, 0, -2.0 * _R6],
        [0, _R2, 0, _R2, 0, 0, 0, 0, 0],
        [0, 0, _R2, 0, 0, 0, _R2, 0, 0],
        [0, 0, 0, 0, 0, _R2, 0, _R2, 0],
    ]
)
ALL = np.hstack([HARD, np.vstack([np.zeros((3, 5)), _SHAPES.T])])
"""Of those that hard and soft iron make: S stays symmetric, and its trace."""


@dataclass(frozen=True, slots=True, eq=False)
class Iron:
    """What a magnetometer reads besides the field: the field is ``soft @ (m - hard)``."""

    hard: Array
    """In the unit of what is measured, shape (3,)."""
    soft: Array
    """Shape (3, 3)."""

    def off(self, m: Array) -> Array:
        """Take it off vectors of shape (n, 3)."""
        field = np.empty((len(m), 3))
        windows.less(np.ascontiguousarray(m), self.hard, np.ascontiguousarray(self.soft), field)
        return field


NONE = Iron(np.zeros(3), np.eye(3))


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Samples of a magnetometer, and the field in the frame that the gyroscope integrates."""

    X: Array
    """Shape (n, 3, 12)."""
    strength: float
    """Median length, tesla."""
    window: Windows
    """Number of each sample's window, rising from 0 without gaps, shape (n,)."""
    starts: Windows
    """First sample of each window, and behind them the number of samples."""
    up: Array | None
    """Unit vertical in the frame, a window's mean; None where it is not known, shape (n, 3)."""

    def part(self, chosen: Mask) -> "Field":
        """Return some of the samples."""
        up = None if self.up is None else self.up[chosen]
        window = _numbers(self.window[chosen])
        return Field(self.X[chosen], self.strength, window, _beginnings(window), up)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """What the samples of a field tell of the unknowns."""

    x: Array
    """Shape (12,)."""
    covariance: Array
    """In the basis of its changes, shape (k, k)."""
    weight: Array
    """Of each sample, shape (n,)."""


def field(line: Timeline, mag: Signal, vertical: Measured | None) -> Field | None:
    """Choose samples of a magnetometer, none where the gyroscope is silent.

    Parameters
    ----------
    line
        The gyroscope.
    mag
        The magnetometer, at its right time.
    vertical
        Vertical on average; None where that is not known.
    """
    first = int(np.searchsorted(mag.t, line.t[0], side="left"))
    last = int(np.searchsorted(mag.t, line.t[-1], side="right"))
    if last - first < 2:
        return None
    chosen = first + first_of_cells(mag.t[first:last], round(SPACING * SECOND))
    chosen = chosen[:: -(-len(chosen) // MOST_SAMPLES)]
    t, y = mag.t[chosen], mag.y[chosen]
    window = _numbers((t - t[0]) // round(WINDOW * SECOND))
    starts = _beginnings(window)
    strength = float(np.median(np.linalg.norm(y, axis=1)))
    D = frame.at(line.t, line.D, t)
    up = None
    if vertical is not None:
        near = frame.nearest(line.t, t)[0]
        length = np.where(vertical.valid[near], vertical.length[near], 0.0)
        force = length[:, np.newaxis] * vertical.body[near]
        up = unit(_means(quaternion.rotate(line.D[near], force), starts)[window])
    X = np.empty((len(y), 3, 12))
    windows.columns(D, y / strength, X)
    return Field(X, strength, window, starts, up)


def fit(field: Field, basis: Array, weight: Array | None = None) -> Fit:
    """Return x, changed in a basis of shape (12, k) only, from weights as far as they are known.

    Samples of Cauchy's distribution: those of disturbed places count little. The covariance is
    widened by how much the windows scatter, for errors within one are of one sort.
    """
    x, k = unknowns(NONE), basis.shape[1]
    Z, y, starts = times(field.X, basis), times(field.X, x), field.starts
    left, size2, scores = np.empty_like(y), np.empty(len(y)), np.zeros((len(starts) - 1, k))
    rounds, weight = (ROUNDS, np.ones(len(y))) if weight is None else (LAST_ROUNDS, weight)
    for _ in range(rounds):
        A, slope = np.zeros((k, k)), np.zeros(k)
        windows.normal(Z, y, weight, starts, A, slope)
        inverse = np.linalg.inv(A + FAINT * len(y) * np.eye(k))
        z = -inverse @ slope
        windows.left(Z, y, weight, starts, z, left, size2)
        weight = 1.0 / (1.0 + size2 / max(TAIL * middle(size2), QUIET**2))
    windows.scores(Z, left, weight, starts, scores)
    scatter = float(np.sum((scores @ inverse) * scores)) / k
    # what hardly moves has scores of hardly anything: no less than the samples' own scatter
    scatter = max(scatter, float(np.mean(weight * size2)) / 3.0, QUIET**2)
    return Fit(x + basis @ z, scatter * inverse, weight)


def iron(x: Array, strength: float) -> Iron:
    """Return what the unknowns stand for."""
    soft = x[3:].reshape(3, 3)
    return Iron(np.asarray(strength * np.linalg.solve(soft, x[:3]), np.float64), soft)


def unknowns(iron: Iron, strength: float = 1.0) -> Array:
    """Return the unknowns of an iron."""
    return np.concatenate([iron.soft @ iron.hard / strength, np.ravel(iron.soft)])


def misfit(field: Field, iron: Iron) -> Array:
    """Return how far the field is from standing still, in strength and in its part along the up.

    Mean absolute, as shares of the strength; shape (3,) or, without the vertical, (2,).
    """
    y, length, along = taken_off(field, iron), np.empty(len(field.X)), np.empty(len(field.X))
    up = np.empty((0, 3)) if field.up is None else field.up
    moved = windows.moved(y, up, field.starts, length, along)
    spreads = [moved, _spread(length)] + ([_spread(along)] if len(up) else [])
    return np.array(spreads)


def heading(field: Field, one: Iron, other: Iron) -> float:
    """Return by how much two calibrations differ in heading, or in all without up, RMS, rad."""
    up = np.empty((0, 3)) if field.up is None else field.up
    return float(windows.angle(taken_off(field, one), taken_off(field, other), up))


def taken_off(field: Field, iron: Iron) -> Array:
    """Return the field less the iron in the frame, as shares of the strength, (n, 3)."""
    return times(field.X, unknowns(iron, field.strength))


def times(X: Array, by: Array) -> Array:
    """Return X of shape (n, 3, 12) times a vector (12,) or a matrix (12, k)."""
    product: Array = (X.reshape(-1, 12) @ by).reshape(len(X), 3, *by.shape[1:])
    return product


def _beginnings(window: Windows) -> Windows:
    return np.append(np.flatnonzero(np.diff(window, prepend=-1)), len(window))


def middle(values: Array) -> float:
    """Return the upper one of the middle values."""
    return float(np.partition(values, len(values) // 2)[len(values) // 2])


def _numbers(cells: NDArray[np.int64]) -> Windows:
    """Return the numbers of cells, which rise, from 0 without gaps."""
    return np.cumsum(np.diff(cells, prepend=cells[:1]) > 0)


def _means(values: Array, starts: Windows) -> Array:
    """Return the mean of (n, 3) over each window."""
    means: Array = np.add.reduceat(values, starts[:-1], axis=0) / np.diff(starts)[:, np.newaxis]
    return means


def _spread(values: Array) -> float:
    return float(np.abs(values - middle(values)).mean())
