"""What the command line and the configuration can tell a reader."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from attest.config import Csv
from attest.config.axes import Signed
from attest.recording import Note, World


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
    units: Mapping[str, str] | None = None
    """Units of gyro, accel or mag that should be SI, of other logs than CSVs."""
    axes: Mapping[str, Signed] | None = None
    """x, y, z of the body in the axes that a log gives for gyro, accel or mag."""
    references_alone: bool = False
    """Take a ROS log that has references but neither gyroscope nor feature points."""


TAKEN = {
    "vehicle": ("tlog",),
    "imu": ("tlog", "dataflash", "ulog", "ros"),
    "topics": ("ros",),
    "units": ("ros", "ulog", "dataflash", "tlog"),
}
"""Formats that have such a choice."""
NAMES = {"topics": "input.topics", "units": "input.unit"}
"""Of choices that have no option of their own."""
WORLDS: Mapping[str, World] = {
    "tlog": "ned",
    "dataflash": "ned",
    "ulog": "ned",
    "sensor_logger": "enu",
}
"""Of formats whose world is not to be chosen."""


def without_idle(form: str, options: ReadOptions) -> ReadOptions:
    """Leave out the choices that a log of this format does not have."""
    nothing: dict[str, Any] = dict.fromkeys(_idle(form, options))
    return replace(options, **nothing)


def told(form: str, options: ReadOptions) -> tuple[Note, ...]:
    """Tell of each choice that is left out: one configuration may be for logs of many formats."""
    notes = []
    for name in _idle(form, options):
        option = NAMES.get(name, f"--{name} (input.{name})")
        what = f"is in {WORLDS[form]}" if name == "world" else f"has no choice of {name}"
        if name == "units":
            what = "has input.csv.gyro.unit, and so on"
        notes.append(Note(f"{option} means nothing here, {form} {what}: left out", doubt=True))
    return tuple(notes)


def _idle(form: str, options: ReadOptions) -> list[str]:
    """Name the choices that were made and that a format does not have."""
    made = (name for name in TAKEN if getattr(options, name) not in (None, {}))
    idle = [name for name in made if form not in TAKEN[name]]
    fixed = options.world is not None and WORLDS.get(form, options.world) != options.world
    return [*idle, "world"] if fixed else idle
