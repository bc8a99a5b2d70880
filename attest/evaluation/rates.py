"""What angular rates tell: how the clocks of two attitudes differ, and the gyroscope's bias."""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.recording import seconds

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

LONGEST_OFFSET = 2.0
"""Time offsets up to this are looked for, s."""
SMOOTHING = 0.1
"""Rates are compared as means over this long at least, s."""
GAP = 5
"""A step of more than this many times the median is a gap."""
CORRELATION = 0.7
"""Least correlation at which an offset is believed."""
MOST_TIMES = 20_000
"""Rates are compared at so many times at the most."""
ENOUGH = 0.02
"""Least standard deviation of |Omega|, rad/s, at which an offset can be told."""


def angular_velocity(t: Stamps, q: Array) -> Array:
    """Return the mean rate between neighbours, body, rad/s, shape (n - 1, 3)."""
    step = quaternion.log(quaternion.multiply(quaternion.conjugate(q[:-1]), q[1:]))
    rate: Array = step / (np.diff(t) * 1e-9)[:, np.newaxis]
    return rate


def time_offset(
    t: Stamps, speed: Array, t_ref: Stamps, q_ref: Array, longest_gap: float
) -> float | None:
    """Return the reference's time minus the estimate's, s, by correlation of |Omega|.

    Parameters
    ----------
    t, speed
        Stamps and |Omega| of the estimate, rad/s.
    t_ref, q_ref
        Stamps and attitude of the reference.
    longest_gap
        Reference samples further apart than this tell no rate, s.

    Returns
    -------
    float or None
        None where the rates vary too little, or agree at no offset.
    """
    middle, speed_ref = _reference_speed(t_ref, q_ref, longest_gap)
    if len(middle) < 20 or len(t) < 20:
        return None
    step = max(
        SMOOTHING, float(np.median(np.diff(t_ref))) * 1e-9, float(np.median(np.diff(t))) * 1e-9
    )
    origin = max(int(t[0]), int(middle[0]))
    span = (min(int(t[-1]), int(middle[-1])) - origin) * 1e-9
    if span < 5.0 * LONGEST_OFFSET:
        return None
    grid = np.arange(LONGEST_OFFSET, span - LONGEST_OFFSET, max(step / 2.0, span / MOST_TIMES))
    ours = _mean_over(grid, seconds(t, origin), speed, step)
    if np.std(ours) < ENOUGH:
        return None
    offsets = np.arange(-LONGEST_OFFSET, LONGEST_OFFSET + 1e-9, step / 4.0)
    at_ref = seconds(middle, origin)
    match = np.array(
        [_correlation(ours, _mean_over(grid + o, at_ref, speed_ref, step)) for o in offsets]
    )
    best = int(np.argmax(match))
    if match[best] < CORRELATION or best in {0, len(offsets) - 1}:
        return None
    left, top, right = match[best - 1 : best + 2]
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float(offsets[best] + shift * step / 4.0)


def constant_bias(t: Stamps, gyro: Array, q_ref: Array) -> Array | None:
    """Return the mean of gyroscope minus true rate, rad/s, shape (3,).

    Parameters
    ----------
    t, gyro
        Stamps and the gyroscope held from each to the next, rad/s, shape (n, 3).
    q_ref
        Truth at those stamps, NaN where unknown, shape (n, 4).

    Returns
    -------
    shape (3,), or None
        None where truth has no two neighbours.
    """
    steps = np.diff(t)
    both = np.isfinite(q_ref[:-1]).all(axis=1) & np.isfinite(q_ref[1:]).all(axis=1)
    both &= steps <= GAP * np.median(steps)  # across a gap the gyroscope is a guess
    if not both.any():
        return None
    h = np.diff(t)[both] * 1e-9
    true_turn = angular_velocity(t, q_ref)[both] * h[:, np.newaxis]
    bias: Array = np.sum(gyro[:-1][both] * h[:, np.newaxis] - true_turn, axis=0) / np.sum(h)
    return bias


def _reference_speed(t: Stamps, q: Array, longest_gap: float) -> tuple[Stamps, Array]:
    near = np.diff(t) <= longest_gap * 1e9
    speed = np.linalg.norm(angular_velocity(t, q), axis=1)
    return (t[:-1] + np.diff(t) // 2)[near], speed[near]


def _mean_over(at: Array, x: Array, y: Array, width: float) -> Array:
    """Return the mean of y over a window around each time, from its running integral."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))])
    ends = np.interp(at + 0.5 * width, x, integral), np.interp(at - 0.5 * width, x, integral)
    mean: Array = (ends[0] - ends[1]) / width
    return mean


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0.0 else 0.0
