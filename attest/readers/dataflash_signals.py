"""What DataFlash messages measure, in SI units, body FRD and world NED.

A sensor or filter of which there are several is one stream for each: ``IMU[0]``, ``IMU[1]`` by the
instance field, ``IMU``, ``IMU2`` in logs from before it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.readers import gps
from attest.readers.dataflash_format import Mask, Table
from attest.readers.values import any_of
from attest.recording import Kind, Note

Array = NDArray[np.float64]

FACTORS = {
    "": 1.0, "rad/s": 1.0, "deg/s": np.pi / 180.0, "m/s/s": 1.0, "m/s": 1.0, "m": 1.0,
    "Gauss": 1e-4, "mGauss": 1e-7, "deg": 1.0, "degheading": 1.0, "deglatitude": 1.0,
    "deglongitude": 1.0, "rad": 180.0 / np.pi,
}  # fmt: skip
"""From the units of UNIT to rad/s, m/s², m/s, tesla; angles to degrees."""

FAMILIES = {
    "IMU": ("IMU", "IMU2", "IMU3"),
    "GYR": ("GYR", "GYR1", "GYR2", "GYR3"),
    "ACC": ("ACC", "ACC1", "ACC2", "ACC3"),
    "MAG": ("MAG", "MAG2", "MAG3"),
    "GPS": ("GPS", "GPS2"),
    "GPA": ("GPA", "GPA2"),
    "XKQ": ("XKQ", "XKQ1", "XKQ2"),
    "NKQ": ("NKQ", "NKQ1", "NKQ2"),
}
"""Messages that are several instances of one thing."""
INSTANCES = ("I", "C")
"""Fields that number sensors and filters."""
RARE = 100
"""An instance with so many times fewer messages than another one is none."""

GYRO, ACCEL, MAG = (tuple(f"{stem}{axis}" for axis in "XYZ") for stem in ("Gyr", "Acc", "Mag"))
VELOCITY = ("VN", "VE", "VD")


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """The messages of one instance."""

    label: str
    message: str
    instance: int
    table: Table


@dataclass(frozen=True, slots=True)
class Attitude:
    """What an attitude is worth."""

    kind: Kind
    rank: int
    """Place among those of one kind; lower is better."""


ATTITUDES = {
    "SIM": Attitude("truth", 0),
    "SIM2": Attitude("truth", 1),
    # the filters' own quaternions are in the sensors' axes, as the measurements are; the others
    # are turned by the trim that a person set, and their angles are rounded
    "XKQ": Attitude("autopilot", 0),
    "NKQ": Attitude("autopilot", 1),
    "ATT": Attitude("autopilot", 2),
    "AHR2": Attitude("autopilot", 3),
    "XKF1": Attitude("autopilot", 4),
    "NKF1": Attitude("autopilot", 5),
}
"""By family of messages."""
WANTED = {
    *ATTITUDES, *FAMILIES, *(name for names in FAMILIES.values() for name in names), "POS", "MSG",
    "PARM", "VER",
}  # fmt: skip


def streams(tables: Mapping[str, Table], family: str, notes: list[Note]) -> list[Stream]:
    """Return the instances of one thing, in order; a number met once in a hundred is damage."""
    found = []
    for name in FAMILIES.get(family, (family,)):
        if name not in tables:
            continue
        table = tables[name]
        field = next((field for field in INSTANCES if field in table.columns), None)
        if field is None:
            number = int(name[-1]) - 1 if name != family else 0
            found.append(Stream(name, name, number, table))
            continue
        numbers, counts = np.unique(table.columns[field], return_counts=True)
        often = counts * RARE >= counts.max()
        if lost := int(counts[~often].sum()):
            notes.append(Note(f"{name} of instances that hardly occur dropped", lost))
        for number in numbers[often].tolist():
            mine = table if len(numbers) == 1 else table[table.columns[field] == number]
            found.append(Stream(f"{name}[{number}]", name, number, mine))
    return found


def columns(table: Table, names: tuple[str, ...], unit: str) -> Array | None:
    """Return fields side by side in SI units; None where one is missing.

    Parameters
    ----------
    unit
        What the values are in where the log does not tell.
    """
    if not set(names) <= table.columns.keys():
        return None
    side = []
    for name in names:
        values = table.columns[name]
        if values.ndim != 1 or values.dtype.kind not in "iuf":
            return None
        label, multiplier = table.units.get(name, ("", 1.0))
        factor = FACTORS[label] * multiplier if FACTORS.get(label) and label else FACTORS[unit]
        with np.errstate(invalid="ignore"):  # some NaN of float32 signal it when they are widened
            side.append(values.astype(np.float64) * factor)
    return np.stack(side, axis=1)


def measured(signal: str, table: Table) -> tuple[Array, Mask] | None:
    """Return gyro, accel or mag in SI units, and which rows hold a value."""
    names, unit = {"gyro": (GYRO, "rad/s"), "accel": (ACCEL, "m/s/s"), "mag": (MAG, "mGauss")}[
        signal
    ]
    y = columns(table, names, unit)
    if y is None:
        return None
    held = np.ones(len(y), np.bool_) if signal == "gyro" else any_of(y != 0.0)
    health = table.columns.get("Health")
    if signal == "mag" and health is not None and np.any(health):
        held &= health != 0
    return y, held


def velocity(stream: Stream) -> tuple[Array, Mask] | None:
    """Velocity of a filter or a receiver, north-east-down, m/s."""
    table = stream.table
    if not stream.message.startswith("GPS"):
        y = columns(table, VELOCITY, "m/s")
        return None if y is None else (y, np.ones(len(y), np.bool_))
    ground, course = columns(table, ("Spd", "VZ"), "m/s"), columns(table, ("GCrs",), "deg")
    if ground is None or course is None:
        return None
    with np.errstate(invalid="ignore"):
        angle = np.radians(course[:, 0])
        y = np.stack([ground[:, 0] * np.cos(angle), ground[:, 0] * np.sin(angle), ground[:, 1]], 1)
    return y, np.ones(len(y), np.bool_)


def quality(stream: Stream, speed: Stream | None) -> tuple[Array, Mask]:
    """Return the accuracy of a receiver's speed, m/s, (n,), and whether it has a fix.

    Parameters
    ----------
    speed
        Its messages GPA, which come with those of its place; 0 where they do not tell.
    """
    satellites = stream.table.columns.get("NSats", stream.table.columns.get("NSat"))
    held = fixed(stream.table)
    if satellites is not None and satellites.dtype.kind in "iu":
        held &= gps.fixed(np.full(len(held), gps.FIX), satellites)
    told = None if speed is None else columns(speed.table, ("SAcc",), "m/s")
    if speed is None or told is None or not len(told):
        return np.zeros(len(held)), held
    with_it = np.searchsorted(speed.table.at, stream.table.at)
    return told[np.minimum(with_it, len(told) - 1), 0], held


def position(stream: Stream) -> tuple[Array, Mask] | None:
    """Latitude and longitude in degrees, altitude in m; null island is no position."""
    place = columns(stream.table, ("Lat", "Lng"), "deg")
    height = columns(stream.table, ("Alt",), "m")
    if place is None or height is None:
        return None
    held = any_of(place != 0.0) & np.all(np.abs(place) <= [90.0, 180.0], axis=1)
    return np.hstack([place, height]), held & fixed(stream.table)


def fixed(table: Table) -> Mask:
    """Whether a receiver knew where it was; what is no receiver does."""
    status = table.columns.get("Status")
    return np.ones(len(table), np.bool_) if status is None else np.asarray(status >= gps.FIX)


def attitude(table: Table) -> tuple[Array, Mask] | None:
    """Quaternion, or else the angles as one."""
    q = columns(table, ("Q1", "Q2", "Q3", "Q4"), "")
    if q is not None:
        with np.errstate(invalid="ignore", over="ignore"):
            length = np.linalg.norm(q, axis=1)
            held = np.abs(length - 1.0) < 0.1  # far from unit length it was not filled in
        if held.any():
            return quaternion.normalize(q), held
    angles = columns(table, ("Roll", "Pitch", "Yaw"), "deg")
    if angles is None:
        return None
    with np.errstate(invalid="ignore"):
        held = np.full(len(angles), bool(np.any(angles != 0.0)))
        return quaternion.from_euler(*np.radians(angles).T), held
