"""Bias, scale and misalignment of the gyroscope, from rest and from the drift of gravity.

In the frame that a gyroscope without error integrates, gravity stands still.
It drifts by what the gyroscope errs, Omega = Omega_m - b - S Omega_m: a small error (d_b, d_S)
turns the frame by theta' = D (d_b + d_S Omega_m), and a direction f that stands still in the world
by theta x f. At rest the gyroscope reads b. A Kalman filter of the twelve constants takes both as
they come, so that no sample is corrected by what came after it.

Symbols: D frame of the corrected gyroscope, as a quaternion; x = (b, S by rows); P its covariance;
Theta = integral of D [I, Omega_m^T (x) I], (3, 12), so that theta = Theta dx.
"""

from math import atan2, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import gyroscope_errors
from attest.conditioning.gyroscope_errors import N
from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = 0.02
"""In which the frame is taken as still, s."""
WINDOW = 6.0
"""Over which the direction of gravity is averaged, s: accelerations of the body cancel."""
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


class Window(NamedTuple):
    """What is summed up since the last comparison of directions, in arrays that are filled."""

    Theta: Array
    """Since its beginning, (3, 12)."""
    mean: Array
    """Sum of weight times Theta, (3, 12)."""
    f: Array
    """Sum of weight times each direction in the frame, (k, 3)."""
    before: Array
    """Theta from the mean of the window before to its end, (3, 12)."""
    f_before: Array
    """Directions of the window before, (k, 3)."""
    x: Array
    """By which the frame is corrected, in the window before and in this one, (2, 12)."""
    clock: Array
    """Sum of weights, s; time, s; samples; whether there is a window before; time at rest, s, and
    samples; time that P has not walked yet, s."""
    variance: Array
    """Of the direction as seen, (1,)."""
    block: Array
    """Sums since Theta was last added to: time, s, time times rate, rad; and samples, (5,)."""
    seen: Array
    """And of time times each direction in the body, (k, 3)."""
    resting: Array
    """Sum of time times rate at rest, rad, (3,)."""


WEIGHT, TIME, COUNT, BEFORE, REST_TIME, REST_COUNT, WAITED = range(7)
SAMPLES = 4


@kernel
def turn(Theta: Array, D: Matrix, block: Array) -> None:
    """Add D [h I, (h Omega_m)^T (x) I], summed over a block, to Theta."""
    for j in range(3):
        for k in range(3):
            d = D[3 * j + k]
            Theta[j, k] += d * block[0]
            Theta[j, 3 + 3 * k] += d * block[1]
            Theta[j, 4 + 3 * k] += d * block[2]
            Theta[j, 5 + 3 * k] += d * block[3]


@kernel
def walk(window: Window, P: Array) -> None:
    """Let the bias have walked until now."""
    for j in range(3):
        P[j, j] += window.clock[WAITED] * WALK_STD**2
    window.clock[WAITED] = 0.0


@kernel
def clear(window: Window) -> None:
    """Begin a window."""
    window.Theta[:] = 0.0
    window.mean[:] = 0.0
    window.f[:] = 0.0
    window.block[:] = 0.0
    window.seen[:] = 0.0
    window.clock[:BEFORE] = 0.0


@kernel
def add(window: Window, Omega_m: Vector, y: Array, i: int, h: float) -> None:
    """Add a sample to the block."""
    block, seen = window.block, window.seen
    block[0] += h
    for j in range(3):
        block[1 + j] += h * Omega_m[j]
    block[SAMPLES] += 1.0
    for k in range(len(seen)):
        for j in range(3):
            seen[k, j] += h * y[i, k, j]


@kernel
def end_block(window: Window, x: Array, q: Quaternion) -> Quaternion:
    """Add a block to the window, weighted by a Hann function of its time; return the frame then."""
    block, clock = window.block, window.clock
    h, turned = block[0], (block[1], block[2], block[3])
    known = so3.scale(h, gyroscope_errors.error(x, so3.scale(1.0 / h, turned)))
    theta = so3.sub(turned, known)
    # the samples are each at the end of a step: their mean is past the middle
    share = 0.5 + 0.5 / block[SAMPLES]
    D = so3.matrix(so3.multiply(q, so3.exp(so3.scale(share, theta))))
    turn(window.Theta, D, block)
    hann = sin(pi * min(1.0, clock[TIME] / WINDOW)) ** 2
    for k in range(len(window.f)):
        fixed = mat3.apply(D, so3.row(window.seen, k))
        for j in range(3):
            window.f[k, j] += hann * fixed[j]
    clock[COUNT] += block[SAMPLES]
    clock[WEIGHT] += h * hann
    clock[TIME] += h
    for j in range(3):
        for m in range(N):
            window.mean[j, m] += h * hann * window.Theta[j, m]
    block[:] = 0.0
    window.seen[:] = 0.0
    return so3.multiply(q, so3.exp(theta))


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
    window.mean[:] /= max(window.clock[WEIGHT], 1e-12)
    for k in range(len(window.f)):
        f = so3.row(window.f, k)
        window.f[k] /= max(sqrt(so3.dot(f, f)), 1e-12)
    walk(window, P)
    if window.clock[BEFORE] > 0.0:
        # x has changed since the window before, and with it what is left to be explained
        told = gyroscope_errors.times(window.before, window.x[1] - window.x[0])
        window.before[:] += window.mean
        f = so3.row(window.f_before, 0)
        H = gyroscope_errors.sensitivity(window.before, f)
        nu = so3.sub(so3.sub(so3.row(window.f, 0), f), so3.cross(told, f))
        size2 = so3.dot(nu, nu)
        window.variance[0] += SEEN * (size2 / 3.0 - window.variance[0])
        if size2 < most(window, H, P) ** 2:
            gyroscope_errors.compare(x, P, H, nu, max(window.variance[0], DIRECTION_STD**2))
    window.before[:] = window.Theta - window.mean
    window.f_before[:] = window.f
    window.x[0] = window.x[1]
    window.x[1] = x
    clear(window)
    window.clock[BEFORE] = 1.0


