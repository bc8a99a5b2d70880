"""What PX4's topics measure, in SI units, body FRD and world NED.

Every function takes one instance of a topic and gives times in microseconds, values, and a mark
for the rows that hold one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.readers import gps
from attest.recording import Kind

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Values = tuple[Ints, Array, Mask]

GAUSS = 1e-4
"""Tesla."""
UNKNOWN = 0x7FFFFFFF
"""A time relative to the message's that is none."""
OLDEST_SAMPLE = 1_000_000
"""What is published was measured at most so long before, microseconds."""
LATEST = 2**50
"""Microseconds since boot that no vehicle lives to see."""


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """One instance of a topic."""

    label: str
    topic: str
    instance: int
    data: Mapping[str, NDArray[Any]]

    def has(self, *names: str) -> bool:
        """Whether the topic has these fields."""
        return self.data.keys() >= set(names)

    def __len__(self) -> int:
        return len(self.data["timestamp"])


def micros(stream: Stream) -> Ints:
    """Return the times at which the rows were measured, or else published."""
    stamp: Ints = np.minimum(stream.data["timestamp"], LATEST).astype(np.int64)
    if not stream.has("timestamp_sample"):
        return stamp
    sample: Ints = np.minimum(stream.data["timestamp_sample"], LATEST).astype(np.int64)
    old = (sample > 0) & (sample <= stamp) & (stamp - sample <= OLDEST_SAMPLE)
    return np.where(old, sample, stamp)


def _columns(stream: Stream, *names: str) -> Array | None:
    if not stream.has(*names):
        return None
    with np.errstate(invalid="ignore"):  # some NaN of float32 signal it when they are widened
        return np.stack([stream.data[name].astype(np.float64) for name in names], axis=1)


def _three(stream: Stream, stem: str) -> Array | None:
    return _columns(stream, *(f"{stem}[{i}]" for i in range(3)))


def _all(y: Array) -> Mask:
    return np.ones(len(y), np.bool_)


def _relative(stream: Stream, sensor: str) -> tuple[Ints, Mask]:
    """Return the times of a sensor that sensor_combined gives relative to the gyroscope's."""
    name = f"{sensor}_timestamp_relative"
    if not stream.has(name):
        return micros(stream), np.ones(len(stream), np.bool_)
    late = stream.data[name].astype(np.int64)
    return micros(stream) + np.where(late == UNKNOWN, 0, late), late != UNKNOWN


def _combined(stem: str, sensor: str, scale: float = 1.0) -> Callable[[Stream], Values | None]:
    def decode(stream: Stream) -> Values | None:
        y = _three(stream, stem)
        if y is None:
            return None
        t, held = _relative(stream, sensor)
        # a slower sensor's value stays until the next one: its time tells which are new
        new = np.concatenate([[True], np.diff(t) != 0]) if sensor == "magnetometer" else _all(y)
        held &= np.any(y != 0.0, axis=1) | (sensor == "gyro")
        return t[new], y[new] * scale, held[new]

    return decode


def _plain(*names: str, scale: float = 1.0, zero: bool = True) -> Callable[[Stream], Values | None]:
    """Read three fields; ``zero`` tells whether nought on all axes is a value."""

    def decode(stream: Stream) -> Values | None:
        y = _columns(stream, *names)
        if y is None:
            return None
        return micros(stream), y * scale, _all(y) if zero else np.any(y != 0.0, axis=1)

    return decode


def _integral(stem: str) -> Callable[[Stream], Values | None]:
    """Read an increment over its time as the mean rate."""

    def decode(stream: Stream) -> Values | None:
        y, span = _three(stream, stem), _columns(stream, f"{stem}_dt")
        if y is None or span is None:
            return None
        held = span[:, 0] > 0.0
        return micros(stream), y / np.where(held, span[:, 0], 1.0)[:, np.newaxis] * 1e6, held

    return decode


def _fifo(stream: Stream) -> Values | None:
    """Take the samples of a burst apart, of which the last has the burst's time."""
    most = sum(stream.has(f"x[{i}]") for i in range(256))
    if not most or not stream.has("dt", "scale", "samples"):
        return None
    count = np.minimum(stream.data["samples"].astype(np.int64), most)
    step, scale = stream.data["dt"].astype(np.float64), stream.data["scale"].astype(np.float64)
    held = np.isfinite(step) & (step > 0.0) & (step < OLDEST_SAMPLE) & np.isfinite(scale)
    index = np.arange(most)
    before = (count[:, np.newaxis] - 1 - index) * np.where(held, step, 0.0)[:, np.newaxis]
    t = micros(stream)[:, np.newaxis] - np.rint(before).astype(np.int64)
    axes = [np.stack([stream.data[f"{axis}[{i}]"] for i in index], axis=1) for axis in "xyz"]
    y = np.stack(axes, axis=-1) * scale[:, np.newaxis, np.newaxis]
    there = index < count[:, np.newaxis]
    return t[there], y[there], np.broadcast_to(held[:, np.newaxis], there.shape)[there]


