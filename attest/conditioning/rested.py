"""When the body is known to be at rest by what was measured so far.

A body at rest measures the same from moment to moment. What a sample differs from the mean before
it must stay below what motion makes, and the mean rate below what a gyroscope's bias makes. A
steady turn is told from a bias by specific force and field, which stay where they are in a body
at rest; without a field, one that is slower than any bias cannot be.
"""

from math import radians, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.rest import BIAS, PUSH, SHORTEST, TURN
from attest.geometry import so3
from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MEMORY = 0.5
"""Time constant of the means, s."""
LARGEST = radians(20.0)
"""The largest bias that is looked for, rad/s."""
SMALL = radians(0.5)
"""A smaller mean rate is taken for bias without a look at directions, rad/s."""
TOLD = 0.03
"""By which directions must be expected to turn, rad, before they tell."""
STAYED = 0.4
"""Share of that by which they may move at rest."""


class Still(NamedTuple):
    """What directions did since a moment at which the body was quiet already."""

    force: Vector
    """Mean specific force at that moment."""
    field: Vector
    """Mean field at that moment."""
    turned: Vector
    """Integral of the mean rate since, rad."""
    confirmed: bool
    """Whether the directions stayed where they were."""


@kernel
def _apart(a: Vector, b: Vector) -> float:
    """Return the squared distance of vectors as a share of the second."""
    d = so3.sub(a, b)
    return so3.dot(d, d) / max(so3.dot(b, b), 1e-300)


@kernel
def _look(still: Still, rate: Vector, force: Vector, field: Vector, h: float, usual: bool) -> Still:
    """Tell a bias from a steady turn: directions that the rate should have turned, and did not."""
    turned = so3.add(still.turned, so3.scale(h, rate))
    then = so3.add(still.force, so3.cross(still.force, turned))
    there = so3.add(still.field, so3.cross(still.field, turned))
    expected = _apart(then, still.force) + _apart(there, still.field)
    if expected < TOLD * TOLD:
        return Still(still.force, still.field, turned, still.confirmed)
    moved = _apart(field, still.field)
    stayed = moved + _apart(force, still.force) < STAYED * STAYED * expected
    # a field that moves by nothing at all may be a magnetometer that is stuck
    stayed = stayed and (usual or moved > 0.0)
    return Still(force, field, (0.0, 0.0, 0.0), stayed)


@kernel
def _find(
    h: Array,
    gyro: Array,
    accel: Array,
    mag: Array,
    restart: Mask,
    found: Mask,
    limits: tuple[float, ...],
) -> None:
    memory, shortest, turn, push, largest = limits
    rate, force, field = so3.row(gyro, 0), so3.row(accel, 0), (0.0, 0.0, 0.0)
    still = Still(force, field, field, False)
    quiet = 0.0
    for i in range(len(gyro)):
        Omega, a, m = so3.row(gyro, i), so3.row(accel, i), field
        if len(mag):
            m = so3.row(mag, i)
        if restart[i] or not (quiet >= 0.0):
            rate, force, field, quiet = Omega, a, m, 0.0
        c = min(1.0, h[i] / memory)
        d_rate, d_force = so3.sub(Omega, rate), so3.sub(a, force)
        rate, force = so3.add(rate, so3.scale(c, d_rate)), so3.add(force, so3.scale(c, d_force))
        field = so3.add(field, so3.scale(c, so3.sub(m, field)))
        size = sqrt(so3.dot(rate, rate))
        even = so3.dot(d_rate, d_rate) < turn * turn and so3.dot(d_force, d_force) < push * push
        if even and size < (LARGEST if len(mag) else largest):
            quiet += h[i]
        else:  # also where something is not a number, from which the means start anew
            known = so3.dot(d_rate, d_rate) + so3.dot(d_force, d_force) < np.inf
            quiet = 0.0 if known else -1.0
        if quiet <= memory:
            still = Still(force, field, (0.0, 0.0, 0.0), False)
        else:
            still = _look(still, rate, force, field, h[i], size < largest)
        told = still.confirmed if len(mag) else size < largest
        found[i] = quiet > shortest and (size < SMALL or told)


def rested(h: Array, gyro: Array, accel: Array, restart: Mask, mag: Array) -> Mask:
    """Mark the samples at which the body has been at rest for `SHORTEST` already.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s; zero at a restart.
    gyro, accel : shape (n, 3)
        Angular velocity, rad/s, and specific force, m/s²; what is not finite is not at rest.
    restart : shape (n,)
        Samples that nothing before them tells of.
    mag : shape (n, 3) or (0, 3)
        Field, in any unit; with it, biases that are as large as a turn can be told.
    """
    found = np.zeros(len(gyro), np.bool_)
    if len(gyro):
        limits = (MEMORY, SHORTEST * 1e-9, TURN, PUSH, BIAS)
        _find(h, gyro, accel, mag, restart, found, limits)
    return found
