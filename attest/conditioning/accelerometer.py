"""The accelerometer and what it measures: a - g where the log has velocity, gravity elsewhere."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, specific_force
from attest.conditioning.measured import Measured, carried, unit
from attest.conditioning.timeline import SECOND, Timeline
from attest.config import Conditioning
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]

GRAVITY = 9.80665
"""Standard gravity, m/s²; only its direction matters to the observers."""


def accelerometer(
    recording: Recording,
    line: Timeline,
    signal: Signal,
    reference: str | None,
    config: Conditioning,
) -> tuple[Measured, list[Note]]:
    """Use a - g where the log's velocity gives a, gravity elsewhere."""
    down = 1.0 if recording.world == "ned" else -1.0
    g = np.array([0.0, 0.0, down * GRAVITY])
    plain = carried(line, signal, -g[np.newaxis], config)
    if reference == "gravity":
        return plain, [Note("accelerometer's reference: gravity, as asked")]
    if "velocity" not in recording.signals:
        if reference == "specific_force":
            raise ReadError(
                f"{recording.path}: no velocity, which 'specific_force' needs. "
                "Use 'reference: gravity' for 'accel'."
            )
        return plain, [Note("accelerometer's reference: gravity (the log has no velocity)")]
    smoothed, inertial, notes = _specific_force(recording, line, signal, g, config)
    expected, seen = np.linalg.norm(inertial, axis=1), np.linalg.norm(smoothed, axis=1)
    if reference is None and not specific_force.explains(expected, seen, GRAVITY):
        text = (
            "accelerometer's reference: gravity (the log's velocity does not fit the accelerometer)"
        )
        return plain, [Note(text, doubt=True)]
    # NaN where there is too little to smooth; near free fall there is no direction
    with np.errstate(invalid="ignore"):
        moving = np.minimum(expected, seen) > 0.1 * GRAVITY
    still = len(line.t) - int(moving.sum())
    if still:
        text = "step without velocity nearby: the accelerometer's reference is gravity there"
        notes.append(Note(text, still))
    body = np.where(moving[:, np.newaxis], unit(smoothed), plain.body)
    known = np.where(moving[:, np.newaxis], unit(inertial), plain.inertial)
    return Measured(body, known, plain.valid, plain.length), notes


def corrected(recording: Recording, config: Conditioning) -> Recording:
    """Take the accelerometer's bias and scale off, as given."""
    settings, accel = config.accelerometer, recording.signals.get("accel")
    bias, scale = np.array(settings.bias), np.array(settings.scale)
    if accel is None or not (bias.any() or (scale != 1.0).any()):
        return recording
    signal = replace(accel, y=scale * (accel.y - bias))
    return replace(recording, signals={**recording.signals, "accel": signal})


def _specific_force(
    recording: Recording, line: Timeline, signal: Signal, g: Array, config: Conditioning
) -> tuple[Array, Array, list[Note]]:
    """Return smoothed specific force in the body, a - g in the world, and what was done."""
    settings, velocity = config.specific_force, recording.signals["velocity"]
    fixed = quaternion.rotate(frame.at(line.t, line.D, signal.t), signal.y)
    level, _ = specific_force.smooth(line.t, signal.t, fixed, settings.smoothing_s)
    lag = settings.lag_s
    if lag is None:
        _, a = specific_force.smooth(line.t, velocity.t, velocity.y, settings.smoothing_s)
        lag = specific_force.find_lag(
            seconds(line.t, int(line.t[0])),
            np.linalg.norm(a - g, axis=1),
            np.linalg.norm(level, axis=1),
        )
    told = "its lag could not be told and is taken as 0" if lag is None else f"{lag:+.2f} s late"
    shifted = line.t + round((lag or 0.0) * SECOND)
    _, a = specific_force.smooth(shifted, velocity.t, velocity.y, settings.smoothing_s)
    note = Note(f"accelerometer's reference: a - g from {velocity.source} velocity, {told}")
    return quaternion.rotate(quaternion.conjugate(line.D), level), a - g, [note]
