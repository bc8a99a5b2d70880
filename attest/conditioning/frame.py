"""The frame that the gyroscope integrates: it turns with the body's true turn, and drifts slowly.

Vectors are interpolated and smoothed in this frame, where the vehicle's own motion does not blur
them, and are turned back into the body.

Symbols: D rotation from the body to the gyroscope's frame, as a quaternion.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion, so3

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

NEVER = np.iinfo(np.int64).max


def integrate(t: Stamps, mean: Array, restart: NDArray[np.bool_] | None = None) -> Array:
    """Return the gyroscope's frame at its stamps, body to frame, shape (n, 4).

    Parameters
    ----------
    t : shape (n,)
        Nanoseconds.
    mean : shape (n, 3)
        Mean rate over the step that begins at each stamp, rad/s.
    restart : shape (n,)
        Steps that nothing before them tells of; the frame stands still over the step to one.
    """
    h = np.diff(t) * 1e-9
    if restart is not None:
        h[restart[1:]] = 0.0
    D = np.empty((len(t), 4))
    so3.integrate(h, mean, D)
    return D


def mean_of_ends(y: Array) -> Array:
    """Return the mean of each row of (n, 3) and the next; the last row itself."""
    mean: Array = 0.5 * (y + np.concatenate([y[1:], y[-1:]]))
    return mean


def at(t: Stamps, D: Array, when: Stamps) -> Array:
    """Return the frame at other times, held before the first stamp and after the last."""
    return quaternion.slerp(t, D, np.clip(when, t[0], t[-1]), NEVER)


def nearest(stamps: Stamps, at_: Stamps) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return for each time the samples at or before it and at or after it, the ends repeated."""
    right = np.searchsorted(stamps, at_, side="left")
    left = np.searchsorted(stamps, at_, side="right") - 1
    last = len(stamps) - 1
    return np.clip(left, 0, last), np.clip(right, 0, last)


def carry(
    t: Stamps, D: Array, stamps: Stamps, y: Array, max_age: int
) -> tuple[Array, NDArray[np.bool_], Stamps]:
    """Bring vectors measured in the body from their own stamps to those of the gyroscope.

    Parameters
    ----------
    t, D
        Stamps and frame of the gyroscope.
    stamps, y
        Stamps and values of the vector, (j,) and (j, 3).
    max_age
        Farthest from a sample that a vector is used, nanoseconds.

    Returns
    -------
    body : shape (n, 3)
        Linear in the gyroscope's frame between samples, held in it outside them.
    valid : shape (n,)
        Whether a sample is no further than ``max_age``.
    age : shape (n,)
        Distance to the nearest sample, nanoseconds.
    """
    if np.array_equal(t, stamps):
        return y, np.ones(len(t), np.bool_), np.zeros(len(t), np.int64)
    fixed = quaternion.rotate(at(t, D, stamps), y)
    left, right = nearest(stamps, t)
    span = stamps[right] - stamps[left]
    share = np.where(span > 0, (t - stamps[left]) / np.maximum(span, 1), 0.0)[:, np.newaxis]
    blended = (1.0 - share) * fixed[left] + share * fixed[right]
    age = np.minimum(np.abs(t - stamps[left]), np.abs(stamps[right] - t))
    return quaternion.rotate(quaternion.conjugate(D), blended), age <= max_age, age
