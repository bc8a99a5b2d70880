"""Whether gravity stays where it was in the frame that the gyroscope carries, by which axes.

An accelerometer that is moved about hardly turns as u' = -Omega x u from moment to moment, but
accelerations average out over seconds: in the frame that the gyroscope integrates, the means of two
windows in a row differ little. With the accelerometer's axes taken as P they differ by

    sum_jk P_jk d_jk,    d_jk = mean over the second window of R e_j a_k, less that over the first,

linear in P. P and -P tell the same, so that a proper P stands for both.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.inspection import turning
from attest.inspection.turning import CLEAR, SIGNED, Fit
from attest.recording import Signal, seconds

Array = NDArray[np.float64]

WINDOW = 4.0
"""s; accelerations average out over it, and a gyroscope's bias does not matter yet."""
WINDOWS = 4
"""In a row, in a block that is taken or left together."""
STEP = 0.02
"""Of integration, s."""
LONGEST_STEP = 0.05
"""A slower gyroscope tells nothing here, s."""
FEWEST = 6
"""Pairs of windows that a fit needs."""
STAYS = 0.1
"""In gravities: how far the mean may be from that of the window before, by root mean square."""
MOST_SAMPLES = 5_000
"""That the gyroscope's bias is taken from, spread over the log."""
ALIKE = 1.5
"""Axes that leave up to so many times the least mean square fit alike."""
PROPER = SIGNED[np.linalg.det(SIGNED) > 0.0]
"""The 24 ways to turn axes to axes, none first."""


def fit(gyro: Signal, accel: Signal) -> Fit | None:
    """Fit the accelerometer's axes to the gyroscope; None where no axes stand out."""
    if max(turning.period(gyro.t), turning.period(accel.t)) > LONGEST_STEP:
        return None
    blocks = [block for block in _blocks(gyro, accel) if block is not None]
    if not blocks:
        return None
    rates, felt = (np.concatenate(part) for part in zip(*blocks, strict=True))
    rates = rates - np.median(gyro.y[:: -(-len(gyro.y) // MOST_SAMPLES)], axis=0)
    # an inverted gyroscope, with these axes, stands for a mirrored one
    return _fit(rates, felt, 1.0) or _fit(-rates, felt, -1.0)


def _fit(rates: Array, felt: Array, sign: float) -> Fit | None:
    """Fit with the gyroscope as it is or inverted; shapes (blocks, windows, steps, 3)."""
    d = _differences(rates, felt)
    if len(d) < FEWEST:
        return None
    moved = np.einsum("pjk,nijk->pni", PROPER, d)
    return stands_out(np.mean(np.sum(moved**2, axis=2), axis=1), sign)


def stands_out(left: Array, sign: float = 1.0) -> Fit | None:
    """Return what is best by the mean square that `PROPER` leave; None where little stands out.

    What a fit explains is told against the next axes that do not fit alike.
    """
    if not np.isfinite(left).all() or left.min() > (STAYS * GRAVITY) ** 2:
        return None
    best = int(np.argmin(left))
    alike = left <= ALIKE * left[best]
    following = left[~alike].min(initial=np.inf)
    explained = 1.0 - left / following
    if explained[best] < CLEAR or alike.all():
        return None
    best = 0 if alike[0] else best
    return Fit(
        as_read=float(explained[0]) if sign > 0.0 else 0.0,
        best=float(explained[best]),
        axes=sign * PROPER[best].T,
        unique=bool(alike.sum() == 1),
        scale=1.0,
        turns=False,
    )


def _differences(rates: Array, felt: Array) -> Array:
    """Return d by pairs of windows in a row, in the frame at the first's start, (n, 3, 3, 3)."""
    ends = _carried(quaternion.exp(rates * STEP))
    R = quaternion.to_matrix(quaternion.multiply(ends, quaternion.exp(-0.5 * STEP * rates)))
    mean = np.einsum("bwnij,bwnk->bwijk", R, felt) / rates.shape[2]
    last = quaternion.to_matrix(ends[:, :, -1])
    later = np.einsum("bwhi,bwijk->bwhjk", last[:, :-1], mean[:, 1:])
    d: Array = (later - mean[:, :-1]).reshape(-1, 3, 3, 3)
    return d


def _carried(steps: Array) -> Array:
    """Return the products of the steps up to each, along the third axis, by doubling."""
    q, reach = steps, 1
    while reach < q.shape[2]:
        further = quaternion.multiply(q[:, :, :-reach], q[:, :, reach:])
        q = np.concatenate([q[:, :, :reach], further], axis=2)
        reach *= 2
    return q


def _blocks(gyro: Signal, accel: Signal) -> list[tuple[Array, Array] | None]:
    size = max(2, round(WINDOW * WINDOWS / turning.period(gyro.t)))
    return [_block(gyro, accel, int(gyro.t[first])) for first in turning.moving(gyro.y, size)]


def _block(gyro: Signal, accel: Signal, start: int) -> tuple[Array, Array] | None:
    """Return mean rates and specific forces by window and step; None where a sensor has a gap."""
    count = round(WINDOW / STEP)
    edges = start + np.arange(WINDOWS * count + 1, dtype=np.int64) * round(STEP * 1e9)
    found = [_means(signal, edges) for signal in (gyro, accel)]
    if any(one is None for one in found):
        return None
    rates, felt = (np.reshape(one, (1, WINDOWS, count, 3)) for one in found if one is not None)
    return rates, felt


def _means(signal: Signal, edges: NDArray[np.int64]) -> Array | None:
    first = int(np.searchsorted(signal.t, edges[0], side="right")) - 1
    part = slice(max(first, 0), int(np.searchsorted(signal.t, edges[-1])) + 1)
    t = seconds(signal.t[part], int(edges[0]))
    at = seconds(edges, int(edges[0]))
    if first < 0 or len(t) < 2 or t[-1] < at[-1] or np.diff(t).max() > 2.0 * LONGEST_STEP:
        return None
    return turning.means(t, signal.y[part], at)