XYZ = ("x", "y", "z")
GYRO: dict[str, Callable[[Stream], Values | None]] = {
    "sensor_combined": _combined("gyro_rad", "gyro"),
    "vehicle_imu": _integral("delta_angle"),
    "sensor_gyro": _plain(*XYZ),
    "sensor_gyro_fifo": _fifo,
}
"""What is corrected first, in the order of preference."""
ACCEL: dict[str, Callable[[Stream], Values | None]] = {
    "sensor_combined": _combined("accelerometer_m_s2", "accelerometer"),
    "vehicle_imu": _integral("delta_velocity"),
    "sensor_accel": _plain(*XYZ, zero=False),
    "sensor_accel_fifo": _fifo,
}
MAG: dict[str, Callable[[Stream], Values | None]] = {
    "vehicle_magnetometer": _plain(*(f"magnetometer_ga[{i}]" for i in range(3)), scale=GAUSS,
                                   zero=False),
    "sensor_combined": _combined("magnetometer_ga", "magnetometer", GAUSS),
    "sensor_mag": _plain(*XYZ, scale=GAUSS, zero=False),
}  # fmt: skip
RAW = ("sensor_gyro", "sensor_gyro_fifo", "sensor_accel", "sensor_accel_fifo", "sensor_mag")
"""Topics from before the autopilot's calibration."""
PARTNERS = {"sensor_gyro": "sensor_accel", "sensor_gyro_fifo": "sensor_accel_fifo"}
"""Which topic has the accelerometer that belongs to a gyroscope."""
GPS = ("vehicle_gps_position", "sensor_gps")
VELOCITY = ("vehicle_local_position", *GPS)
POSITION = ("vehicle_global_position", *GPS)


def velocity(stream: Stream) -> Values | None:
    """Velocity, north-east-down, m/s, where its maker says that it is valid."""
    if stream.topic in GPS:
        y = _columns(stream, "vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
        marks = [stream.data["vel_ned_valid"] != 0] if stream.has("vel_ned_valid") else []
    else:
        y = _columns(stream, "vx", "vy", "vz")
        marks = [stream.data[name] != 0 for name in ("v_xy_valid", "v_z_valid") if stream.has(name)]
    if y is None:
        return None
    return micros(stream), y, np.logical_and.reduce([_all(y), *marks])


def position(stream: Stream) -> Values | None:
    """Latitude and longitude in degrees, altitude in m; null island is no position."""
    scale = [1.0, 1.0, 1.0]
    if stream.topic not in GPS:
        y = _columns(stream, "lat", "lon", "alt")
    elif stream.has("latitude_deg"):
        y = _columns(stream, "latitude_deg", "longitude_deg", "altitude_msl_m")
    else:
        y, scale = _columns(stream, "lat", "lon", "alt"), [1e-7, 1e-7, 1e-3]
    if y is None:
        return None
    with np.errstate(invalid="ignore"):  # some NaN signal it when they are multiplied
        y = y * scale
        held = np.any(y[:, :2] != 0.0, axis=1) & np.all(np.abs(y[:, :2]) <= [90.0, 180.0], axis=1)
    return micros(stream), y, held & (fixed(stream) | (stream.topic not in GPS))


def fixed(stream: Stream) -> Mask:
    """Whether a receiver knew where it was."""
    kind = stream.data.get("fix_type", np.zeros(len(stream)))
    return gps.fixed(kind, stream.data.get("satellites_used"))


def quality(stream: Stream) -> tuple[Array, Mask]:
    """Return how accurate a velocity is by its maker's word, m/s, (n,), and whether it can be.

    The accuracy is zero where it is not told.
    """
    names = ("s_variance_m_s",) if stream.topic in GPS else ("evh", "evv")
    told = _columns(stream, *names)
    accuracy = np.zeros(len(stream)) if told is None else np.asarray(told.max(axis=1))
    return accuracy, fixed(stream) if stream.topic in GPS else np.ones(len(stream), np.bool_)


def utc(stream: Stream) -> Ints | None:
    """Microseconds of UTC less those since boot, by row, where a receiver tells."""
    if not stream.has("time_utc_usec"):
        return None
    told = np.minimum(stream.data["time_utc_usec"], 2**60).astype(np.int64)
    late = stream.data.get("timestamp_time_relative", np.zeros(len(stream), np.int32))
    stamp = np.minimum(stream.data["timestamp"], LATEST).astype(np.int64)
    return np.asarray(told - stamp - late.astype(np.int64))


@dataclass(frozen=True, slots=True)
class Attitude:
    """What the attitude of a topic is worth."""

    kind: Kind
    frames: Mapping[str, tuple[int, ...]] | None = None
    """Field that names the world's axes, and its values for north and for a free heading."""


_ODOMETRY = {"local_frame": (0, 1), "pose_frame": (1, 2)}
ATTITUDES = {
    "vehicle_attitude_groundtruth": Attitude("truth"),
    "vehicle_mocap_odometry": Attitude("truth", _ODOMETRY),
    "att_pos_mocap": Attitude("truth"),
    "vehicle_attitude": Attitude("autopilot"),
    "estimator_attitude": Attitude("autopilot"),
    "vehicle_visual_odometry": Attitude("autopilot", _ODOMETRY),
    "vehicle_vision_attitude": Attitude("autopilot"),
}
"""By topic, the best first."""
WANTED = {*GYRO, *ACCEL, *MAG, *VELOCITY, *POSITION, *ATTITUDES}


def attitude(stream: Stream) -> Values | None:
    """Quaternion, body to world."""
    q = _columns(stream, *(f"q[{i}]" for i in range(4)))
    if q is None:
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        held = np.abs(np.linalg.norm(q, axis=1) - 1.0) < 0.1  # or it was not filled in
    for name, values in (ATTITUDES[stream.topic].frames or {}).items():
        if stream.has(name):
            held &= np.isin(stream.data[name], values)
    return micros(stream), quaternion.normalize(q), held


def free_heading(stream: Stream) -> bool:
    """Whether the heading of an attitude is not from north."""
    frames = ATTITUDES[stream.topic].frames or {}
    return any(bool(np.any(stream.data[name] == values[1])) for name, values in frames.items()
               if stream.has(name))  # fmt: skip
