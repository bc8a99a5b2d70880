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
Pair = tuple[float, float]
"""Of a field, its part along the vertical and the length of the rest."""

AHEAD = 1.0
"""At the start, over which the first direction is averaged, s."""
DAMPING = sqrt(0.5)
"""Of a Butterworth filter of second order."""
MEMORY = 30.0
"""Time constant of what the field usually is, s."""
LEAST = 0.02
"""Share at which even a field that is not believed becomes usual."""
LEVEL = 0.05
"""Least part of a field across the vertical that has a direction."""
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
    i: int, h: Array, D: Array, vectors: tuple[Array, Array, Array], weight: Array, restart: Mask
) -> tuple[Vector, float, int]:
    """Return the mean of the first vectors in the frame, of how long it is, and where they end."""
    unit, length, up = vectors
    value, known, j, end = so3.ZERO, 0.0, i, AHEAD
    while j < len(unit) and end > 0.0 and not (j > i and restart[j]):
        step = h[j] if h[j] > 0.0 else 1e-3
        end -= step
        known += weight[j] * step
        v = so3.flat(so3.row(unit, j), up, j)
        away = so3.sub(so3.scale(length[j], mat3.apply(so3.matrix(so3.row4(D, j)), v)), value)
        value = so3.add(value, so3.scale(weight[j] * step / max(known, 1e-12), away))
        j += 1
    return value, known, j


@kernel
def low_pass(
    h: Array,
    D: Array,
    vectors: tuple[Array, Array, Array],
    weight: Array,
    restart: Mask,
    tau: Array,
    out: Array,
    valid: Mask,
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
    vectors : shape (n, 3), (n,) and (n, 3) or (0, 3)
        Unit vectors in the body, their lengths, and the unit vectors across which they are taken.
    weight : shape (n,)
        By which time goes on for the filter: 0 holds it.
    tau : shape (n,)
        Memory, s.
    valid : shape (n,)
        Made False where there is no direction.
    """
    unit, length, up = vectors
    value = slope = (0.0, 0.0, 0.0)
    known, first = 0.0, 0
    for i in range(len(unit)):
        if restart[i]:
            value, known, first = _first(i, h, D, vectors, weight, restart)
            slope = (0.0, 0.0, 0.0)
        D_i = so3.matrix(so3.row4(D, i))
        step = weight[i] * (h[i] if h[i] > 0.0 else 1e-3)
        v = so3.flat(so3.row(unit, i), up, i)
        away = so3.sub(so3.scale(length[i], mat3.apply(D_i, v)), value)
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
        u, size = so3.unit_of(so3.flat(mat3.apply(mat3.transpose(D_i), value), up, i))
        out[i, 0], out[i, 1], out[i, 2] = u
        valid[i] = valid[i] and size > 0.0
        if len(up):
            least = LEVEL * LEVEL * so3.dot(value, value)
            valid[i] = valid[i] and size * size > least and so3.dot(v, v) > LEVEL * LEVEL


@kernel
def no_longer(drift: float, deviation: Array, tau: Array) -> None:
    """Shorten memories (n,) so that a rate of some deviation, rad/s, drifts by no more, rad."""
    for i in range(len(tau)):
        tau[i] = min(tau[i], drift / max(deviation[i], 1e-12))


@kernel
def across(mag: Array, up: Array, body: Array, valid: Mask) -> None:
    """Fill the directions (n, 3) of unit vectors across others, invalid where there is none."""
    for i in range(len(mag)):
        v, size = so3.unit_of(so3.flat(so3.row(mag, i), up, i))
        body[i, 0], body[i, 1], body[i, 2] = v
        valid[i] = valid[i] and size > LEVEL


@kernel
def belief(
    h: Array,
    field: tuple[Array, Array, Array],
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
    field : shape (n, 3), (n,) and (n, 3) or (0, 3)
        Its unit vectors in the body, its strength, and the unit vertical along and across which it
        is usual; without that, it is in strength.
    gyro : shape (n, 3)
        Rate, rad/s.
    scale
        Difference from the usual field, as a share of its strength, at which half is believed.
    """
    mag, length, up = field
    usual, other = (0.0, 0.0), (0.0, 0.0)
    known = steady = 0.0
    for i in range(len(out)):
        if restart[i]:
            known = steady = 0.0
        if not valid[i]:
            out[i] = 0.0
            continue
        step = h[i] if h[i] > 0.0 else 1e-3
        cosine = so3.dot(so3.row(mag, i), so3.row(up, i)) if len(up) else 0.0
        now = (length[i] * cosine, length[i] * sqrt(max(0.0, 1.0 - cosine * cosine)))
        out[i] = 1.0 if known < START else _believed(now, usual, scale)
        known += step
        share = step / known if known < START else step / MEMORY * max(out[i], LEAST)
        usual = _nearer(usual, now, min(1.0, share))
        other = _nearer(other, now, min(1.0, step / OTHER))
        if out[i] > HALF or _believed(now, other, scale) < HALF:
            steady = 0.0
        elif so3.dot(so3.row(gyro, i), so3.row(gyro, i)) > MOVES * MOVES:
            steady += step
        if steady > ACCEPTED:
            usual, steady = other, 0.0


@kernel
def _believed(field: Pair, usual: Pair, scale: float) -> float:
    """Return 1/(1 + d²), d how far a field is from the usual one, in scales of its strength."""
    along, across = field[0] - usual[0], field[1] - usual[1]
    strength2 = usual[0] * usual[0] + usual[1] * usual[1]
    half2 = max(scale * scale * strength2, 1e-300)
    return half2 / (half2 + along * along + across * across)


@kernel
def _nearer(usual: Pair, field: Pair, share: float) -> Pair:
    """Return a field that is by a share nearer to another."""
    return (
        usual[0] + share * (field[0] - usual[0]),
        usual[1] + share * (field[1] - usual[1]),
    )


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
