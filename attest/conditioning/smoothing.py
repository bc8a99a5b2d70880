"""Directions of accelerometer and magnetometer, smoothed for the observers."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import directions
from attest.conditioning.measured import Measured, unit
from attest.conditioning.rows import times_since
from attest.conditioning.timeline import Timeline
from attest.config import Conditioning, SmoothedConditioning
from attest.recording import Note
from attest.smoothing.turned import SUDDEN, WINDOW, turned

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FRAME_ERROR = 0.01
"""By which the gyroscope's frame may err over a filter's memory, rad, or by as much as it helps."""
PUSH = 0.08
"""By which a hand's acceleration is to be multiplied to get its speed, s: 1/omega at 2 Hz."""
SIGMAS = 3.0
"""Deviations of the gyroscope's bias that are allowed for."""
MENTIONED = 0.05
"""Share of a log in which a shorter memory is worth a word."""
LESS = 0.8
"""Share of the longest memory below which it is shorter."""
DRIFT = 0.02
"""And by which it may drift over it, by the deviation of the gyroscope's bias, rad."""
NONE = np.empty((0, 3))
DOUBTED = 0.5
"""Belief below which a sample of the field counts as disturbed."""


def smooth(
    found: dict[str, Measured],
    line: Timeline,
    restart: Mask,
    deviation: Array | None,
    config: Conditioning,
    into: dict[str, Array],
) -> tuple[dict[str, Measured], list[Note]]:
    """Low-pass the directions, believe the field as far as it is usual, keep it out of the tilt.

    Parameters
    ----------
    deviation : shape (n,)
        Of the gyroscope's bias, rad/s: no memory is so long that the frame drifts; None where that
        is as it was given.
    into
        Filled with the low-passed directions of each signal, (n, 3).
    """
    h = times_since(line.t, restart)
    settings, after, notes = config.smoothing, dict(found), []
    accel, mag = found.get("accel"), found.get("mag")
    longest = _longest(h, line.gyro, accel, config)
    if accel is not None and settings.accel_s is not None and len(accel.inertial) == 1:
        tau = _memory(min(settings.accel_s, longest), len(h), deviation)
        accel = low_passed(accel, h, line, accel.valid.astype(float), restart, tau, into["accel"])
        after["accel"] = accel
        notes.append(_told("accelerometer", tau, settings.accel_s))
    if mag is None:
        return after, notes
    if accel is None:
        weight = mag.valid.astype(float)
    else:
        weight, told = _belief(mag, accel, line.gyro, h, restart, config)
        notes += told
    apart = accel if config.magnetometer.decouple_tilt else None
    # before the low-pass only where the vertical stands still, so that its errors cancel
    up = apart.body if apart is not None and len(apart.inertial) == 1 else NONE
    if not isinstance(config, SmoothedConditioning):  # who tells it by the bias that it finds
        most = SUDDEN if deviation is None else SUDDEN + SIGMAS * WINDOW * deviation
        aided = accel is not None and len(accel.inertial) > 1
        vectors = (mag.body, up)
        notes += turned(h, line.D, vectors, mag.valid, restart, aided=aided, most=most)
    if settings.mag_s is not None:
        tau = _memory(min(settings.mag_s, longest), len(h), deviation)
        mag = low_passed(mag, h, line, weight, restart, tau, into["mag"], up)
        notes.append(_told("magnetometer", tau, settings.mag_s))
    if apart is not None:
        mag = _across(mag, apart, done=settings.mag_s is not None and len(up) > 0)
    after["mag"] = mag
    return after, notes


def _memory(most: float, n: int, deviation: Array | None) -> Array:
    """Return how long to remember at each sample, s, (n,), at most while the frame is still."""
    tau = np.full(n, most)
    if deviation is not None:
        directions.no_longer(DRIFT, deviation, tau)
    return tau


def _longest(h: Array, gyro: Array, accel: Measured | None, config: Conditioning) -> float:
    """Return how long to remember at the most, s: while the frame is good, or while it helps."""
    longest, settings = longest_memory(h, gyro, config.max_step_s), config.smoothing
    enough = longest >= max(settings.accel_s or 0.0, settings.mag_s or 0.0)
    if enough or accel is None or len(accel.inertial) > 1:
        return longest
    return max(longest, worthwhile(longest, accel))


