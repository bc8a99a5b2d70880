"""The magnetometer's reference: the World Magnetic Model, or the log's own dip about north."""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from attest.recording import Note, Recording, World

Array = NDArray[np.float64]

EARLIEST, LATEST = 2010.0, 2030.0
"""Years that the models at hand cover."""
LOWEST, HIGHEST = -12e3, 850e3
"""Altitudes between which the model holds, m: from the deepest sea to a low orbit."""
DIP_TOLERANCE_DEG = 5.0
"""The log's dip may differ by this much from the model's before the log's own is used."""


def field(recording: Recording) -> tuple[Array, list[Note]] | None:
    """Return the model's field at the log's place and date, tesla, in the world, shape (3,).

    World Magnetic Model of the log's five years. None where the log does not know its place.
    """
    from pygeomag import GeoMag

    if "position" not in recording.signals:
        return None
    place = recording.signals["position"].y
    latitude, altitude = np.median(place[:, 0]), np.median(place[:, 2])
    longitude = np.median(np.unwrap(place[:, 1], period=360.0))  # also across the date line
    longitude = (longitude + 180.0) % 360.0 - 180.0
    on_earth = np.median(np.abs(place[:, 1])) <= 180.0 and abs(latitude) <= 90.0
    if not (on_earth and LOWEST < altitude < HIGHEST):
        return None
    year, notes = _year(recording)
    model = GeoMag(base_year=datetime(int(min(year, LATEST - 1)), 7, 1, tzinfo=UTC))
    result = model.calculate(
        glat=latitude,
        glon=longitude,
        alt=altitude * 1e-3,
        time=min(max(year, EARLIEST), LATEST),
        allow_date_outside_lifespan=True,
    )
    text = (
        f"magnetic reference: World Magnetic Model at {latitude:.2f}, {longitude:.2f} in "
        f"{year:.1f}, declination {result.d:+.1f}°, dip {result.i:+.1f}°"
    )
    ned = np.array([result.x, result.y, result.z]) * 1e-9
    return _to_world(ned, recording.world), [Note(text), *notes]


def north(dip: float, world: World) -> Array:
    """Return the unit vector to magnetic north with a dip, rad, in the world, shape (3,)."""
    return _to_world(np.array([np.cos(dip), 0.0, np.sin(dip)]), world)


def dip_of(field_w: Array, world: World) -> float:
    """Return the dip of a field in the world, rad, positive downwards."""
    down = field_w[2] if world == "ned" else -field_w[2]
    return float(np.arctan2(down, np.hypot(field_w[0], field_w[1])))


def dip_of_log(accel: Array, mag: Array) -> float | None:
    """Return the median dip, rad, between unit specific force and unit field, both (n, 3)."""
    if not len(accel):
        return None
    return float(np.arcsin(np.clip(-np.median(np.sum(accel * mag, axis=1)), -1.0, 1.0)))


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
    seconds = (int(recording.require("gyro").t[0]) + offset) * 1e-9
    year = 1970.0 + seconds / (365.2425 * 86400.0)
    if EARLIEST <= year <= LATEST:
        return year, []
    text = (
        f"the log's date, {year:.0f}, is outside the magnetic models, {EARLIEST:.0f}-{LATEST:.0f}"
    )
    return float(np.clip(year, EARLIEST, LATEST)), [Note(text, doubt=True)]
