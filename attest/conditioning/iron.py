"""Hard and soft iron of a magnetometer, by consistency with the gyroscope.

In the frame that the gyroscope integrates, the field of the world stands still: D S (m - h) is
constant but for the gyroscope's slow drift. Less its mean over each window it is zero, which is
linear in P = [S h, S]: with c = (-1, m) the field is D P c.

Symbols: D rotation from the body to the gyroscope's frame; m the magnetometer in the body, as a
share of the field's strength; h hard iron; S soft iron, symmetric with the trace 3, so that the
strength stays; x = P by rows, 12 unknowns; X what the field in the gyroscope's frame is of x, X x.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, iron_fit, windows
from attest.conditioning.measured import Measured
from attest.conditioning.rows import first_of_cells, median
from attest.conditioning.timeline import SECOND, Timeline
from attest.conditioning.windows import Windows
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


def _joined(of_hard: Array, soft: Array) -> Array:
    """Return x of S h (3,) and S (3, 3)."""
    return np.column_stack([of_hard, soft]).ravel()


HARD = np.eye(12)[:, ::4]
"""Basis of the changes that hard iron makes of x."""
OF_HARD = slice(None, None, 4)
"""Of x, what is S h."""
_R2, _R6 = np.sqrt(0.5), np.sqrt(1.0 / 6.0)
_SHAPES = np.array(
    [
        [[_R2, 0, 0], [0, -_R2, 0], [0, 0, 0]],
        [[_R6, 0, 0], [0, _R6, 0], [0, 0, -2.0 * _R6]],
        [[0, _R2, 0], [_R2, 0, 0], [0, 0, 0]],
        [[0, 0, _R2], [0, 0, 0], [_R2, 0, 0]],
        [[0, 0, 0], [0, 0, _R2], [0, _R2, 0]],
    ]
)
ALL = np.column_stack([HARD, *(_joined(np.zeros(3), shape) for shape in _SHAPES)])
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

    D: Array
    """By rows, shape (n, 9)."""
    c: Array
    """Shape (n, 4)."""
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
    strength = float(median(np.linalg.norm(y, axis=1)))
    D, c, before = np.empty((len(t), 9)), np.empty((len(t), 4)), np.empty((len(t), 3))
    windows.samples(frame.at(line.t, line.D, t), y / strength, D, c)
    iron_fit.made(D, c, unknowns(NONE), before)
    return Field(D, c, before, strength, spans, _up(line, t, vertical, spans))


def _up(line: Timeline, t: NDArray[np.int64], vertical: Measured | None, spans: Windows) -> Array:
    """Return the mean of the vertical over the window of each time, in the frame, (n, 3)."""
    if vertical is None:
        return np.empty((0, 3))
    mean, length = np.empty((len(t), 3)), np.where(vertical.valid, vertical.length, 0.0)
    windows.up((line.t, line.D), (vertical.body, length), t, spans, mean)
    return mean


def fit(field: Field, basis: Array, weight: Array | None = None) -> Fit:
    """Return x, changed in a basis of shape (12, k) only, from weights as far as they are known.

    The covariance is widened by how much the windows scatter, for errors within one are of one
    sort.
    """
    G, k = np.column_stack([basis, unknowns(NONE)]), basis.shape[1]
    x, inverse = np.empty(12), np.empty((k, k))
    rounds = ROUNDS if weight is None else LAST_ROUNDS
    weight = np.ones(len(field.c)) if weight is None else weight.copy()
    scatter = iron_fit.fit(field.D, field.c, field.spans, G, rounds, weight, x, inverse)
    return Fit(x, scatter * inverse, weight)


def iron(x: Array, strength: float) -> Iron:
    """Return what the unknowns stand for."""
    P = x.reshape(3, 4)
    soft = P[:, 1:]
    return Iron(np.asarray(strength * np.linalg.solve(soft, P[:, 0]), np.float64), soft)


def unknowns(iron: Iron, strength: float = 1.0) -> Array:
    """Return the unknowns of an iron."""
    return _joined(iron.soft @ iron.hard / strength, iron.soft)


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


def taken_off(field: Field, x: Array) -> Array:
    """Return the field in the frame that x makes, as shares of the strength, (n, 3)."""
    y = np.empty((len(field.c), 3))
    iron_fit.made(field.D, field.c, x, y)
    return y
