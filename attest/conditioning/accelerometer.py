"""The accelerometer and what it measures: a - g where the log has velocity, gravity elsewhere."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, smoothing, specific_force, velocity
from attest.conditioning.measured import Measured, carried, unit, usable
from attest.conditioning.rows import times_since
from attest.conditioning.timeline import BREAK, SECOND, Timeline
from attest.config import Conditioning
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]

UNTOLD = "its lag could not be told and is taken as 0"
CERTAIN = 0.05
"""Deviation of a lag below which it is not told, s."""
LOAD = 0.05
"""Share of gravity by which the specific force differs where it is half believed to be gravity."""


def accelerometer(
    recording: Recording,
    line: Timeline,
    signal: Signal,
    reference: str | None,
    config: Conditioning,
    into: Array,
) -> tuple[Measured, list[Note]]:
    """Use a - g where the log's velocity gives a, gravity elsewhere; `carried` fills ``into``."""
    down = 1.0 if recording.world == "ned" else -1.0
    g = np.array([0.0, 0.0, down * GRAVITY])
    plain = carried(line, signal, -g[np.newaxis], config, into)
    if reference == "gravity":
        return plain, [Note("accelerometer's reference: gravity, as asked")]
    if "velocity" not in recording.signals:
        if reference == "specific_force":
            raise ReadError(
                f"{recording.path}: no velocity, which 'specific_force' needs. "
                "Use 'reference: gravity' for 'accel'."
            )
        return plain, [Note("accelerometer's reference: gravity (the log has no velocity)")]
    return _aided(recording, line, plain, g, reference, config)


def corrected(recording: Recording, config: Conditioning) -> Recording:
    """Take the accelerometer's bias and scale off, as given."""
    settings, accel = config.accelerometer, recording.signals.get("accel")
    bias, scale = np.array(settings.bias), np.array(settings.scale)
    if accel is None or not (bias.any() or (scale != 1.0).any()):
        return recording
    signal = replace(accel, y=scale * (accel.y - bias))
    return replace(recording, signals={**recording.signals, "accel": signal})


def _aided(
    recording: Recording,
    line: Timeline,
    plain: Measured,
    g: Array,
    reference: str | None,
    config: Conditioning,
) -> tuple[Measured, list[Note]]:
    """Use a - g where there is a sound velocity, gravity where the vehicle does not manoeuvre."""
    if len(_within(line, usable(recording.signals["accel"])[0]).t) < 2:
        text = "accelerometer's reference: gravity (it has no two samples while the gyroscope has)"
        return plain, [Note(text, doubt=True)]
    force, a_g, level, notes = _specific_force(recording, line, g, config)
    expected, seen = np.linalg.norm(a_g, axis=1), np.linalg.norm(force, axis=1)
    if reference is None and not specific_force.explains(expected, seen, GRAVITY):
        text = (
            "accelerometer's reference: gravity (the log's velocity does not fit the accelerometer)"
        )
        return plain, [Note(text, doubt=True)]
    # NaN where there is too little to smooth; near free fall there is no direction
    with np.errstate(invalid="ignore"):
        moving = np.minimum(expected, seen) > 0.1 * GRAVITY
    notes[0] = replace(notes[0], text=f"{notes[0].text}, used at {moving.mean():.0%} of the steps")
    if still := len(line.t) - int(moving.sum()):
        text = "step without velocity nearby: the accelerometer's reference is gravity there"
        notes.append(Note(text, still))
        plain = _unaided(
            plain, line, np.where(moving, np.linalg.norm(a_g - g, axis=1), level), config
        )
    body = np.where(moving[:, np.newaxis], unit(force), plain.body)
    known = np.where(moving[:, np.newaxis], unit(a_g), plain.inertial)
    return Measured(body, known, plain.valid, plain.length), notes


def _unaided(plain: Measured, line: Timeline, load: Array, config: Conditioning) -> Measured:
    """Low-pass the accelerometer as far as it is gravity that it measures.

    Parameters
    ----------
    load
        What it is known to measure besides, m/s², (n,).
    """
    if config.smoothing.accel_s is None:
        return plain
    restart = np.diff(line.t, prepend=line.t[0] - BREAK) >= BREAK
    h = times_since(line.t, restart)
    weight = plain.valid / (1.0 + (load / (LOAD * GRAVITY)) ** 2)
    longest = smoothing.longest_memory(h, line.gyro, config.max_step_s)
    tau = np.full(len(h), min(config.smoothing.accel_s, longest))
    return smoothing.low_passed(plain, h, line, weight, restart, tau, np.empty_like(plain.body))


def _lag(lag: float, deviation: float) -> str:
    """Return a lag of the velocity as it is told, with how certain it is where that is little."""
    certain = "" if deviation < CERTAIN else f" ± {deviation:.2f}"
    return f"{lag:+.2f}{certain} s late"


def _within(line: Timeline, signal: Signal) -> Signal:
    """Return what there is of a signal while the gyroscope's frame is known."""
    first, last = np.searchsorted(signal.t, (line.t[0], line.t[-1] + 1))
    return replace(signal, t=signal.t[first:last], y=signal.y[first:last])


def _specific_force(
    recording: Recording, line: Timeline, g: Array, config: Conditioning
) -> tuple[Array, Array, Array, list[Note]]:
    """Return specific force in the body, a - g in the world, and what was done.

    Third is by how much the length of the specific force is not gravity's, m/s², (n,).
    """
    settings, aiding = config.specific_force, recording.signals["velocity"]
    signal, sigma = _within(line, usable(recording.signals["accel"])[0]), settings.smoothing_s
    fixed = quaternion.rotate(frame.at(line.t, line.D, signal.t), signal.y)
    level, _ = specific_force.smooth(line.t, signal.t, fixed, sigma)
    length = np.linalg.norm(level, axis=1)
    raw = velocity.compared(aiding, signal.t, fixed, g, 0)
    aiding, notes = velocity.unstuck(aiding, raw)
    lag, late, told = settings.lag_s, 0, f"{settings.lag_s or 0.0:+.2f} s late, as configured"
    # what cannot be hides the lag, and a wrong lag makes what can be look as if it could not
    for _ in range(2 if lag is None else 0):
        pair, broken, _ = velocity.sound(velocity.compared(aiding, signal.t, fixed, g, late), sigma)
        a_g, _ = velocity.slopes(line.t, pair, broken, sigma)
        at = seconds(line.t, int(line.t[0]))
        found = specific_force.find_lag(at, np.linalg.norm(a_g, axis=1), length)
        lag, told = (None, UNTOLD) if found is None else (found[0], _lag(*found))
        late = round((lag or 0.0) * SECOND)
    late = round((lag or 0.0) * SECOND)
    notes.insert(0, Note(f"accelerometer's reference: a - g from {aiding.source} velocity, {told}"))
    pair, broken, left_out = velocity.sound(
        velocity.compared(aiding, signal.t, fixed, g, late), sigma
    )
    a_g, force = velocity.slopes(line.t + late, pair, broken, sigma)
    force = quaternion.rotate(quaternion.conjugate(line.D), force)
    off = np.where(np.isfinite(length), np.abs(length - GRAVITY), 0.0)
    return force, a_g, off, [*notes, *left_out]
