"""The frame that the gyroscope integrates: it turns with the body's true turn, and drifts slowly.

Vectors are interpolated and smoothed in this frame, where the vehicle's own motion does not blur
them, and are turned back into the body.

[Savage98]  P. G. Savage, "Strapdown inertial navigation integration algorithm design part 1:
            attitude algorithms", J. Guidance, Control, and Dynamics 21(1), 1998.

Symbols: D rotation from the body to the gyroscope's frame, as a quaternion.
"""

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.rows import times_since
from attest.geometry import mat3, so3
from attest.geometry.jit import inlined, kernel
from attest.geometry.so3 import Quaternion

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]


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
    D = np.empty((len(t), 4))
    restart = np.zeros(len(t), np.bool_) if restart is None else restart
    so3.integrate(times_since(t, restart)[1:], mean, D)
    return D


def mean_of_ends(y: Array) -> Array:
    """Return the mean of each row of (n, 3) and the next; the last row itself."""
    mean: Array = 0.5 * (y + np.concatenate([y[1:], y[-1:]]))
    return mean


@kernel
def cone(h: Array, at: Array, divided: Mask, over: Array) -> None:
    """Add to the mean rate over a step what the turn of its axis adds to the turn.

    The turn over a step is theta + theta_before x theta / 12 for a rate that changes linearly,
    with theta the rate's integral [Savage98].

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s, zero at a restart.
    at : shape (n, 3)
        Mean rate over the step that ends at each stamp, rad/s.
    divided : shape (n,)
        Steps whose rate is taken as linear instead: they stay.
    over : shape (n, 3)
        Rate over the step that begins at each stamp, rad/s, changed in place.
    """
    for i in range(len(h) - 1):
        if not divided[i]:
            added = so3.scale(h[i] / 12.0, so3.cross(so3.row(at, i), so3.row(at, i + 1)))
            for j in range(3):
                over[i, j] += added[j]


def at(t: Stamps, D: Array, when: Stamps) -> Array:
    """Return the frame at other times, rising, held before the first stamp and after the last."""
    found = np.empty((len(when), 4))
    _at(t, D, when, found)
    return found


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
    fixed, body = np.empty_like(y), np.empty((len(t), 3))
    age = np.empty(len(t), np.int64)
    fix(t, D, stamps, np.ascontiguousarray(y), fixed)
    _carry(t, D, stamps, fixed, body, age)
    return body, age <= max_age, age


@inlined
def last_before(t: Stamps, when: int, i: int) -> int:
    """Return the last stamp that is not after a time, from one on that is not or is the first."""
    jump = 1
    while i + jump < len(t) and t[i + jump] <= when:
        i += jump
        jump *= 2
    while jump > 1:
        jump //= 2
        if i + jump < len(t) and t[i + jump] <= when:
            i += jump
    return i


@inlined
def between(t: Stamps, D: Array, when: int, i: int) -> Quaternion:
    """Return the frame at a time, given the last stamp before it."""
    q = so3.row4(D, i)
    if t[i] < when:
        q = so3.between(q, so3.row4(D, i + 1), (when - t[i]) / (t[i + 1] - t[i]))
    return q


@kernel
def _at(t: Stamps, D: Array, when: Stamps, found: Array) -> None:
    i = 0
    for k in range(len(when)):
        at_ = min(max(when[k], t[0]), t[-1])
        i = last_before(t, at_, i)
        found[k, 0], found[k, 1], found[k, 2], found[k, 3] = between(t, D, at_, i)


@kernel
def fix(t: Stamps, D: Array, stamps: Stamps, y: Array, fixed: Array) -> None:
    """Fill fixed (j, 3) with vectors y in the frame, each at its stamp.

    The frame is held before its first stamp and after its last.
    """
    i = 0
    for k in range(len(stamps)):
        when = min(max(stamps[k], t[0]), t[-1])
        i = last_before(t, when, i)
        q = between(t, D, when, i)
        fixed[k, 0], fixed[k, 1], fixed[k, 2] = mat3.apply(so3.matrix(q), so3.row(y, k))


@kernel
def _carry(t: Stamps, D: Array, stamps: Stamps, fixed: Array, body: Array, age: Stamps) -> None:
    """Fill body (n, 3) with vectors linear between those of the frame, and their age (n,)."""
    left = 0
    for i in range(len(t)):
        left = last_before(stamps, t[i], left)
        ahead = stamps[left] < t[i] and left + 1 < len(stamps)
        right = left + 1 if ahead else left
        v = so3.row(fixed, left)
        if ahead:
            share = (t[i] - stamps[left]) / (stamps[right] - stamps[left])
            v = so3.add(so3.scale(1.0 - share, v), so3.scale(share, so3.row(fixed, right)))
        age[i] = min(abs(t[i] - stamps[left]), abs(stamps[right] - t[i]))
        back = mat3.transpose(so3.matrix(so3.row4(D, i)))
        body[i, 0], body[i, 1], body[i, 2] = mat3.apply(back, v)
