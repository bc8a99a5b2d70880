"""Bias, scale and misalignment of the gyroscope, from rest and from the drift of gravity.

In the frame that a gyroscope without error integrates, gravity stands still.
It drifts by what the gyroscope errs, Omega = Omega_m - b - S Omega_m: a small error (d_b, d_S)
turns the frame by theta' = D (d_b + d_S Omega_m), and a direction f that stands still in the world
by theta x f. At rest the gyroscope reads b. A Kalman filter of the twelve constants takes both as
they come, so that no sample is corrected by what came after it.

Symbols: D frame of the corrected gyroscope, as a quaternion; x = (b, S by rows); P its covariance;
Theta = integral of D [I, Omega_m^T (x) I], (3, 12), so that theta = Theta dx.
"""

from math import atan2, radians, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import gyroscope_errors
from attest.conditioning.drift_sums import (
    BEFORE,
    COUNT,
    EMPTY,
    REST_COUNT,
    REST_TIME,
    TIME,
    WAITED,
    WEIGHT,
    WINDOW,
    Window,
    clear,
    end_block,
    in_order,
    more,
)
from attest.conditioning.gyroscope_errors import N
from attest.geometry import so3
from attest.geometry.jit import inlined, kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = 0.02
"""In which the frame is taken as still, s."""
REST = 0.5
"""Over which the gyroscope is averaged at rest, s."""
WALK_STD = radians(0.001)
"""Of the bias after a second, rad/s."""
DIRECTION_STD = 0.02
"""Least of an averaged direction, rad; where motion makes it more, that is taken."""
SEEN = 0.125
"""Share of the latest window in what is seen."""
SMALL = 0.1
"""Drift that is taken for the gyroscope's error in any case, rad."""
MOST = 3.0
"""Deviations by which the direction may drift, where no other one tells."""
APART = 0.05
"""By which the angle to the other direction may change, rad, if it is a turn of the frame."""
FEWEST = 5
"""Samples of a window."""


@kernel
def walk(window: Window, P: Array) -> None:
    """Let the bias have walked until now."""
    for j in range(3):
        P[j, j] += window.clock[WAITED] * WALK_STD**2
    window.clock[WAITED] = 0.0


@kernel
def note_deviation(window: Window, P: Array) -> None:
    """Keep how well the bias is known."""
    window.deviation[0] = sqrt(max(P[0, 0], P[1, 1], P[2, 2], 0.0))


@kernel
def angle(y: Array) -> float:
    """Return the angle between two unit vectors, (2, 3)."""
    across = so3.cross(so3.row(y, 0), so3.row(y, 1))
    return atan2(sqrt(so3.dot(across, across)), so3.dot(so3.row(y, 0), so3.row(y, 1)))


@kernel
def most(window: Window, H: Array, P: Array) -> float:
    """Return the drift from which a body is steered, as in a turn, and no gyroscope errs, rad."""
    if len(window.f) < 2:
        return max(SMALL, MOST * sqrt(gyroscope_errors.spread(H, P) + 3.0 * DIRECTION_STD**2))
    turned = abs(angle(window.f) - angle(window.f_before)) < APART
    return np.inf if turned else SMALL


@kernel
def close(window: Window, x: Array, P: Array) -> None:
    """Compare the directions of a window that is over with those before, and begin the next."""
    mean = in_order(window.mean) / max(window.clock[WEIGHT], 1e-12)
    for k in range(len(window.f)):
        f = so3.row(window.f, k)
        window.f[k] /= max(sqrt(so3.dot(f, f)), 1e-12)
    walk(window, P)
    if window.clock[BEFORE] > 0.0:
        # x has changed since the window before, and with it what is left to be explained
        told = gyroscope_errors.times(window.before, window.x[1] - window.x[0])
        window.before[:] += mean
        f = so3.row(window.f_before, 0)
        H = gyroscope_errors.sensitivity(window.before, f)
        nu = so3.sub(so3.sub(so3.row(window.f, 0), f), so3.cross(told, f))
        size2 = so3.dot(nu, nu)
        window.variance[0] += SEEN * (size2 / 3.0 - window.variance[0])
        if size2 < most(window, H, P) ** 2:
            gyroscope_errors.compare(x, P, H, nu, max(window.variance[0], DIRECTION_STD**2))
        note_deviation(window, P)
    window.before[:] = in_order(window.Theta) - mean
    window.f_before[:] = window.f
    window.x[0] = window.x[1]
    window.x[1] = x
    clear(window)
    window.clock[BEFORE] = 1.0


