"""When the body is at rest, from gyroscope and accelerometer alone.

A body at rest measures the same from moment to moment. What a sample differs from the mean around
it must stay below what sensors' noise makes, and the mean rate below what a gyroscope's bias makes;
a slower steady turn than that cannot be told from rest by these two: measured directions tell.
"""

from itertools import pairwise
from math import radians

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

SECOND = 1_000_000_000
REACH = SECOND // 2
"""How far on both sides the mean is taken, nanoseconds."""
FEWEST = 5
"""Samples of a mean at the least, however slow the log is."""
SHORTEST = 3 * SECOND // 2
"""What is quiet for less long is not at rest, nanoseconds."""
MARGIN = SECOND // 4
"""Left out at both ends of what is quiet, nanoseconds: there the motion begins or fades."""
PIECE = 10 * SECOND
"""Over which directions are compared, at the most, nanoseconds."""
TURN = radians(2.0)
"""A sample at rest differs by less from the mean rate, rad/s."""
PUSH = 0.5
"""And by less from the mean specific force, m/s²."""
BIAS = radians(3.0)
"""The mean rate at rest, which is the gyroscope's bias, is below this, rad/s."""


def rest(t: Stamps, gyro: Array, accel: Array) -> NDArray[np.bool_]:
    """Mark the samples at which the body is at rest.

    Parameters
    ----------
    t
        Nanoseconds, strictly increasing, shape (n,).
    gyro, accel
        Angular velocity, rad/s, and specific force, m/s², in the body, shape (n, 3); a sample that
        is not finite is not at rest.
    """
    if not len(t):
        return np.zeros(0, np.bool_)
    y = np.concatenate([gyro, accel], axis=1)
    known = np.asarray(np.isfinite(y).all(axis=1))
    y = np.where(known[:, np.newaxis], y, 0.0)
    mean = _mean(y, known, *_reach(t))
    turn, push = (np.linalg.norm((y - mean)[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    slow = np.linalg.norm(mean[:, :3], axis=1) < BIAS
    return _lasting(t, known & (turn < TURN) & (push < PUSH) & slow)


def _reach(t: Stamps) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first sample of the mean around each, and the one after its last."""
    i, half = np.arange(len(t)), FEWEST // 2
    first = np.minimum(np.searchsorted(t, t - REACH, side="left"), i - half)
    last = np.maximum(np.searchsorted(t, t + REACH, side="right"), i + half + 1)
    return np.maximum(first, 0), np.minimum(last, len(t))


def _mean(
    y: Array, known: NDArray[np.bool_], first: NDArray[np.intp], last: NDArray[np.intp]
) -> Array:
    """Return the mean of the known samples (n, k) from first to before last, zero for none."""
    origin = y[int(np.argmax(known))]  # so that the sums lose no digits to a constant
    sums = np.cumsum(np.where(known[:, np.newaxis], y - origin, 0.0), axis=0)
    total = np.concatenate([np.zeros((1, y.shape[1])), sums])
    count = np.concatenate([[0], np.cumsum(known)])
    counted = np.maximum(count[last] - count[first], 1)[:, np.newaxis]
    mean: Array = origin + (total[last] - total[first]) / counted
    return mean


def _lasting(t: Stamps, quiet: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keep what is quiet for long enough, less its margins; a gap in the log ends it."""
    rested = np.zeros(len(t), np.bool_)
    step = np.diff(t)
    whole = step <= max(SECOND, 3 * int(np.median(step))) if len(step) else step > 0
    joined = quiet[1:] & quiet[:-1] & whole
    edges = np.flatnonzero(np.diff(np.concatenate([[0], joined, [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):  # samples begin to end, both quiet
        if t[end] - t[begin] < SHORTEST:
            continue
        inner = slice(begin, end + 1)
        rested[inner] = (begin == 0) | (t[inner] >= t[begin] + MARGIN)
        rested[inner] &= (end == len(t) - 1) | (t[inner] <= t[end] - MARGIN)
    return rested


def unturned(
    t: Stamps, rested: NDArray[np.bool_], gyro: Array, seen: Array, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Keep of the rest what measured directions do not show to be a slow steady turn.

    Over a few seconds, a direction stays where it is in a body at rest, and turns by what the
    gyroscope says in one that turns: whichever is nearer is taken.

    Parameters
    ----------
    t, rested, gyro
        As `rest` takes and returns them.
    seen, valid
        Unit vectors in the body, shape (n, k, 3), and which are measured, (n, k).
    """
    kept = rested.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rested, [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        pieces = 1 + int((t[end - 1] - t[begin]) // PIECE)
        cuts = np.linspace(begin, end, pieces + 1).astype(np.int64)
        for first, last in pairwise(cuts.tolist()):
            part = slice(first, last)
            kept[part] = _still(t[part], gyro[part], seen[part], valid[part])
    return kept


def _still(t: Stamps, gyro: Array, seen: Array, valid: NDArray[np.bool_]) -> bool:
    """Tell whether directions stayed, rather than turned, from one half of a piece to the other."""
    half = len(t) // 2
    turn = quaternion.exp(-gyro.mean(axis=0) * (t[-1] - t[0]) * 0.5e-9)
    stayed = turned = 0.0
    for j in range(seen.shape[1]):
        before, after = (seen[side, j][valid[side, j]] for side in (slice(half), slice(half, None)))
        if len(before) and len(after):
            u, v = before.mean(axis=0), after.mean(axis=0)
            stayed += float(np.sum((v - u) ** 2))
            turned += float(np.sum((v - quaternion.rotate(turn, u)) ** 2))
    return stayed <= turned
