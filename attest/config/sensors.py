"""What is known before of the sensors' own errors."""

from typing import Annotated

from pydantic import Field, field_validator

from attest.config.section import Section

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
Scale = Annotated[float, Field(ge=0.5, le=2)]


class Accelerometer(Section):
    """The accelerometer's own errors: the specific force is scale (measured - bias)."""

    bias: Vector3 = (0.0, 0.0, 0.0)
    """m/s²."""
    scale: tuple[Scale, Scale, Scale] = (1.0, 1.0, 1.0)
    """Of each axis, 1."""


class Iron(Section):
    """A magnetometer's calibration: the field is soft_iron (measured - hard_iron)."""

    hard_iron: Vector3 = (0.0, 0.0, 0.0)
    """µT, in the body."""
    soft_iron: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """By rows, 1."""

    @field_validator("soft_iron")
    @classmethod
    def _refuse_flat(cls, soft_iron: Matrix3) -> Matrix3:
        return _regular(soft_iron)


def _regular(m: Matrix3) -> Matrix3:
    """Refuse a matrix that mirrors, or that flattens directions."""
    (a, b, c), (d, e, f), (g, h, i) = m
    volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    size = sum(x * x for row in m for x in row) ** 0.5
    if volume <= 1e-3 * size**3:
        raise ValueError("it mirrors or flattens what is measured, or nearly so")
    return m