@kernel
def stay(window: Window, x: Array, P: Array, Omega_m: Vector, h: float) -> None:
    """Take a sample at rest, and what it tells; directions of before tell no more then."""
    for j in range(3):
        window.resting[j] += h * Omega_m[j]
    window.clock[REST_TIME] += h
    window.clock[REST_COUNT] += 1.0
    if window.clock[REST_TIME] < REST or window.clock[REST_COUNT] < FEWEST:
        return
    walk(window, P)
    turned = (window.resting[0], window.resting[1], window.resting[2])
    gyroscope_errors.at_rest(x, P, so3.scale(1.0 / window.clock[REST_TIME], turned))
    window.resting[:] = 0.0
    window.clock[REST_TIME:WAITED] = 0.0
    clear(window)
    window.clock[BEFORE] = 0.0
    window.x[1] = x


@kernel
def run(
    h: Array,
    gyro: Array,
    y: Array,
    rest: Mask,
    restart: Mask,
    known: Array,
    window: Window,
    rate: Array,
    bias: Array,
) -> None:
    """Fill the corrected rate and the bias, (n, 3), and what is known of x at the end.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s; a sample is the mean rate over it.
    gyro : shape (n, 3)
        Rate, rad/s.
    y : shape (n, 0, 1 or 2, 3)
        Specific force, which stands still in the world on average, and the field, which only tells
        whether a drift is a turn of the frame; in any unit.
    rest, restart : shape (n,)
        Where the body is at rest; where nothing before tells of a sample.
    known : shape (2, 12)
        x and its standard deviations: at first, and filled with those at the end.
    """
    x, P, q = known[0].copy(), np.diag(known[1] ** 2), (1.0, 0.0, 0.0, 0.0)
    for i in range(len(gyro)):
        Omega_m = so3.row(gyro, i)
        Omega = so3.sub(Omega_m, gyroscope_errors.error(x, Omega_m))
        rate[i, 0], rate[i, 1], rate[i, 2] = Omega
        bias[i, 0], bias[i, 1], bias[i, 2] = x[0], x[1], x[2]
        window.clock[WAITED] += h[i]
        if restart[i]:
            clear(window)
            window.clock[BEFORE] = 0.0
        if rest[i]:
            stay(window, x, P, Omega_m, h[i])
            continue
        if window.clock[REST_TIME] > 0.0:
            window.resting[:] = 0.0
            window.clock[REST_TIME:WAITED] = 0.0
        if len(window.f) and not restart[i]:
            add(window, Omega_m, y, i, h[i])
            if window.block[0] < BLOCK:
                continue
            q = end_block(window, x, q)
            if window.clock[TIME] >= WINDOW and window.clock[COUNT] >= FEWEST:
                close(window, x, P)
                q = so3.normalize(q)
    walk(window, P)
    known[0], known[1] = x, np.sqrt(np.maximum(np.diag(P), 0.0))


def follow(
    h: Array, gyro: Array, y: Array, rest: Mask, restart: Mask, known: Array
) -> tuple[Array, Array, Array]:
    """Return the corrected rate and the bias, (n, 3), and x with its deviations, (2, 12).

    Parameters are those of `run`; x is that at the end.
    """
    rate, bias, known = np.empty_like(gyro), np.empty_like(gyro), known.copy()
    k = y.shape[1]
    shapes = ((3, N), (3, N), (k, 3), (3, N), (k, 3), (2, N), 7, 1, 5, (k, 3), 3)
    window = Window(*[np.zeros(shape) for shape in shapes])
    window.variance[:] = DIRECTION_STD**2
    window.x[:] = known[0]
    run(h, gyro, y, rest, restart, known, window, rate, bias)
    return rate, bias, known
