"""Units that the numbers of a log can be in."""

from collections.abc import Mapping
from math import pi
from typing import Literal

from attest.config.section import Section
from attest.geometry.earth import GRAVITY

GyroUnit = Literal["rad/s", "deg/s"]
AccelUnit = Literal["m/s2", "m/s^2", "g", "mg"]
MagUnit = Literal["T", "mT", "uT", "nT", "gauss", "mgauss"]

UNITS: Mapping[str, Mapping[str, float]] = {
    "gyro": {"rad/s": 1.0, "deg/s": pi / 180.0},
    "accel": {"m/s2": 1.0, "m/s^2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "mag": {"uT": 1e-6, "gauss": 1e-4, "mgauss": 1e-7, "nT": 1e-9, "mT": 1e-3, "T": 1.0},
}
"""In SI, by signal; the first is the one of a CSV's canonical columns."""


class Units(Section):
    """Units of a log's numbers that should be SI and are not; of a CSV input.csv tells them."""

    gyro: GyroUnit | None = None
    """Of angular velocity; null is rad/s."""
    accel: AccelUnit | None = None
    """Of specific force, g being 9.80665 m/s²; null is m/s2."""
    mag: MagUnit | None = None
    """Of the magnetic field; null is T."""
