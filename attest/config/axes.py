"""Axes that a log's sensors lie along, where these are not the body's."""

from typing import Literal

from pydantic import field_validator

from attest.config.section import Section

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Signed = tuple[Axis, Axis, Axis]


class Axes(Section):
    """x, y, z of the body in the axes that the log gives, such as [y, -x, z]; null: as they are."""

    gyro: Signed | None = None
    """Of angular velocity."""
    accel: Signed | None = None
    """Of specific force."""
    mag: Signed | None = None
    """Of the magnetic field."""

    @field_validator("gyro", "accel", "mag")
    @classmethod
    def _refuse_twice(cls, axes: Signed | None) -> Signed | None:
        if axes is not None and len({axis[-1] for axis in axes}) < 3:
            raise ValueError("each of x, y, z is needed once, with or without a minus")
        return axes
