"""Hard and soft iron of a magnetometer, by consistency with the gyroscope.

In the frame that the gyroscope integrates, the field of the world stands still: D S (m - h) is
constant but for the gyroscope's slow drift. Less its mean over each window it is zero, which is
linear in S h and in S.

Symbols: D rotation from the body to the gyroscope's frame; m the magnetometer in the body, as a
share of the field's strength; h hard iron; S soft iron, symmetric with the trace 3, so that the
strength stays; x = (S h, S by rows); X what the field in the gyroscope's frame is of it, X x.
"""

from dataclasses import dataclass, replace

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
    before: Array
    """With no iron taken off, as shares of the strength, shape (n, 3)."""
    strength: float
    """Median length, tesla."""
    spans: Windows
    """First sample of each window, and the one behind it, shape (w, 2)."""
    up: Array
    """Unit vertical in the frame, a window's mean, shape (n, 3); no rows where it is not known."""

    def part(self, chosen: Mask) -> "Field":
        """Return what there is in some of the windows."""
        return replace(self, spans=self.spans[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """What the samples of a field tell of the unknowns."""

    x: Array
    """Shape (12,)."""
    covariance: Array
    """In the basis of its changes, shape (k, k)."""
    weight: Array
    """Of each sample, shape (n,); what it was before outside of the windows."""


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
    cells = (t - t[0]) // round(WINDOW * SECOND)
    starts = np.flatnonzero(np.diff(cells, prepend=-1))
    spans = np.stack([starts, np.append(starts[1:], len(t))], axis=1)
    strength = float(np.median(np.linalg.norm(y, axis=1)))
    X, before = np.empty((len(y), 3, 12)), np.empty((len(y), 3))
    windows.columns(frame.at(line.t, line.D, t), y / strength, X, before)
    return Field(X, before, strength, spans, _up(line, t, vertical, spans))


def _up(line: Timeline, t: NDArray[np.int64], vertical: Measured | None, spans: Windows) -> Array:
    """Return the mean of the vertical over the window of each time, in the frame, (n, 3)."""
    if vertical is None:
        return np.empty((0, 3))
    near = frame.nearest(line.t, t)[0]
    length = np.where(vertical.valid[near], vertical.length[near], 0.0)
    fixed = quaternion.rotate(line.D[near], length[:, np.newaxis] * vertical.body[near])
    # the sum's direction is the mean's
    return np.repeat(unit(np.add.reduceat(fixed, spans[:, 0])), np.diff(spans)[:, 0], axis=0)


def fit(field: Field, basis: Array, weight: Array | None = None) -> Fit:
    """Return x, changed in a basis of shape (12, k) only, from weights as far as they are known.

    The covariance is widened by how much the windows scatter, for errors within one are of one
    sort.
    """
    k = basis.shape[1]
    inverse, z = np.empty((k, k)), np.empty(k)
    rounds = ROUNDS if weight is None else LAST_ROUNDS
    weight = np.ones(len(field.X)) if weight is None else weight.copy()
    Z = times(field.X, basis)
    scatter = windows.fit(Z, field.before, field.spans, rounds, weight, inverse, z)
    return Fit(unknowns(NONE) + basis @ z, scatter * inverse, weight)


def iron(x: Array, strength: float) -> Iron:
    """Return what the unknowns stand for."""
    soft = x[3:].reshape(3, 3)
    return Iron(np.asarray(strength * np.linalg.solve(soft, x[:3]), np.float64), soft)


def unknowns(iron: Iron, strength: float = 1.0) -> Array:
    """Return the unknowns of an iron."""
    return np.concatenate([iron.soft @ iron.hard / strength, np.ravel(iron.soft)])


def misfits(field: Field, y: Array, edges: Windows) -> Array:
    """Return how far the field is from standing still, in strength and in its part along the up.

    Mean absolute, as shares of the strength, in groups of windows; shape (g, 3) or, without the
    vertical, (g, 2).

    Parameters
    ----------
    y : shape (n, 3)
        The field, as `taken_off` returns it.
    edges : shape (g + 1,)
        Window at which each group begins, and the one behind the last group.
    """
    found = np.empty((len(edges) - 1, 3))
    windows.misfits(y, field.up, field.spans, edges, found)
    return found if len(field.up) else found[:, :2]


def heading(field: Field, one: Array, other: Array) -> float:
    """Return by how much two fields (n, 3) differ in heading, or in all without up, RMS, rad."""
    return float(windows.angle(one, other, field.up))


def taken_off(field: Field, iron: Iron) -> Array:
    """Return the field less the iron in the frame, as shares of the strength, (n, 3)."""
    return times(field.X, unknowns(iron, field.strength))


def times(X: Array, by: Array) -> Array:
    """Return X of shape (n, 3, 12) times a vector (12,) or a matrix (12, k)."""
    product: Array = (X.reshape(-1, 12) @ by).reshape(len(X), 3, *by.shape[1:])
    return product
