"""Up that is down, and a world or a reference that is another one than declared."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from attest.geometry import earth as model
from attest.inspection import references, worlds
from attest.inspection.place import Earth
from attest.inspection.turning import CLEAR, FITS, Fit
from attest.recording import Note, Recording, Reference, Signal, seconds

Array = NDArray[np.float64]

UPSIDE_DOWN = 0.9
"""Share of a log with up on the wrong side before it is told."""
OFF, AGREES = 0.7, worlds.OPPOSITE
"""Median cosine between two verticals below which they differ, and above which they agree."""
STEEP = 20.0
"""Dip, deg, from which its sign is clear."""
DIP_TOLERANCE = 10.0
"""How close the opposite of the model's dip must be, deg."""
MOST_STEPS = 2_000
STEP = 2.0
"""Between the positions whose difference is compared with the velocity, s."""
FEWEST = 10
NOT, WELL = 0.3, 0.8
"""Share of the motion that the velocity explains in the declared axes, and in the others."""
NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def doubts(recording: Recording, earth: Earth | None, found: Mapping[str, Fit]) -> Iterator[Note]:
    """Yield what does not fit between accelerometer, references, field, velocity and position."""
    up, accel = worlds.verticals(recording), found.get("accel")
    # an accelerometer of other axes has been told of, too
    if up is not None and (accel is None or accel.shared or accel.best < CLEAR):
        reference, turns = references.default(recording), found.get("reference")
        # a reference that turns otherwise has been told of, and knows no vertical
        trusted = reference if turns is None or turns.as_read >= FITS else None
        mag = found.get("mag")
        yield from _up(recording, trusted, up, field=mag is not None and mag.as_read >= FITS)
        if earth is not None and mag is not None and mag.shared:
            yield from _dip(recording, earth, up)
    yield from _velocity(recording)


def _up(
    recording: Recording, reference: Reference | None, up: Signal, *, field: bool
) -> Iterator[Note]:
    """Tell of an accelerometer whose up is not that of the reference, or not of the body."""
    cosine = None if reference is None else worlds.cosine(recording, reference, up)
    if cosine is None or reference is None:
        yield from _upside_down(recording, up)
    elif cosine < OFF:
        text = f"the accelerometer's up is {np.rad2deg(np.arccos(cosine)):.0f}° off the one of the "
        text += f"reference {reference.name}"
        if cosine < -AGREES:
            text += f": one is inverted, or {_world(recording, reference, up, field)}"
        yield Note(text, doubt=True)


def _world(recording: Recording, reference: Reference, up: Signal, field: bool) -> str:
    """Tell of which world the reference seems to be, and the option where that would mend it."""
    # the option changes the log's body too, so that it mends nothing where that is right
    whole = reference.world is None and bool(np.median(_way(recording) * up.y[:, 2]) < 0.0)
    option = worlds.try_other(recording) if whole else ""
    name = worlds.upside_down(recording, reference) if field else None
    return f"of another world{'' if name is None else f', as {name}'}{option}"


def _way(recording: Recording) -> float:
    """Return the sign of z upwards in the body that is declared."""
    return -1.0 if recording.body == "frd" else 1.0


def _upside_down(recording: Recording, up: Signal) -> Iterator[Note]:
    """Tell of a body whose up is below, unless the reader did."""
    if recording.tells("up"):
        return
    sign = _way(recording)
    if np.mean(sign * up.y[:, 2] < -0.5) < UPSIDE_DOWN:
        return
    way = "up" if sign < 0.0 else "down"
    text = f"accel_z is {way}: the sensor is upside down, inverted, or of other axes"
    yield Note(text + worlds.try_other(recording), doubt=True)


def _dip(recording: Recording, earth: Earth, up: Signal) -> Iterator[Note]:
    """Tell of a field that points out of the ground where it should point into it, or in."""
    mag = recording.signals["mag"]
    near, at = worlds.nearest(up.t, mag.t)
    known = float(np.rad2deg(model.dip(earth.field)))
    if near.sum() < FEWEST or abs(known) < STEEP:
        return
    length = np.linalg.norm(mag.y[at], axis=1)
    cosine = np.sum(mag.y[at] * up.y[near], axis=1) / np.where(length > 0.0, length, 1.0)
    seen = float(np.rad2deg(np.arcsin(np.clip(-np.median(cosine), -1.0, 1.0))))
    if abs(seen + known) < DIP_TOLERANCE:
        text = (
            f"the field's dip is {seen:+.1f}° and should be {known:+.1f}°: the magnetometer or the "
            "accelerometer is inverted"
        )
        yield Note(text, doubt=True)


def _velocity(recording: Recording) -> Iterator[Note]:
    """Compare the velocity with the positions, along the declared axes and the others."""
    if not {"velocity", "position"} <= recording.signals.keys():
        return
    v, moved = _motions(recording.signals["velocity"], recording.signals["position"])
    power = float(np.sum(moved**2))
    if len(moved) < FEWEST or not np.sqrt(power / len(moved)) > 1.0:
        return
    shares = {
        world: 1.0 - float(np.sum((v @ turn.T - moved) ** 2)) / power
        for world, turn in {"ned": np.eye(3), "enu": NED_OF_ENU}.items()
    }
    other = "enu" if recording.world == "ned" else "ned"
    if shares[recording.world] < NOT and shares[other] > WELL:
        text = f"velocity and position fit as {other} and not as {recording.world}"
        yield Note(text + worlds.try_other(recording), doubt=True)


def _motions(velocity: Signal, position: Signal) -> tuple[Array, Array]:
    """Return mean velocity and change of position per second, north-east-down, over steps."""
    first, last = max(velocity.t[0], position.t[0]), min(velocity.t[-1], position.t[-1])
    count = min(int((last - first) * 1e-9 / STEP), MOST_STEPS)
    if count < FEWEST:
        return np.empty((0, 3)), np.empty((0, 3))
    at = np.arange(count + 1) * STEP
    there = seconds(position.t, int(first))
    scale = np.deg2rad(1.0) * 6_371_000.0
    east = scale * np.cos(np.deg2rad(position.y[0, 0]))
    columns = (
        position.y[:, 0] * scale,
        np.unwrap(position.y[:, 1], period=360.0) * east,
        -position.y[:, 2],
    )
    place = np.stack([np.interp(at, there, column) for column in columns], axis=1)
    along = seconds(velocity.t, int(first))
    fine = (at[:-1, np.newaxis] + np.linspace(0.1, 0.9, 5) * STEP).ravel()
    v = np.stack([np.interp(fine, along, column) for column in velocity.y.T], axis=1)
    return v.reshape(count, 5, 3).mean(axis=1), np.diff(place, axis=0) / STEP
