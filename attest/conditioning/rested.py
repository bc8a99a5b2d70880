"""When the body is known to be at rest by what was measured so far.

A body at rest measures the same from moment to moment. What a sample differs from the mean before
it must stay below what motion makes, and the mean rate below what a gyroscope's bias makes; a
steady turn that is slower than that cannot be told from rest by these two.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.rest import BIAS, PUSH, SHORTEST, TURN
from attest.geometry import so3
from attest.geometry.jit import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MEMORY = 0.5
"""Time constant of the means, s."""


@kernel
def _find(
    h: Array, gyro: Array, accel: Array, restart: Mask, found: Mask, limits: tuple[float, ...]
) -> None:
    memory, shortest, turn, push, largest = limits
    rate, force = so3.row(gyro, 0), so3.row(accel, 0)
    quiet = 0.0
    for i in range(len(gyro)):
        Omega, a = so3.row(gyro, i), so3.row(accel, i)
        if restart[i] or not (quiet >= 0.0):
            rate, force, quiet = Omega, a, 0.0
        c = min(1.0, h[i] / memory)
        d_rate, d_force = so3.sub(Omega, rate), so3.sub(a, force)
        rate, force = so3.add(rate, so3.scale(c, d_rate)), so3.add(force, so3.scale(c, d_force))
        still = so3.dot(d_rate, d_rate) < turn * turn and so3.dot(d_force, d_force) < push * push
        if still and sqrt(so3.dot(rate, rate)) < largest:
            quiet += h[i]
        else:  # also where something is not a number, from which the means start anew
            known = so3.dot(d_rate, d_rate) + so3.dot(d_force, d_force) < np.inf
            quiet = 0.0 if known else -1.0
        found[i] = quiet > shortest


def rested(h: Array, gyro: Array, accel: Array, restart: Mask) -> Mask:
    """Mark the samples at which the body has been at rest for `SHORTEST` already.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s; zero at a restart.
    gyro, accel : shape (n, 3)
        Angular velocity, rad/s, and specific force, m/s²; what is not finite is not at rest.
    restart : shape (n,)
        Samples that nothing before them tells of.
    """
    found = np.zeros(len(gyro), np.bool_)
    if len(gyro):
        _find(h, gyro, accel, restart, found, (MEMORY, SHORTEST * 1e-9, TURN, PUSH, BIAS))
    return found
