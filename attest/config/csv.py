"""Keys that tell which columns of a CSV hold what, in which unit."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from attest.config.section import Section
from attest.config.units import AccelUnit, GyroUnit, MagUnit

Column = str | Annotated[int, Field(ge=1)]
"""The name of a column, or its number, the first being 1."""
Three = tuple[Column, Column, Column]
Four = tuple[Column, Column, Column, Column]


class Measured(Section):
    """Cells in a unit; a unit alone is for the columns that the header names."""

    @model_validator(mode="after")
    def _refuse_nothing(self) -> Self:
        if self.bare and "unit" not in self.model_fields_set:
            raise ValueError("columns are needed, or the unit of those that the header names")
        return self

    @property
    def bare(self) -> bool:
        """Whether no column is named."""
        return getattr(self, "columns", None) is None


class Time(Measured):
    """The column of time."""

    column: Column | None = None
    """Its name or number; null: the one that the header names."""
    unit: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of the stamps, whether they count from the log's start or from 1970."""

    @property
    def bare(self) -> bool:
        """Whether no column is named."""
        return self.column is None


class Gyro(Measured):
    """Angular velocity."""

    columns: Three | None = None
    """Along x, y, z of the body; null: those that the header names."""
    unit: GyroUnit = "rad/s"
    """Unit of the cells."""


class Accel(Measured):
    """Specific force."""

    columns: Three | None = None
    """Along x, y, z of the body; null: those that the header names."""
    unit: AccelUnit = "m/s2"
    """Unit of the cells; g is 9.80665 m/s²."""


class Mag(Measured):
    """Magnetic field."""

    columns: Three | None = None
    """Along x, y, z of the body; null: those that the header names."""
    unit: MagUnit = "uT"
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

    time: Time | None = None
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

    @property
    def maps(self) -> bool:
        """Whether columns are named, and not units alone for those that the header names."""
        return self.time is not None and not self.time.bare

    def units(self) -> dict[str, str]:
        """Return the units that are told without columns, by key."""
        sections = {key: getattr(self, key) for key in ("time", "gyro", "accel", "mag")}
        return {key: told.unit for key, told in sections.items() if told is not None and told.bare}

    @model_validator(mode="after")
    def _refuse_half(self) -> Self:
        units = self.units()
        if self.maps and units:
            raise ValueError(f"time.column is named, so {next(iter(units))}.columns are needed too")
        defaults = {key: field.default for key, field in type(self).model_fields.items()}
        told = [key for key, default in defaults.items() if getattr(self, key) != default]
        alone = {*units, "reference"}  # beside columns that the header names
        if not self.maps and (named := [key for key in told if key not in alone]):
            raise ValueError(f"{named[0]} is told, so time.column is needed too")
        return self