@inlined
def stay(window: Window, x: Array, P: Array, Omega_m: Vector, h: float) -> bool:
    """Take a sample at rest; tell whether it told, and directions of before tell no more."""
    for j in range(3):
        window.resting[j] += h * Omega_m[j]
    window.clock[REST_TIME] += h
    window.clock[REST_COUNT] += 1.0
    if window.clock[REST_TIME] < REST or window.clock[REST_COUNT] < FEWEST:
        return False
    walk(window, P)
    turned = (window.resting[0], window.resting[1], window.resting[2])
    gyroscope_errors.at_rest(x, P, so3.scale(1.0 / window.clock[REST_TIME], turned))
    note_deviation(window, P)
    window.resting[:] = 0.0
    window.clock[REST_TIME:WAITED] = 0.0
    clear(window)
    window.clock[BEFORE] = 0.0
    window.x[1] = x
    return True


Room = tuple[Array, Array, Array]
"""Of rate, bias and deviation as found, shapes (n, 3), (n, 3) and (n,)."""


class Followed(NamedTuple):
    """A gyroscope, corrected by what was known at each sample."""

    rate: Array
    """Corrected rate, rad/s, shape (n, 3)."""
    bias: Array
    """Bias that was taken off, rad/s, shape (n, 3)."""
    deviation: Array
    """Standard deviation of its least known axis, rad/s, shape (n,)."""
    known: Array
    """x and its standard deviations at the end, shape (2, 12)."""


@kernel
def run(
    h: Array,
    gyro: Array,
    force: Array,
    field: Array,
    rest: Mask,
    restart: Mask,
    window: Window,
    found: Followed,
) -> None:
    """Fill what is found, whose x and standard deviations are those at first before.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s; a sample is the mean rate over it.
    gyro : shape (n, 3)
        Rate, rad/s.
    force, field : shape (n, 3) or (0, 3)
        Specific force, which stands still in the world on average, and the field, which only tells
        whether a drift is a turn of the frame; in any unit. Without the force, only rest tells.
    rest, restart : shape (n,)
        Where the body is at rest; where nothing before tells of a sample.
    """
    rate, bias, deviation, known = found
    x, P, q = known[0].copy(), np.diag(known[1] ** 2), (1.0, 0.0, 0.0, 0.0)
    block, Theta, mean, f, clock = EMPTY, window.Theta, window.mean, window.f, window.clock
    for i in range(len(gyro)):
        Omega_m = so3.row(gyro, i)
        Omega = so3.sub(Omega_m, gyroscope_errors.error(x, Omega_m))
        rate[i, 0], rate[i, 1], rate[i, 2] = Omega
        bias[i, 0], bias[i, 1], bias[i, 2] = x[0], x[1], x[2]
        deviation[i] = window.deviation[0]
        window.clock[WAITED] += h[i]
        if restart[i]:
            clear(window)
            window.clock[BEFORE], block = 0.0, EMPTY
        if rest[i]:
            if stay(window, x, P, Omega_m, h[i]):
                block = EMPTY
            continue
        if window.clock[REST_TIME] > 0.0:
            window.resting[:] = 0.0
            window.clock[REST_TIME:WAITED] = 0.0
        if len(force) and not restart[i]:
            seen = so3.row(field, i) if len(field) else so3.ZERO
            block = more(block, h[i], Omega_m, so3.row(force, i), seen)
            if block.time < BLOCK:
                continue
            q, block = end_block(block, x, q, Theta, mean, f, clock), EMPTY
            if window.clock[TIME] >= WINDOW and window.clock[COUNT] >= FEWEST:
                close(window, x, P)
                q = so3.normalize(q)
    walk(window, P)
    known[0], known[1] = x, np.sqrt(np.maximum(np.diag(P), 0.0))


def follow(
    h: Array,
    gyro: Array,
    force: Array,
    field: Array,
    rest: Mask,
    restart: Mask,
    known: Array,
    into: Room,
) -> Followed:
    """Correct a gyroscope into arrays of what is found.

    Other parameters are those of `run`, and x and its deviations before.
    """
    k, found = int(len(force) > 0) + int(len(field) > 0), Followed(*into, known.copy())
    shapes = ((9, 4), (9, 4), (k, 3), (3, N), (k, 3), (2, N), 7, 1, 1, 3)
    window = Window(*[np.zeros(shape) for shape in shapes])
    window.variance[:], window.deviation[:] = DIRECTION_STD**2, known[1, :3].max()
    window.x[:] = known[0]
    run(h, gyro, force, field, rest, restart, window, found)
    return found
