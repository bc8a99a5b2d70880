"""What MAVLink messages measure, in SI units, body FRD and world NED.

Every function takes the rows of one message type and gives values with a mark for the rows that
hold one; nothing here knows of time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.readers import gps
from attest.recording import Kind

Rows = NDArray[np.void]
Array = NDArray[np.float64]
Values = tuple[Array, NDArray[np.bool_]]

GAUSS = 1e-4
"""Tesla."""
UNKNOWN = 255
"""Number of satellites that stands for none known."""
MOCAP = 6
"""MAV_ESTIMATOR_TYPE_MOCAP."""
LOCAL_NED, BODY_NED, BODY_FRD, LOCAL_FRD = 1, 8, 12, 20
"""MAV_FRAME values that ODOMETRY may name."""

INERTIAL = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")
"""The finest resolution first."""
UPDATED = {"accel": 0b111, "gyro": 0b111 << 3, "mag": 0b111 << 6}
"""Bits of HIGHRES_IMU.fields_updated."""
_SCALES = {
    "HIGHRES_IMU": {"accel": 1.0, "gyro": 1.0, "mag": GAUSS},
    "": {"accel": GRAVITY * 1e-3, "gyro": 1e-3, "mag": GAUSS * 1e-3},  # mg, mrad/s, mgauss
}
_FIELDS = {"accel": "acc", "gyro": "gyro", "mag": "mag"}


def inertial(name: str, rows: Rows, signal: str) -> Values:
    """Return gyro in rad/s, accel in m/s² or mag in tesla of an inertial message.

    A magnetometer or accelerometer that reads zero on all axes is not there.
    """
    scale = _SCALES.get(name, _SCALES[""])[signal]
    y = columns(rows, *(axis + _FIELDS[signal] for axis in "xyz"))
    held = np.ones(len(rows), np.bool_) if signal == "gyro" else np.any(y != 0.0, axis=1)
    if name == "HIGHRES_IMU" and np.any(rows["fields_updated"]):
        held &= rows["fields_updated"] & UPDATED[signal] == UPDATED[signal]
    return y * scale, held


def velocity(name: str, rows: Rows) -> Values:
    """Velocity in the world, m/s."""
    y = columns(rows, "vx", "vy", "vz") * (0.01 if name == "GLOBAL_POSITION_INT" else 1.0)
    return y, np.ones(len(rows), np.bool_)


def position(name: str, rows: Rows) -> Values:
    """Latitude and longitude in degrees, altitude in m; null island is no position."""
    y = columns(rows, "lat", "lon", "alt") * [1e-7, 1e-7, 1e-3]
    held = np.any(y[:, :2] != 0.0, axis=1) & np.all(np.abs(y[:, :2]) <= [90.0, 180.0], axis=1)
    if name == "GPS_RAW_INT":
        held &= rows["fix_type"] >= gps.FIX
    return y, held


def quality(rows: Rows) -> Values:
    """Return the accuracy of a receiver's speed, m/s, (n,), and whether it has a fix.

    It is zero where it is not told, as with those who send MAVLink 1.
    """
    names = rows.dtype.names or ()
    seen = np.where(rows["satellites_visible"] == UNKNOWN, 0, rows["satellites_visible"])
    accuracy = rows["vel_acc"] * 1e-3 if "vel_acc" in names else np.zeros(len(rows))
    return accuracy, gps.fixed(rows["fix_type"], seen)


def columns(rows: Rows, *names: str) -> Array:
    """Fields side by side as float64."""
    with np.errstate(invalid="ignore"):  # some NaN of float32 signal it when they are widened
        return np.stack([rows[name].astype(np.float64) for name in names], axis=1)


def _euler(rows: Rows) -> Values:
    angles = columns(rows, "roll", "pitch", "yaw")
    # level and north is an attitude, but not throughout
    held = np.full(len(angles), bool(np.any(angles != 0.0)))
    # not a number and infinity are left for the caller to drop
    with np.errstate(invalid="ignore"):
        return quaternion.from_euler(*angles.T), held


def _four(rows: Rows) -> Values:
    return _unit(columns(rows, "q1", "q2", "q3", "q4"))


def _array(rows: Rows) -> Values:
    return _unit(rows["q"].astype(np.float64))


def _unit(q: Array) -> Values:
    """Normalise; far from unit length a quaternion was not filled in."""
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(q, axis=1)
        return quaternion.normalize(q), np.abs(length - 1.0) < 0.1


def _odometry(rows: Rows) -> Values:
    q, held = _array(rows)
    world = np.isin(rows["frame_id"], (LOCAL_NED, LOCAL_FRD))
    # the standard means the attitude's body; older senders write NED for the same axes
    body = np.isin(rows["child_frame_id"], (BODY_FRD, BODY_NED))
    return q, held & world & body


@dataclass(frozen=True, slots=True)
class Attitude:
    """How a message tells an attitude, and what it is worth."""

    kind: Kind
    decode: Callable[[Any], Values]
    rank: int = 0
    """Place among those of one kind; lower is better."""
    foreign: bool = False
    """Whether someone else than the autopilot sends it."""


ATTITUDES = {
    "SIMSTATE": Attitude("truth", _euler),
    "SIM_STATE": Attitude("truth", _four),
    "ATT_POS_MOCAP": Attitude("truth", _array, foreign=True),
    "VICON_POSITION_ESTIMATE": Attitude("truth", _euler, foreign=True),
    "ATTITUDE_QUATERNION": Attitude("autopilot", _four),
    "ATTITUDE": Attitude("autopilot", _euler),
    "AHRS3": Attitude("autopilot", _euler, rank=1),
    "AHRS2": Attitude("autopilot", _euler, rank=2),
    "ODOMETRY": Attitude("autopilot", _odometry, rank=3, foreign=True),
    "VISION_POSITION_ESTIMATE": Attitude("autopilot", _euler, rank=4, foreign=True),
}
"""By message name."""


def attitude_doubt(name: str, rows: Rows) -> str | None:
    """Tell what to keep in mind about an attitude message."""
    if name == "ODOMETRY" and np.any(rows["frame_id"] == LOCAL_FRD):
        return "ODOMETRY in a local frame: its heading is not from north"
    if name == "ATTITUDE_QUATERNION":
        # a tailsitter's way to show its hover; the sensors' axes are those without it
        offset = rows["repr_offset_q"]
        if np.any((offset[:, 0] != 0.0) & np.any(np.abs(offset[:, 1:]) > 1e-3, axis=1)):
            return "ATTITUDE_QUATERNION with an offset for display: left out"
    return None
