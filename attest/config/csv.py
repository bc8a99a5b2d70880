"""Keys that tell which columns of a CSV hold what, in which unit."""

from typing import Annotated, Literal

from pydantic import Field

from attest.config.section import Section

Column = str | Annotated[int, Field(ge=1)]
"""The name of a column, or its number, the first being 1."""
Three = tuple[Column, Column, Column]
Four = tuple[Column, Column, Column, Column]


class Time(Section):
    """The column of time."""

    column: Column
    """Its name or number."""
    unit: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of the stamps, whether they count from the log's start or from 1970."""


class Gyro(Section):
    """Angular velocity."""

    columns: Three
    """Along x, y, z of the body."""
    unit: Literal["rad/s", "deg/s"] = "rad/s"
    """Unit of the cells."""


class Accel(Section):
    """Specific force."""

    columns: Three
    """Along x, y, z of the body."""
    unit: Literal["m/s2", "m/s^2", "g", "mg"] = "m/s2"
    """Unit of the cells; g is 9.80665 m/s²."""


class Mag(Section):
    """Magnetic field."""

    columns: Three
    """Along x, y, z of the body."""
    unit: Literal["T", "mT", "uT", "nT", "gauss", "mgauss"] = "uT"
    """Unit of the cells."""


class Vector(Section):
    """A vector in units of its own: velocity m/s, torque N·m, points m, any further direction."""

    columns: Three
    """Along x, y, z; of a position latitude and longitude in degrees, and altitude in m."""


class Attitude(Section):
    """A reference attitude."""

    columns: Four
    """w, x, y, z of the quaternion from body to world."""
    kind: Literal["truth", "autopilot"] = "truth"
    """truth: motion capture or a simulator; autopilot: an estimate by the same sensors."""


class Csv(Section):
    """Columns and units of a CSV, and how its cells stand; what is null is found out."""

    time: Time
    """The column of time."""
    gyro: Gyro | None = None
    """Angular velocity."""
    accel: Accel | None = None
    """Specific force."""
    mag: Mag | None = None
    """Magnetic field."""
    reference: Attitude | None = None
    """Attitude to compare with."""
    velocity: Vector | None = None
    """Velocity along the axes of the world, m/s."""
    position: Vector | None = None
    """Latitude and longitude in degrees, altitude in m."""
    torque: Vector | None = None
    """Torque in the body, N·m."""
    vectors: dict[str, Vector] = Field(default={})
    """Any further direction in the body by its name, and feature points (point1, …) in m."""
    separator: Literal[",", ";", "\t", " "] | None = None
    """Between cells; a blank stands for any number of blanks."""
    decimal: Literal[".", ","] | None = None
    """Decimal point or comma."""
    comment: Annotated[str, Field(min_length=1, max_length=8)] = "#"
    """Lines that begin with this are left out."""
    skip: Annotated[int, Field(ge=0, le=1000)] = 0
    """Lines to leave out before the header, or before the rows if there is none."""
    header: bool = True
    """Whether a line names the columns; without one they are told by number."""
