"""What the command line and the configuration can tell a reader."""

from collections.abc import Mapping
from dataclasses import dataclass

from attest.config import Csv
from attest.recording import World


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Choices that a log leaves open; None leaves them to the reader."""

    vehicle: str | None = None
    """MAVLink system, ``1``, or system and component, ``1/1``."""
    imu: str | None = None
    """The inertial message to use, such as ``SCALED_IMU2``, or the topic."""
    topics: Mapping[str, str] | None = None
    """Topic for gyro, accel, mag, velocity, position, torque, points or reference."""
    world: World | None = None
    """World axes of a log that does not say."""
    csv: Csv | None = None
    """Columns and units of a CSV that is not the canonical one."""
