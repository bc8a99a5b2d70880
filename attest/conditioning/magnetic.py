"""The magnetometer's reference: the World Magnetic Model, or the log's own dip about north."""

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.rows import median
from attest.geometry import earth, so3
from attest.geometry.jit import kernel
from attest.recording import Note, Recording, World

Array = NDArray[np.float64]

MOST_SAMPLES = 5_000
"""From which the dip of a log is told."""
DIP_TOLERANCE_DEG = 5.0
"""The log's dip may differ by this much from the model's before the log's own is used."""


def field(recording: Recording) -> tuple[Array, list[Note]] | None:
    """Return the model's field at the log's place and date, tesla, in the world, shape (3,).

    World Magnetic Model of the log's five years. None where the log does not know its place.
    """
    if "position" not in recording.signals:
        return None
    place = earth.place(recording.signals["position"].y)
    if place is None:
        return None
    year, notes = _year(recording)
    ned = earth.field(place, year)
    text = (
        f"magnetic reference: World Magnetic Model at {place.latitude:.2f}, {place.longitude:.2f} "
        f"in {year:.1f}, declination {np.rad2deg(earth.declination(ned)):+.1f}°, "
        f"dip {np.rad2deg(earth.dip(ned)):+.1f}°"
    )
    return _to_world(ned, recording.world), [Note(text), *notes]


def north(dip: float, world: World, declination: float = 0.0) -> Array:
    """Return the unit vector to magnetic north with a dip, rad, in the world, shape (3,).

    Without the declination, rad, the world's north is the magnetic one.
    """
    east, level = np.sin(declination), np.cos(declination)
    return _to_world(np.array([np.cos(dip) * level, np.cos(dip) * east, np.sin(dip)]), world)


def dip_of(field_w: Array, world: World) -> float:
    """Return the dip of a field in the world, rad, positive downwards."""
    down = field_w[2] if world == "ned" else -field_w[2]
    return float(np.arctan2(down, np.hypot(field_w[0], field_w[1])))


def dip_of_log(accel: Array, mag: Array, valid: NDArray[np.bool_]) -> float | None:
    """Return the median dip, rad, between unit specific force and unit field.

    Parameters
    ----------
    accel, mag : shape (n, 3)
        In the body.
    valid : shape (n,)
        Which to use; None is returned where there are none.
    """
    few = -(-int(np.count_nonzero(valid)) // MOST_SAMPLES)
    if not few:
        return None
    chosen = np.arange(0, len(valid), few) if valid.all() else np.flatnonzero(valid)[::few]
    down = np.empty(len(chosen))
    _down(accel, mag, chosen, down)
    return float(np.arcsin(np.clip(median(down), -1.0, 1.0)))


@kernel
def _down(accel: Array, mag: Array, chosen: NDArray[np.intp], down: Array) -> None:
    """Fill down (k,) with how far unit fields at chosen rows point against unit forces."""
    for k in range(len(chosen)):
        down[k] = -so3.dot(so3.row(accel, chosen[k]), so3.row(mag, chosen[k]))


def with_dip(field_w: Array, dip: float, world: World) -> Array:
    """Return the unit vector of a field's heading with another dip, shape (3,)."""
    down = 1.0 if world == "ned" else -1.0
    level = field_w[:2] / np.hypot(field_w[0], field_w[1])
    return np.array([*(np.cos(dip) * level), down * np.sin(dip)])


def _to_world(ned: Array, world: World) -> Array:
    return ned if world == "ned" else np.array([ned[1], ned[0], -ned[2]])


def _year(recording: Recording) -> tuple[float, list[Note]]:
    """Return the log's date as a decimal year, and what is doubtful about it."""
    offset = recording.clock.utc_offset
    if offset is None:
        note = Note("the log knows no date: the magnetic model is taken for 2025", doubt=True)
        return 2025.0, [note]
    year = earth.year(int(recording.require("gyro").t[0]) + offset)
    if earth.EARLIEST <= year <= earth.LATEST:
        return year, []
    text = (
        f"the log's date, {year:.0f}, is outside the magnetic models, "
        f"{earth.EARLIEST:.0f}-{earth.LATEST:.0f}"
    )
    return float(np.clip(year, earth.EARLIEST, earth.LATEST)), [Note(text, doubt=True)]
