"""Up that is down, and a world or a reference that is another one than declared."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from attest.geometry import earth as model
from attest.inspection import mounting, references, worlds
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
        yield from _vertical(recording, earth, found, up)
    yield from _velocity(recording)


def _vertical(
    recording: Recording, earth: Earth | None, found: Mapping[str, Fit], up: Signal
) -> Iterator[Note]:
    """Compare the accelerometer's up with those of the body, the reference and the field."""
    reference, turns, mag = references.default(recording), found.get("reference"), found.get("mag")
    # a reference that turns otherwise has been told of, with its cure, and knows no vertical
    trusted = reference if turns is None or turns.as_read >= FITS else None
    dips = _dips(recording, earth, up) if earth is not None and mag and mag.shared else None
    opposed = None if dips is None else abs(sum(dips)) < DIP_TOLERANCE
    cosine = None if trusted is None else worlds.cosine(recording, trusted, up)
    if cosine is None or trusted is None:
        cures = reference is None or trusted is not None
        told = _upside_down(recording, up, _cures(recording, opposed) if cures else "")
    else:
        axis = worlds.north(recording, trusted) if mag and mag.as_read >= FITS else None
        told = _off(trusted, cosine, _inverted(recording, trusted, up, opposed, axis))
    if told is not None:
        yield told
    if dips is not None and opposed:
        yield _of_dips(*dips, "" if told else f": {mounting.inverted(recording, 'mag')}")


def _off(reference: Reference, cosine: float, inverted: str) -> Note | None:
    """Tell of an accelerometer whose up is not that of the reference."""
    if cosine >= OFF:
        return None
    text = f"the accelerometer's up is {np.rad2deg(np.arccos(cosine)):.0f}° off the one of the "
    text += f"reference {reference.name}"
    return Note(text + (inverted if cosine < -AGREES else ""), doubt=True)


def _inverted(
    recording: Recording,
    reference: Reference,
    up: Signal,
    opposed: bool | None,
    axis: str | None,
) -> str:
    """Say what may be inverted, or of which world, and the options where these would mend it.

    The axis is the one of the reference's world that the field's north is along.
    """
    accel = mounting.inverted(recording, "accel")
    if opposed:
        return f": it is inverted: {accel}"
    # neither option mends anything where the accelerometer is upright in its body
    below = bool(np.median(_way(recording) * up.y[:, 2]) < 0.0)
    other = axis == worlds.NORTH[worlds.OTHER[recording.world]]
    alone = f" (the accelerometer: {accel})" if below and opposed is None and not other else ""
    whole = below and reference.world is None and (axis is None or other)
    name = worlds.NAMES[recording.world].get(axis or "")
    world = f"of another world{'' if name is None else f', as {name}'}"
    return f": one is inverted{alone}, or {world}{worlds.try_other(recording) if whole else ''}"


def _way(recording: Recording) -> float:
    """Return the sign of z upwards in the body that is declared."""
    return -1.0 if recording.body == "frd" else 1.0


def _upside_down(recording: Recording, up: Signal, cures: str) -> Note | None:
    """Tell of a body whose up is below, unless the log says why."""
    sign = _way(recording)
    if recording.tells("up") or np.mean(sign * up.y[:, 2] < -0.5) < UPSIDE_DOWN:
        return None
    way = "up" if sign < 0.0 else "down"
    text = f"accel_z is {way}: the sensor is upside down, inverted, or of other axes{cures}"
    return Note(text, doubt=True)


def _cures(recording: Recording, opposed: bool | None) -> str:
    """Name the options that mend an up that is below, by whether the dip is the opposite one."""
    accel, world = mounting.inverted(recording, "accel"), worlds.try_other(recording)
    if opposed:
        return f": {accel}"
    if opposed is not None:
        return world
    return f"{world + ', or ' if world else ': '}{accel} if it alone is inverted"


def _dips(recording: Recording, earth: Earth, up: Signal) -> tuple[float, float] | None:
    """Return the field's dip below the accelerometer's horizon, and by the model, deg."""
    mag = recording.signals["mag"]
    near, at = worlds.nearest(up.t, mag.t)
    known = float(np.rad2deg(model.dip(earth.field)))
    if near.sum() < FEWEST or abs(known) < STEEP:
        return None
    length = np.linalg.norm(mag.y[at], axis=1)
    cosine = np.sum(mag.y[at] * up.y[near], axis=1) / np.where(length > 0.0, length, 1.0)
    seen = float(np.rad2deg(np.arcsin(np.clip(-np.median(cosine), -1.0, 1.0))))
    return seen, known


def _of_dips(seen: float, known: float, cure: str) -> Note:
    """Tell of a field that points out of the ground where it should point into it, or in."""
    text = (
        f"the field's dip is {seen:+.1f}° and should be {known:+.1f}°: the magnetometer or the "
        f"accelerometer is inverted{cure}"
    )
    return Note(text, doubt=True)


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
