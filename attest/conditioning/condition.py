"""The stages of conditioning, in order."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, gyroscope, points
from attest.conditioning.accelerometer import accelerometer, corrected
from attest.conditioning.magnetometer import magnetometer
from attest.conditioning.measured import Measured, any_usable, carried, usable
from attest.conditioning.rest import rest, unturned
from attest.conditioning.rows import place, together
from attest.conditioning.smoothing import smooth
from attest.conditioning.timeline import (
    SECOND,
    Timeline,
    apart,
    restarts,
    substeps_of,
)
from attest.conditioning.timeline import gyroscope as cut_gyroscope
from attest.config import Conditioning, Configuration, PointsConfiguration, Vector
from attest.errors import ConfigError, ReadError
from attest.recording import Note, Recording, seconds
from attest.samples import Samples, Sensors

Array = NDArray[np.float64]


def condition(recording: Recording, config: Configuration) -> tuple[Samples, tuple[Note, ...]]:
    """Put everything on the gyroscope's stamps, or on those of the feature points.

    Raises
    ------
    ReadError
        The log has no gyroscope, or too little of it, or not the vector that is asked for.
    ConfigError
        A vector's reference does not suit its signal.
    """
    if isinstance(config, PointsConfiguration) and points.apply(recording, config):
        return points.condition(recording, config)
    recording = corrected(recording, config.conditioning)
    gyro, notes = cut_gyroscope(recording, config)
    restart, gaps = restarts(recording, gyro.t, config.conditioning, gyro.y)
    substeps, slow = substeps_of(gyro.t, restart, config.conditioning.max_step_s)
    notes += gaps + slow
    wanted = _vectors(recording, config)
    names = tuple(vector.signal for vector in wanted)
    room, measured, body = _room(len(gyro.t), len(names))
    rates, told = gyroscope.rates(recording, gyro, restart, substeps, config.conditioning, room)
    notes += told
    recording, line = apart(recording, replace(gyro, y=rates.at), rates.mean, restart)
    found, told = _measured(recording, line, wanted, config.conditioning, measured)
    torque, pushed = _torque(recording, line, config.conditioning)
    own = dict(zip(names, body, strict=True))
    smoothed, passed = smooth(found, line, restart, rates.deviation, config.conditioning, own)
    notes += [*told, *pushed, *passed]
    vectors = [smoothed[name] for name in names]
    samples = Samples(
        t=gyro.t,
        gyro=rates.over,
        measured=_filled(measured, [found[name].body for name in names]),
        world=recording.world,
        mean=rates.mean,
        rate=rates.at,
        bias=rates.bias,
        body=_filled(body, [vector.body for vector in vectors]),
        inertial=_stack([vector.inertial for vector in vectors], 1),
        valid=_valid(vectors, len(gyro.t)),
        names=names,
        substeps=substeps,
        restart=restart,
        length=np.stack([v.length for v in vectors], axis=1) if vectors else None,
        torque=torque,
        field=found["mag"].field if "mag" in found else None,
        rest=_rest(recording, line, vectors, config.conditioning),
        sensors=replace(
            (found["mag"].sensors if "mag" in found else None) or Sensors(),
            gyro_scale=gyroscope.scale_of(rates.known, config.conditioning),
        ),
    )
    return samples, (*notes, *_unobservable(samples.names, recording))


def _room(n: int, k: int) -> tuple[gyroscope.Room, Array, Array]:
    """Return the arrays for the rates, and stacks (k, n, 3) for vectors measured and smoothed."""
    vectors = (k, n, 3)
    at, bias, deviation, over, *stacks = together(*gyroscope.shapes(n), vectors, vectors)
    return (at, bias, deviation, over), stacks[0], stacks[1]


def _rest(
    recording: Recording, line: Timeline, vectors: list[Measured], config: Conditioning
) -> NDArray[np.bool_] | None:
    """Find when the body is at rest, where that is wanted and an accelerometer can tell."""
    if not config.rest:
        return None
    if "accel" not in recording.signals or not len(recording.signals["accel"].t):
        return None
    accel, age = recording.signals["accel"], round(config.max_age_s * SECOND)
    body, valid, _ = frame.carry(line.t, line.D, accel.t, accel.y, age)
    rested = rest(line.t, line.gyro, np.where(valid[:, np.newaxis], body, np.nan))
    seen, known = _stack([v.body for v in vectors], len(line.t)), _valid(vectors, len(line.t))
    return unturned(line.t, rested, line.gyro, seen, known)


def _torque(
    recording: Recording, line: Timeline, config: Conditioning
) -> tuple[Array | None, list[Note]]:
    """Interpolate the control torque, zero further from its samples than a vector is carried."""
    torque = recording.signals.get("torque")
    if torque is None or not len(torque.t):
        return None, []
    left, right = frame.nearest(torque.t, line.t)
    age = np.minimum(np.abs(line.t - torque.t[left]), np.abs(torque.t[right] - line.t))
    at = seconds(line.t, int(line.t[0])), seconds(torque.t, int(line.t[0]))
    applied = np.stack([np.interp(*at, column) for column in torque.y.T], axis=1)
    near = age <= config.max_age_s * SECOND
    far = len(near) - int(near.sum())
    text = f"step without a sample of 'torque' within {config.max_age_s:g} s: none is taken there"
    notes = [Note(text, far, doubt=far > 0.1 * len(near))] if far else []
    return np.where(near[:, np.newaxis], applied, 0.0), notes


def _unobservable(names: tuple[str, ...], recording: Recording) -> tuple[Note, ...]:
    """Say what too few directions leave open."""
    if not names:
        text = "no direction is used: the attitude is the gyroscope's integral from its start"
        usual = {"gyro", "velocity", "position", "torque", "disturbance_torque"}
        if others := sorted(set(recording.signals) - usual):
            text += f"; the log has {', '.join(others)}, which 'vectors' may name"
    elif len(names) == 1:
        text = (
            f"{names[0]!r} is the only direction: the turn about it is not observable, and drifts"
        )
    else:
        return ()
    return (Note(text, doubt=True),)


def _vectors(recording: Recording, config: Configuration) -> tuple[Vector, ...]:
    """Return the vectors asked for, or those of the two usual ones that the log has."""
    if config.vectors is not None:
        return config.vectors
    usual = (name for name in ("accel", "mag") if name in recording.signals)
    return tuple(Vector(signal=name) for name in usual if any_usable(recording.signals[name]))


def _measured(
    recording: Recording,
    line: Timeline,
    wanted: Sequence[Vector],
    config: Conditioning,
    stack: Array,
) -> tuple[dict[str, Measured], list[Note]]:
    """Bring the vectors to the timeline, by their signals, into a stack (k, n, 3)."""
    into = {vector.signal: its for vector, its in zip(wanted, stack, strict=True)}
    found: dict[str, Measured] = {}
    notes = []
    # the magnetometer last: its dip may be told by any of the others
    for vector in sorted(wanted, key=lambda vector: vector.signal == "mag"):
        before = list(found.values())
        found[vector.signal], told = _measure(
            recording, line, vector, before, config, into[vector.signal]
        )
        notes += told
    return found, notes


def _measure(
    recording: Recording,
    line: Timeline,
    vector: Vector,
    before: list[Measured],
    config: Conditioning,
    into: Array,
) -> tuple[Measured, list[Note]]:
    """Bring one vector to the timeline and find what it is in the world."""
    signal, notes = usable(recording.require(vector.signal))
    if not len(signal.t):
        raise ReadError(
            f"{recording.path}: {vector.signal!r} has no sample with a direction. "
            "Name the other 'vectors' only."
        )
    reference = vector.reference
    if isinstance(reference, tuple):
        known = np.array([reference])
        measured = carried(line, signal, known, config, into)
    elif vector.signal == "accel" and reference in {None, "gravity", "specific_force"}:
        measured, told = accelerometer(recording, line, signal, reference, config, into)
        notes += told
    elif vector.signal == "mag" and reference in {None, "magnetic", "north"}:
        measured, told = magnetometer(recording, line, signal, reference, before, config, into)
        notes += told
    else:
        raise ConfigError(
            f"vectors: {vector.signal!r} cannot have the reference {reference or 'null'!r}. "
            "Give it a constant [x, y, z] in the world."
        )
    stale = len(line.t) - int(np.count_nonzero(measured.valid))
    if stale:
        text = f"step without a sample of {vector.signal!r} within {config.max_age_s:g} s"
        notes.append(Note(text, stale, doubt=stale > 0.1 * len(line.t)))
    return measured, notes


def _filled(stack: Array, vectors: list[Array]) -> Array:
    """Put vectors (n, 3) into a stack (k, n, 3) unless they are there; return it as (n, k, 3)."""
    for its, v in zip(stack, vectors, strict=True):
        if not np.may_share_memory(its, v):
            its[:] = v
    return stack.transpose(1, 0, 2)


def _stack(vectors: list[Array], rows: int) -> Array:
    """Join vectors (n, 3) or (1, 3) to (n, k, 3), constant ones repeated where others move."""
    rows = max([rows, *map(len, vectors)])
    stacked = np.empty((rows, len(vectors), 3))
    for k, v in enumerate(vectors):
        place(stacked, k, v)
    return stacked


def _valid(vectors: list[Measured], n: int) -> NDArray[np.bool_]:
    return np.stack([v.valid for v in vectors], axis=1) if vectors else np.empty((n, 0), np.bool_)
