"""Directions low-passed in the gyroscope's frame, and how far a field is believed.

In the frame that the gyroscope integrates, a direction of the world moves by the gyroscope's drift
alone: the body's turns do not blur it, and accelerations and disturbances cancel over some seconds.

[VQF]  D. Laidig, T. Seel, "VQF: highly accurate IMU orientation estimation with bias estimation and
       magnetic disturbance rejection", Information Fusion 91 (2023): low-pass of the specific force
       in an almost inertial frame.
"""

from math import radians, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AHEAD = 1.0
"""At the start, over which the first direction is averaged, s."""
DAMPING = sqrt(0.5)
"""Of a Butterworth filter of second order."""
MEMORY = 30.0
"""Time constant of what the field usually is, s."""
LEAST = 0.02
"""Share at which even a field that is not believed becomes usual."""
HALF = 0.5
"""A belief above which a field is the usual one."""
OTHER = 5.0
"""Time constant of what the field is of late, s."""
ACCEPTED = 20.0
"""After so long of it, moving, another field is the usual one, s."""
MOVES = radians(20.0)
"""Rate above which a body is moved about, so that what stays the same is a field, rad/s."""
START = 3.0
"""In which whatever is measured first becomes usual, s."""


@kernel
def _first(
    i: int, h: Array, D: Array, unit: Array, length: Array, weight: Array, restart: Mask
) -> tuple[Vector, float, int]:
    """Return the mean of the first vectors in the frame, of how long it is, and where they end."""
    value, known, j, end = so3.ZERO, 0.0, i, AHEAD
    while j < len(unit) and end > 0.0 and not (j > i and restart[j]):
        step = h[j] if h[j] > 0.0 else 1e-3
        end -= step
        known += weight[j] * step
        D_j = so3.matrix((D[j, 0], D[j, 1], D[j, 2], D[j, 3]))
        away = so3.sub(so3.scale(length[j], mat3.apply(D_j, so3.row(unit, j))), value)
        value = so3.add(value, so3.scale(weight[j] * step / max(known, 1e-12), away))
        j += 1
    return value, known, j


@kernel
def low_pass(
    h: Array,
    D: Array,
    unit: Array,
    length: Array,
    weight: Array,
    restart: Mask,
    tau: Array,
    out: Array,
) -> None:
    """Fill out (n, 3) with the directions of low-passed vectors in the body; zero while unknown.

    A Butterworth filter of second order with the cut-off sqrt(2)/tau [rad/s], stepped implicitly;
    in the first tau seconds the mean, so that the first samples are as good as there are, and in
    the first `AHEAD` seconds the mean of all of them.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    D : shape (n, 4)
        Frame of the gyroscope, body to frame.
    unit, length : shape (n, 3) and (n,)
        Vectors in the body.
    weight : shape (n,)
        By which time goes on for the filter: 0 holds it.
    tau : shape (n,)
        Memory, s.
    """
    value = slope = (0.0, 0.0, 0.0)
    known, first = 0.0, 0
    for i in range(len(unit)):
        if restart[i]:
            value, known, first = _first(i, h, D, unit, length, weight, restart)
            slope = (0.0, 0.0, 0.0)
        D_i = so3.matrix((D[i, 0], D[i, 1], D[i, 2], D[i, 3]))
        step = weight[i] * (h[i] if h[i] > 0.0 else 1e-3)
        away = so3.sub(so3.scale(length[i], mat3.apply(D_i, so3.row(unit, i))), value)
        if i < first:
            pass
        elif known + step <= tau[i]:
            known += step
            slope = (0.0, 0.0, 0.0)
            value = so3.add(value, so3.scale(step / max(known, 1e-12), away))
        else:
            w = sqrt(2.0) / tau[i]
            c = 1.0 / (1.0 + 2.0 * DAMPING * w * step + (w * step) ** 2)
            slope = so3.scale(c, so3.add(slope, so3.scale(w * w * step, away)))
            value = so3.add(value, so3.scale(step, slope))
            known = tau[i]  # where the memory grows later, this much of it is there
        size = sqrt(so3.dot(value, value))
        u = so3.scale(1.0 / size if size > 0.0 else 0.0, value)
        out[i, 0], out[i, 1], out[i, 2] = mat3.apply(mat3.transpose(D_i), u)


