"""Directions of accelerometer and magnetometer, smoothed for the observers."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import directions
from attest.conditioning.measured import Measured, unit
from attest.conditioning.timeline import Timeline
from attest.config import Conditioning, SmoothedConditioning
from attest.recording import Note
from attest.smoothing.turned import SUDDEN, WINDOW, turned

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEVEL = 0.05
"""Least part of a field across the vertical that has a direction."""
FRAME_ERROR = 0.01
"""By which the gyroscope's frame may err over a filter's memory, rad."""
SIGMAS = 3.0
"""Deviations of the gyroscope's bias that are allowed for."""
MENTIONED = 0.05
"""Share of a log in which a shorter memory is worth a word."""
LESS = 0.8
"""Share of the longest memory below which it is shorter."""
DRIFT = 0.02
"""And by which it may drift over it, by the deviation of the gyroscope's bias, rad."""
DOUBTED = 0.5
"""Belief below which a sample of the field counts as disturbed."""


def smooth(
    found: dict[str, Measured],
    line: Timeline,
    restart: Mask,
    deviation: Array | None,
    config: Conditioning,
) -> tuple[dict[str, Measured], list[Note]]:
    """Low-pass the directions, believe the field as far as it is usual, keep it out of the tilt.

    Parameters
    ----------
    deviation : shape (n,)
        Of the gyroscope's bias, rad/s: no memory is so long that the frame drifts; None where that
        is as it was given.
    """
    h = np.where(restart, 0.0, np.diff(line.t, prepend=line.t[0]) * 1e-9)
    settings, after, notes = config.smoothing, dict(found), []
    accel, mag = found.get("accel"), found.get("mag")
    longest = np.full(len(h), longest_memory(h, line.gyro, config.max_step_s))
    if deviation is not None:
        longest = np.minimum(longest, DRIFT / np.maximum(deviation, 1e-12))
    if accel is not None and settings.accel_s is not None and len(accel.inertial) == 1:
        tau = np.minimum(settings.accel_s, longest)
        accel = _low_passed(accel, h, line, accel.valid.astype(float), restart, tau)
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
    if apart is not None and len(apart.inertial) == 1:  # so that errors of the vertical cancel
        mag = _across(mag, apart)
    if not isinstance(config, SmoothedConditioning):  # who tells it by the bias that it finds
        aided = accel is not None and len(accel.inertial) > 1
        notes += _turned(mag, line, h, restart, deviation, aided=aided)
    if settings.mag_s is not None:
        tau = np.minimum(settings.mag_s, longest)
        mag = _low_passed(mag, h, line, weight, restart, tau)
        notes.append(_told("magnetometer", tau, settings.mag_s))
    if apart is not None:
        mag = _across(mag, apart)
    after["mag"] = replace(mag, length=found["mag"].length)
    return after, notes


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
    means = np.median(h) <= max_step
    variance = directions.cones(h, gyro) / 576.0 if means else directions.bends(h, gyro) / 144.0
    return FRAME_ERROR**2 * float(h.sum()) / variance if variance > 0.0 else np.inf


def _told(sensor: str, tau: Array, wanted: float) -> Note:
    least, most = float(tau.min()), float(tau.max())
    frame = "in the frame that the gyroscope integrates"
    if np.mean(tau < LESS * most) < MENTIONED:
        text = f"{sensor} low-passed over {most:.2g} s {frame}"
        short = f", not {wanted:g} s: the gyroscope is too slow for its motion, or its bias unknown"
        return Note(text + (short if most < wanted else ""))
    return Note(
        f"{sensor} low-passed over {least:.2g} s, and up to {most:.2g} s as the gyroscope's bias "
        f"became known, {frame}"
    )


def _low_passed(
    vector: Measured, h: Array, line: Timeline, weight: Array, restart: Mask, tau: Array
) -> Measured:
    out = np.empty_like(vector.body)
    directions.low_pass(h, line.D, vector.body, vector.length, weight, restart, tau, out)
    known = np.abs(out[:, 0]) + np.abs(out[:, 1]) + np.abs(out[:, 2]) > 0.0
    return replace(vector, body=out, valid=vector.valid & known)


def _belief(
    mag: Measured, accel: Measured, gyro: Array, h: Array, restart: Mask, config: Conditioning
) -> tuple[Array, list[Note]]:
    """Return how far each sample of the field is believed, (n,)."""
    scale = config.magnetometer.disturbance
    if scale is None:
        return mag.valid.astype(float), []
    along, across = np.empty(len(h)), np.empty(len(h))
    directions.parts(mag.body, mag.length, accel.body, along, across)
    if len(accel.inertial) > 1:  # the vertical turns in the world: strength alone tells
        along, across = np.zeros(len(h)), mag.length
    weight = np.empty(len(h))
    directions.belief(h, along, across, gyro, mag.valid, restart, scale, weight)
    disturbed = int(np.sum(mag.valid & (weight < DOUBTED)))
    text = "magnetometer sample unlike the field before it, believed the less"
    many = disturbed > 0.1 * len(h)
    return weight, [Note(text, disturbed, doubt=many)] if disturbed else []


def _turned(
    mag: Measured,
    line: Timeline,
    h: Array,
    restart: Mask,
    deviation: Array | None,
    *,
    aided: bool,
) -> list[Note]:
    """Say where the field turns against the gyroscope by more than that can err."""
    most = SUDDEN if deviation is None else SUDDEN + SIGMAS * WINDOW * deviation
    return turned(h, line.D, mag.body, mag.valid, restart, aided=aided, most=most)


def _across(mag: Measured, accel: Measured) -> Measured:
    """Keep of the field what is across the accelerometer's direction, in body and world."""
    body, flat = np.empty_like(mag.body), np.empty(len(mag.body))
    directions.across(mag.body, accel.body, body, flat)
    share = np.sum(mag.inertial * accel.inertial, axis=1, keepdims=True)
    known = mag.inertial - share * accel.inertial
    return replace(
        mag,
        body=body,
        inertial=unit(known),
        length=mag.length * flat,
        valid=mag.valid & (flat > LEVEL),
    )
