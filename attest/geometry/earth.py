"""The Earth where a log was made: gravity, and the field by the World Magnetic Model."""

from datetime import UTC, datetime
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.80665
"""Standard gravity, m/s²."""
FIELD = (22e-6, 67e-6)
"""The least and the greatest strength of the magnetic field on the ground, tesla."""
EARLIEST, LATEST = 2010.0, 2030.0
"""Years that the models at hand cover."""
LOWEST, HIGHEST = -12e3, 850e3
"""Altitudes between which the model holds, m: from the deepest sea to a low orbit."""


class Place(NamedTuple):
    """Where a log was made."""

    latitude: float
    """deg."""
    longitude: float
    """deg, -180 to 180."""
    altitude: float
    """m."""


def place(position: Array) -> Place | None:
    """Return the median of latitudes, longitudes and altitudes (n, 3); None if not on Earth."""
    latitude, altitude = np.median(position[:, 0]), np.median(position[:, 2])
    longitude = np.median(np.unwrap(position[:, 1], period=360.0))  # also across the date line
    longitude = (longitude + 180.0) % 360.0 - 180.0
    on_earth = np.median(np.abs(position[:, 1])) <= 180.0 and abs(latitude) <= 90.0
    if not (on_earth and LOWEST < altitude < HIGHEST):
        return None
    return Place(float(latitude), float(longitude), float(altitude))


def year(utc: int) -> float:
    """Return nanoseconds of UTC since 1970 as a decimal year."""
    return 1970.0 + utc * 1e-9 / (365.2425 * 86400.0)


def field(where: Place, when: float) -> Array:
    """Return the field at a place in a decimal year, north-east-down, tesla, shape (3,).

    World Magnetic Model of the year's five years; outside `EARLIEST` to `LATEST`, of their ends.
    """
    within = min(max(when, EARLIEST), LATEST)
    result = _model(int(min(within, LATEST - 1))).calculate(
        glat=where.latitude,
        glon=where.longitude,
        alt=where.altitude * 1e-3,
        time=within,
        allow_date_outside_lifespan=True,
    )
    return np.array([result.x, result.y, result.z]) * 1e-9


@cache
def _model(year: int) -> Any:
    """Return the model of a year's five years, whose coefficients are read when it is used."""
    from pygeomag import GeoMag

    return GeoMag(base_year=datetime(year, 7, 1, tzinfo=UTC))


def declination(ned: Array) -> float:
    """Return how far a field points east of north, rad."""
    return float(np.arctan2(ned[1], ned[0]))


def dip(ned: Array) -> float:
    """Return how far a field points below the horizon, rad."""
    return float(np.arctan2(ned[2], np.hypot(ned[0], ned[1])))
