"""An on-board log of PX4: ULog messages that describe themselves first.

What the link lost is a dropout here: the card was busy then.
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from attest.simulation.flight import Array, Flight, Times, believed, following

_MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35\x01"
_NEEDED = ("gyro", "accel", "mag", "position", "velocity")
_TYPES = {"uint64_t": "<u8", "int32_t": "<i4", "uint32_t": "<u4", "uint8_t": "u1", "bool": "u1",
          "float": "<f4", "double": "<f8"}  # fmt: skip
_ATTITUDE = "timestamp_sample:uint64_t q:float[4] delta_q_reset:float[4] quat_reset_counter:uint8_t"
_TOPICS = {
    "sensor_combined": "gyro_rad:float[3] gyro_integral_dt:uint32_t "
    "accelerometer_timestamp_relative:int32_t accelerometer_m_s2:float[3] "
    "accelerometer_integral_dt:uint32_t accelerometer_clipping:uint8_t",
    "vehicle_magnetometer": "timestamp_sample:uint64_t device_id:uint32_t "
    "magnetometer_ga:float[3] calibration_count:uint8_t",
    "vehicle_attitude": _ATTITUDE,
    "vehicle_attitude_groundtruth": _ATTITUDE,
    "vehicle_local_position": "timestamp_sample:uint64_t vx:float vy:float vz:float xy_valid:bool "
    "z_valid:bool v_xy_valid:bool v_z_valid:bool",
    "vehicle_global_position": "timestamp_sample:uint64_t lat:double lon:double alt:float",
    "vehicle_gps_position": "time_utc_usec:uint64_t lat:int32_t lon:int32_t alt:int32_t "
    "vel_n_m_s:float vel_e_m_s:float vel_d_m_s:float timestamp_time_relative:int32_t "
    "fix_type:uint8_t vel_ned_valid:bool satellites_used:uint8_t",
}
"""Fields behind the timestamp, by PX4's names."""


class _Logged(NamedTuple):
    """One message."""

    t: int
    rank: int
    """Order among messages of one moment."""
    data: bytes


def encode(flight: Flight) -> bytes:
    """Serialise a flight, the same bytes for the same flight.

    Raises
    ------
    ConfigError
        The flight lacks what the messages carry.
    """
    autopilot = believed(flight, _NEEDED, "a .ulg")
    logged = [*_sensors(flight), *_attitudes(flight, autopilot), *_navigation(flight)]
    heard = flight.received(np.array([message.t for message in logged]))
    kept = [message for message, there in zip(logged, heard, strict=True) if there]
    kept += _dropouts(flight)
    kept.sort(key=lambda message: message[:2])
    header = _MAGIC + struct.pack("<Q", kept[0].t // 1000)
    return b"".join([header, *_definitions(), *(message.data for message in kept)])


def _definitions() -> Iterator[bytes]:
    """All that the log says about itself, and the subscriptions."""
    yield _packed("B", bytes(40))
    for name, fields in _TOPICS.items():
        parts = [part.split(":") for part in fields.split()]
        listed = "".join(f"{kind} {field};" for field, kind in parts)
        yield _packed("F", f"{name}:uint64_t timestamp;{listed}".encode())
    for key, value in (("sys_name", "PX4"), ("ver_hw", "SIMULATED")):
        typed = f"char[{len(value)}] {key}"
        yield _packed("I", bytes([len(typed)]) + (typed + value).encode())
    version = "uint32_t ver_sw_release"
    yield _packed("I", bytes([len(version)]) + version.encode() + struct.pack("<I", 0x010F00FF))
    for number, name in enumerate(_TOPICS):
        yield _packed("A", struct.pack("<BH", 0, number) + name.encode())


def _sensors(flight: Flight) -> Iterator[_Logged]:
    gyro, accel, mag = (flight.signals[name] for name in ("gyro", "accel", "mag"))
    force = following(accel, gyro.t)
    yield from _data("sensor_combined", gyro.t, gyro_rad=gyro.y, accelerometer_m_s2=force)
    gauss = {"magnetometer_ga": mag.y * 1e4}
    yield from _data("vehicle_magnetometer", mag.t, timestamp_sample=mag.t // 1000, **gauss)


def _attitudes(flight: Flight, autopilot: Array) -> Iterator[_Logged]:
    """vehicle_attitude, a little wrong, and its ground truth."""
    sample = {"timestamp_sample": flight.t // 1000}
    yield from _data("vehicle_attitude", flight.t, **sample, q=autopilot)
    yield from _data("vehicle_attitude_groundtruth", flight.t, **sample, q=flight.q)


def _navigation(flight: Flight) -> Iterator[_Logged]:
    """Velocity and place as often as the filter gives them, the receiver's at half that rate."""
    velocity, position = flight.signals["velocity"], flight.signals["position"]
    moving = dict(zip(("vx", "vy", "vz"), velocity.y.T, strict=True))
    valid = dict.fromkeys(("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), np.array(1))
    yield from _data("vehicle_local_position", velocity.t, **moving, **valid)
    latitude, longitude, altitude = position.y.T
    place = {"lat": latitude, "lon": longitude, "alt": altitude}
    yield from _data("vehicle_global_position", position.t, **place)
    t = position.t[::2]
    north, east, down = following(velocity, t).T
    scales = {"lat": 1e7, "lon": 1e7, "alt": 1e3}
    fix = {name: values[::2] * scales[name] for name, values in place.items()}
    known = flight.utc_offset is not None
    fix["time_utc_usec"] = (t + (flight.utc_offset or 0)) // 1000 * known
    fix |= {"vel_n_m_s": north, "vel_e_m_s": east, "vel_d_m_s": down}
    counts = {"fix_type": 3, "vel_ned_valid": 1, "satellites_used": 14}
    status = {name: np.array(count) for name, count in counts.items()}
    yield from _data("vehicle_gps_position", t, **fix, **status)


def _dropouts(flight: Flight) -> Iterator[_Logged]:
    for start, end in flight.outages:
        lasted = min((end - start) // 10**6, 65_535)
        yield _Logged(end, -1, _packed("O", struct.pack("<H", lasted)))


def _data(name: str, t: Times, **fields: Array | Times) -> list[_Logged]:
    """Pack the messages of one topic; fields that are not named are zero."""
    parts = [part.split(":") for part in ("timestamp:uint64_t " + _TOPICS[name]).split()]
    dtype = np.dtype([("id", "<u2"), *(_typed(field, kind) for field, kind in parts)])
    rows = np.zeros(len(t), dtype)
    rows["id"], rows["timestamp"] = list(_TOPICS).index(name), t // 1000
    for field, values in fields.items():
        # rounded so far that another machine's last bit does not show in a float32
        exact = dtype[field].base.kind != "f"
        rows[field] = np.rint(values) if exact else np.round(values, 9) + 0.0
    data, size = rows.tobytes(), dtype.itemsize
    cut = [data[start : start + size] for start in range(0, len(data), size)]
    rank = list(_TOPICS).index(name)
    return [_Logged(at, rank, _packed("D", row)) for at, row in zip(t.tolist(), cut, strict=True)]


def _typed(field: str, kind: str) -> tuple[str, str, tuple[int, ...]]:
    plain, _, count = kind.rstrip("]").partition("[")
    return field, _TYPES[plain], (int(count),) if count else ()


def _packed(kind: str, message: bytes) -> bytes:
    return struct.pack("<HB", len(message), ord(kind)) + message