def longest_memory(h: Array, gyro: Array, max_step: float) -> float:
    """Return over how long the gyroscope's frame can be relied on, s.

    Between samples the rate is taken as linear. What its bend at a sample makes of that, h/12 of
    the second difference, adds up to the frame's error like a random walk. Where no step is
    divided, a sample is the mean over it, and what is left is how `frame.cone` changes.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    gyro : shape (n, 3)
        Rate, rad/s.
    max_step
        Longest step that is not divided, s.
    """
    means = h.max() <= max_step or np.median(h) <= max_step  # mostly told without the latter
    variance = directions.cones(h, gyro) / 576.0 if means else directions.bends(h, gyro) / 144.0
    return FRAME_ERROR**2 * float(h.sum()) / variance if variance > 0.0 else np.inf


def worthwhile(longest: float, accel: Measured) -> float:
    """Return the memory at which frame and accelerations together do least harm, s.

    Accelerations turn a direction by s; since a body's speed has bounds, a memory tau leaves
    s PUSH/tau of that. The frame adds its walk, which `longest_memory` tells, times tau to the mean
    square. Accelerations lengthen what should be gravity in one direction, and turn it in two.
    """
    length = accel.length[accel.valid]
    if not len(length):
        return 0.0
    longer = np.minimum(np.abs(length / np.median(length) - 1.0), 1.0)
    s2, walk = 2.0 * float(np.mean(longer * longer)), FRAME_ERROR**2 / longest
    return float(np.cbrt(2.0 * s2 * PUSH**2 / walk))


def _told(sensor: str, tau: Array, wanted: float) -> Note:
    least, most = float(tau.min()), float(tau.max())
    frame = "in the frame that the gyroscope integrates"
    if np.count_nonzero(tau < LESS * most) < MENTIONED * len(tau):
        text = f"{sensor} low-passed over {most:.2g} s {frame}"
        short = f", not {wanted:g} s: the gyroscope is too slow for its motion, or its bias unknown"
        return Note(text + (short if most < wanted else ""))
    return Note(
        f"{sensor} low-passed over {least:.2g} s, and up to {most:.2g} s as the gyroscope's bias "
        f"became known, {frame}"
    )


def low_passed(
    vector: Measured,
    h: Array,
    line: Timeline,
    weight: Array,
    restart: Mask,
    tau: Array,
    into: Array,
    up: Array = NONE,
) -> Measured:
    """Low-pass a vector, or its direction across the unit vectors ``up``, by `directions`."""
    valid = vector.valid.copy()
    vectors = (vector.body, vector.length, up)
    directions.low_pass(h, line.D, vectors, weight, restart, tau, into, valid)
    return replace(vector, body=into, valid=valid)


def _belief(
    mag: Measured, accel: Measured, gyro: Array, h: Array, restart: Mask, config: Conditioning
) -> tuple[Array, list[Note]]:
    """Return how far each sample of the field is believed, (n,)."""
    scale = config.magnetometer.disturbance
    if scale is None:
        return mag.valid.astype(float), []
    # where the vertical turns in the world, strength alone tells
    up = accel.body if len(accel.inertial) == 1 else NONE
    weight = np.empty(len(h))
    field = (mag.body, mag.length, up)
    directions.belief(h, field, gyro, mag.valid, restart, scale, weight)
    disturbed = int(np.count_nonzero(mag.valid & (weight < DOUBTED)))
    text = "magnetometer sample unlike the field before it, believed the less"
    many = disturbed > 0.1 * len(h)
    return weight, [Note(text, disturbed, doubt=many)] if disturbed else []


def _across(mag: Measured, accel: Measured, *, done: bool) -> Measured:
    """Keep of the field what is across the accelerometer's direction, in body and world."""
    share = np.sum(mag.inertial * accel.inertial, axis=1, keepdims=True)
    mag = replace(mag, inertial=unit(mag.inertial - share * accel.inertial))
    if done:
        return mag
    body, valid = np.empty_like(mag.body), mag.valid.copy()
    directions.across(mag.body, accel.body, body, valid)
    return replace(mag, body=body, valid=valid)
