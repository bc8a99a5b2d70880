"""The turns of a reference beside those of the gyroscope, cell by cell of time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.inspection import turning
from attest.recording import Reference, Signal, seconds

Array = NDArray[np.float64]

CELL = 0.2
"""Shortest cell, s."""
LONGEST_CELL = 1.0
"""A reference so slow that its cells would be longer tells nothing, s."""
MOST_CELLS = 20_000
FEWEST = 30
LONGEST_SHIFT = 30.0
"""Shifts up to this are looked for, s."""
APART = 1.0
"""Shifts that differ by more are two, s."""
AS_GOOD = 0.9
"""A correlation of this share of the best is as good."""
STILL = 1e-4
"""rad/s: an attitude that turns less does not change."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Mean rates of the same cells of time, rad/s."""

    gyro: Array
    """By the gyroscope, shape (n, 3)."""
    reference: Array
    """By the reference, in its own body, shape (n, 3)."""


def cells(gyro: Signal, reference: Reference, shift: float = 0.0) -> Cells | None:
    """Compare where both tell, the reference taken so much later, s; None if that is too short."""
    edges = _edges(gyro, reference, abs(shift))
    if edges is None:
        return None
    g, r = means(gyro, edges), turns(reference, edges - round(shift * 1e9))
    known = np.isfinite(g + r).all(axis=1)
    return Cells(g[known], r[known]) if known.sum() >= FEWEST else None


def explained(found: Cells, axes: Array) -> float:
    """Return the share of the reference's turns, by these axes, that the gyroscope explains."""
    turned = _spared(found.reference @ axes.T)
    off = _spared(found.gyro) - turned
    power = float(np.sum(turned**2))
    share = 1.0 - float(np.sum(off**2)) / power if power > 0.0 else 0.0
    return share if np.isfinite(share) else 0.0


def still(found: Cells) -> tuple[float, Cells]:
    """Return the share of the gyroscope's turns at which the reference stands still, and the rest.

    The rest is of the cells in which the reference moves.
    """
    moves = np.linalg.norm(found.reference, axis=1) > STILL
    turns = _spared(found.gyro)
    total = float(np.sum(turns**2))
    share = float(np.sum(turns[~moves] ** 2)) / total if total > 0.0 else 0.0
    return share, Cells(found.gyro[moves], found.reference[moves])


def shift(gyro: Signal, reference: Reference) -> float | None:
    """Return how much later the reference must be taken to turn alike, s; None if not one is best.

    By the greatest correlation of the rates, which is not yet a fit.
    """
    edges = _edges(gyro, reference, LONGEST_SHIFT)
    if edges is None:
        return None
    g, r = _spared(means(gyro, edges)), _spared(turns(reference, edges))
    step = float(edges[1] - edges[0]) * 1e-9
    most = int(LONGEST_SHIFT / step)
    size = 1 << (len(g) + most).bit_length()
    product = np.conj(np.fft.rfft(r, size, axis=0)) * np.fft.rfft(g, size, axis=0)
    match = np.fft.irfft(product, size, axis=0).sum(axis=1)
    match = np.concatenate([match[-most:], match[: most + 1]])
    if not np.isfinite(match).all():
        return None
    best = int(np.argmax(match))
    tops = 1 + np.flatnonzero((match[1:-1] >= match[:-2]) & (match[1:-1] >= match[2:]))
    good = tops[match[tops] > AS_GOOD * match[best]]
    if best in {0, len(match) - 1} or (np.abs(good - best) * step > APART).any():
        return None
    left, top, right = match[best - 1 : best + 2]
    bend = left - 2.0 * top + right
    return float((best - most + (0.5 * (left - right) / bend if bend < 0.0 else 0.0)) * step)


def _edges(gyro: Signal, reference: Reference, margin: float) -> NDArray[np.int64] | None:
    """Return the edges of cells where both tell, or would by a shift within the margin."""
    width = max(CELL, 2.0 * turning.period(reference.t), 2.0 * turning.period(gyro.t))
    beside = round(margin * 1e9)
    first = max(int(gyro.t[0]), int(reference.t[0]) - beside)
    last = min(int(gyro.t[-1]), int(reference.t[-1]) + beside)
    if width > LONGEST_CELL or (last - first) * 1e-9 < FEWEST * width:
        return None
    step = round(width * 1e9)
    count = min((last - first + 2 * beside) // step, MOST_CELLS)
    return first - beside + np.arange(count + 1, dtype=np.int64) * step


def means(gyro: Signal, edges: NDArray[np.int64]) -> Array:
    """Return mean rates by cell, NaN where a cell has no sample."""
    part = slice(*np.searchsorted(gyro.t, edges[[0, -1]]))
    t, y = gyro.t[part], gyro.y[part]
    if len(t) < 2:
        return np.full((len(edges) - 1, 3), np.nan)
    mean = turning.means(seconds(t, int(edges[0])), y, seconds(edges, int(edges[0])))
    empty = np.diff(np.searchsorted(t, edges)).reshape(-1, 1) == 0
    return np.where(empty, np.nan, mean)


def turns(reference: Reference, edges: NDArray[np.int64]) -> Array:
    """Return the mean rates of an attitude by cell, NaN where it has a gap."""
    q = quaternion.slerp(reference.t, reference.q, edges, round(LONGEST_CELL * 1e9))
    turn = quaternion.log(quaternion.multiply(quaternion.conjugate(q[:-1]), q[1:]))
    rate: Array = turn / (np.diff(edges) * 1e-9)[:, np.newaxis]
    return rate


def _spared(rates: Array) -> Array:
    """Take off the mean, and nothing where nothing is known."""
    known = np.isfinite(rates).all(axis=1).reshape(-1, 1)
    mean = np.sum(rates, axis=0, where=known) / max(1, int(known.sum()))
    return np.where(known, rates - mean, 0.0)