@kernel
def across(mag: Array, accel: Array, body: Array, flat: Array) -> None:
    """Fill the directions (n, 3) of unit vectors across others, and their length there (n,)."""
    for i in range(len(mag)):
        m, up = so3.row(mag, i), so3.row(accel, i)
        v = so3.sub(m, so3.scale(so3.dot(m, up), up))
        flat[i] = sqrt(so3.dot(v, v))
        v = so3.scale(1.0 / flat[i] if flat[i] > 0.0 else 0.0, v)
        body[i, 0], body[i, 1], body[i, 2] = v


@kernel
def parts(mag: Array, length: Array, accel: Array, along: Array, across: Array) -> None:
    """Fill the component (n,) of vectors along others, and the length (n,) of the rest."""
    for i in range(len(mag)):
        c = so3.dot(so3.row(mag, i), so3.row(accel, i))
        along[i], across[i] = length[i] * c, length[i] * sqrt(max(0.0, 1.0 - c * c))


@kernel
def belief(
    h: Array,
    along: Array,
    across: Array,
    gyro: Array,
    valid: Mask,
    restart: Mask,
    scale: float,
    out: Array,
) -> None:
    """Fill out (n,) with how far a field is believed, 1 where it is as usual.

    What is not, but stays the same for long while the body moves, is usual from then on, [VQF].

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    along, across : shape (n,)
        Component of the field along the vertical, and length of the rest.
    gyro : shape (n, 3)
        Rate, rad/s.
    scale
        Difference from the usual field, as a share of its strength, at which half is believed.
    """
    usual_along = usual_across = known = 0.0
    other_along = other_across = steady = 0.0
    for i in range(len(out)):
        if restart[i]:
            known = steady = 0.0
        if not valid[i]:
            out[i] = 0.0
            continue
        step = h[i] if h[i] > 0.0 else 1e-3
        d_along, d_across = along[i] - usual_along, across[i] - usual_across
        strength2 = usual_along * usual_along + usual_across * usual_across
        x2 = (d_along * d_along + d_across * d_across) / max(strength2 * scale * scale, 1e-300)
        out[i] = 1.0 if known < START else 1.0 / (1.0 + x2)
        known += step
        share = step / known if known < START else step / MEMORY * max(out[i], LEAST)
        usual_along += min(1.0, share) * d_along
        usual_across += min(1.0, share) * d_across
        share = min(1.0, step / OTHER)
        other_along += share * (along[i] - other_along)
        other_across += share * (across[i] - other_across)
        d_along, d_across = along[i] - other_along, across[i] - other_across
        strength2 = other_along * other_along + other_across * other_across
        if out[i] > HALF or d_along * d_along + d_across * d_across > strength2 * scale * scale:
            steady = 0.0
        elif so3.dot(so3.row(gyro, i), so3.row(gyro, i)) > MOVES * MOVES:
            steady += step
        if steady > ACCEPTED:
            usual_along, usual_across, steady = other_along, other_across, 0.0


@kernel
def bends(h: Array, gyro: Array) -> float:
    """Return the sum of (h times the second difference of the rate), squared, rad²."""
    total = 0.0
    for i in range(1, len(h) - 1):
        if h[i] > 0.0 and h[i + 1] > 0.0:
            bend = so3.sub(
                so3.add(so3.row(gyro, i + 1), so3.row(gyro, i - 1)),
                so3.scale(2.0, so3.row(gyro, i)),
            )
            total += h[i] * h[i] * so3.dot(bend, bend)
    return total


@kernel
def cones(h: Array, gyro: Array) -> float:
    """Return the sum of (change of one turn's cross product with the next), squared, rad⁴."""
    total, before = 0.0, so3.ZERO
    for i in range(1, len(h)):
        x = so3.cross(so3.row(gyro, i - 1), so3.row(gyro, i))
        cone = so3.scale(h[i - 1] * h[i], x)
        change = so3.sub(cone, before)
        total += so3.dot(change, change)
        before = cone
    return total
