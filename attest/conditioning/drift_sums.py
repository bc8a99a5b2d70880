"""What the drift of gravity is summed up in: blocks of samples, and windows of blocks.

Symbols: those of `attest.conditioning.drift`.
"""

from math import pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import gyroscope_errors
from attest.conditioning.gyroscope_errors import N
from attest.geometry import mat3, so3
from attest.geometry.jit import inlined, kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector

Array = NDArray[np.float64]

WINDOW = 6.0
"""Over which the direction of gravity is averaged, s: accelerations of the body cancel."""


class Block(NamedTuple):
    """Sums since Theta was last added to, over which the frame is taken as still."""

    time: float
    """s."""
    samples: float
    turned: Vector
    """Time times rate, rad."""
    force: Vector
    """Time times specific force in the body."""
    field: Vector
    """Time times field in the body."""


EMPTY = Block(0.0, 0.0, so3.ZERO, so3.ZERO, so3.ZERO)


class Window(NamedTuple):
    """What is summed up since the last comparison of directions, in arrays that are filled."""

    Theta: Array
    """Since its beginning, in rows of each element of D, (9, 4)."""
    mean: Array
    """Sum of weight times Theta, (9, 4)."""
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
    deviation: Array
    """Of the least known axis of the bias, rad/s, (1,)."""
    resting: Array
    """Sum of time times rate at rest, rad, (3,)."""


WEIGHT, TIME, COUNT, BEFORE, REST_TIME, REST_COUNT, WAITED = range(7)


@inlined
def turn(Theta: Array, mean: Array, D: Matrix, block: Block, weight: float) -> None:
    """Add D [h I, (h Omega_m)^T (x) I], summed over a block, to Theta, and that to its mean."""
    h, x, y, z = block.time, block.turned[0], block.turned[1], block.turned[2]
    for j in range(9):
        # all of a row before any is stored, so that it is added up at once
        a, b = Theta[j, 0] + D[j] * h, Theta[j, 1] + D[j] * x
        c, d = Theta[j, 2] + D[j] * y, Theta[j, 3] + D[j] * z
        e, f = mean[j, 0] + weight * a, mean[j, 1] + weight * b
        g, i = mean[j, 2] + weight * c, mean[j, 3] + weight * d
        Theta[j, 0], Theta[j, 1], Theta[j, 2], Theta[j, 3] = a, b, c, d
        mean[j, 0], mean[j, 1], mean[j, 2], mean[j, 3] = e, f, g, i


@kernel
def in_order(Theta: Array) -> Array:
    """Return Theta in the order of x, shape (3, 12)."""
    ordered = np.empty((3, N))
    for j in range(3):
        for k in range(3):
            ordered[j, k] = Theta[3 * j + k, 0]
            for axis in range(3):
                ordered[j, 3 + 3 * k + axis] = Theta[3 * j + k, 1 + axis]
    return ordered


@kernel
def clear(window: Window) -> None:
    """Begin a window."""
    window.Theta[:] = 0.0
    window.mean[:] = 0.0
    window.f[:] = 0.0
    window.clock[:BEFORE] = 0.0


@inlined
def more(block: Block, h: float, Omega_m: Vector, force: Vector, field: Vector) -> Block:
    """Add a sample to a block."""
    return Block(
        block.time + h,
        block.samples + 1.0,
        so3.add(block.turned, so3.scale(h, Omega_m)),
        so3.add(block.force, so3.scale(h, force)),
        so3.add(block.field, so3.scale(h, field)),
    )


@inlined
def end_block(
    block: Block, x: Array, q: Quaternion, Theta: Array, mean: Array, f: Array, clock: Array
) -> Quaternion:
    """Add a block to a window, weighted by a Hann function of its time; return the frame then."""
    h = block.time
    known = so3.scale(h, gyroscope_errors.error(x, so3.scale(1.0 / h, block.turned)))
    theta = so3.sub(block.turned, known)
    # the samples are each at the end of a step: their mean is past the middle
    share = 0.5 + 0.5 / block.samples
    D = so3.matrix(so3.multiply(q, so3.exp(so3.scale(share, theta))))
    hann = sin(pi * min(1.0, clock[TIME] / WINDOW)) ** 2
    turn(Theta, mean, D, block, h * hann)
    for k in range(len(f)):
        fixed = mat3.apply(D, block.field if k else block.force)
        for j in range(3):
            f[k, j] += hann * fixed[j]
    clock[COUNT] += block.samples
    clock[WEIGHT] += h * hann
    clock[TIME] += h
    return so3.multiply(q, so3.exp(theta))
