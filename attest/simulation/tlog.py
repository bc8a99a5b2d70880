"""A telemetry log: MAVLink 2 frames of ArduPilot, each behind the receiver's stamp.

Sensors keep their own clock; the receiver's stamps are late and come in bursts. SIMSTATE carries
no time and follows the ATTITUDE whose moment it shares, as ArduPilot's simulator sends them.
"""

import struct
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.simulation import sensors
from attest.simulation.flight import Array, Flight, Times, believed, following

_SECOND = 10**9
_TOGETHER = (("gyro", "accel", "mag"), ("position", "velocity"))
"""What one message carries."""
_LATENCY = (5_000_000, 40_000_000)  # of the link, ns
_SPACING = 20_000  # between frames of one burst, ns
_HOLDS, _HOLD = 6, 300_000_000  # how often and how long the receiver sits on what it has, ns


class _Sent(NamedTuple):
    """One message on its way."""

    t: int
    rank: int
    """Order among messages of one moment."""
    message: Any


def encode(flight: Flight) -> bytes:
    """Serialise a flight, the same bytes for the same flight.

    Raises
    ------
    ConfigError
        The flight lacks what the messages carry.
    """
    autopilot = believed(flight, tuple(name for names in _TOGETHER for name in names), "a tlog")
    _share_clocks(flight)
    vehicle = sorted([*_vehicle(flight, autopilot)], key=lambda sent: sent[:2])
    arrivals = _arrivals(flight, np.array([sent.t for sent in vehicle]))
    frames = [*zip(arrivals.tolist(), _pack(vehicle, 1, 1), vehicle, strict=True)]
    lost = ~flight.received(np.array([sent.t for sent in vehicle]))
    rows = [(t, frame) for (t, frame, _), gone in zip(frames, lost, strict=True) if not gone]
    station = [*_station(flight)]  # hears itself without delay or loss
    rows += zip([sent.t for sent in station], _pack(station, 255, 190), strict=True)
    rows.sort(key=lambda row: row[0])
    offset = flight.utc_offset or 0
    return b"".join(struct.pack(">Q", (t + offset) // 1000) + frame for t, frame in rows)


def _share_clocks(flight: Flight) -> None:
    """Refuse a flight whose signals of one message have not the same times."""
    for first, *others in _TOGETHER:
        for name in others:
            if not np.array_equal(flight.signals[name].t, flight.signals[first].t):
                raise ConfigError(
                    f"{first} and {name} have not the same times, as one message of a tlog has. "
                    "Change the rate of both, or write a .csv instead."
                )


def _pack(sent: Iterable[_Sent], system: int, component: int) -> Iterator[bytes]:
    link = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    for _, _, message in sent:
        yield bytes(message.pack(link))
        link.seq = (link.seq + 1) % 256


def _arrivals(flight: Flight, t: Times) -> Times:
    """When the receiver stamps what was sent at t: late, in order, now and then in a burst."""
    rng = np.random.default_rng([flight.seed, 1])  # apart from the flight's own noise
    arrival = t + rng.integers(*_LATENCY, len(t))
    for start in rng.integers(t[0], t[-1], _HOLDS):
        held = (start <= arrival) & (arrival < start + _HOLD)
        arrival[held] = start + _HOLD
    queue = _SPACING * np.arange(len(t))
    ordered: Times = np.maximum.accumulate(arrival - queue) + queue
    return ordered


def _vehicle(flight: Flight, autopilot: Array) -> Iterator[_Sent]:
    """All that the autopilot sends."""
    yield from _attitude(flight, autopilot)
    yield from _imu(flight)
    yield from _navigation(flight, autopilot)
    yield from _status(flight)


def _attitude(flight: Flight, autopilot: Array) -> Iterator[_Sent]:
    """ATTITUDE, a little wrong, and SIMSTATE, true, at each time of the truth."""
    wrong, true = _rows(quaternion.to_euler(autopilot)), _rows(quaternion.to_euler(flight.q))
    places = _degrees_e7(sensors.geodetic(flight.position)[:, :2])
    force, rates = _rows(following(flight.signals["accel"], flight.t)), _rows(flight.omega)
    rows = zip(flight.t.tolist(), wrong, true, force, rates, places, strict=True)
    for t, euler, truth, f, omega, place in rows:
        yield _Sent(t, 0, mavlink.MAVLink_attitude_message(t // 10**6, *euler, *omega))
        yield _Sent(t, 1, mavlink.MAVLink_simstate_message(*truth, *f, *omega, *place))


def _imu(flight: Flight) -> Iterator[_Sent]:
    """RAW_IMU in ArduPilot's units: mG, mrad/s and mgauss, whole."""
    gyro, accel, mag = (flight.signals[name] for name in ("gyro", "accel", "mag"))
    columns = np.hstack([accel.y / GRAVITY * 1e3, gyro.y * 1e3, mag.y * 1e7])
    for t, counts in zip(gyro.t.tolist(), _whole(columns, 16), strict=True):
        raw_imu = mavlink.MAVLink_raw_imu_message(t // 1000, *counts, id=0, temperature=3150)
        yield _Sent(t, 2, raw_imu)


def _navigation(flight: Flight, autopilot: Array) -> Iterator[_Sent]:
    """LOCAL_POSITION_NED at 10 Hz, GLOBAL_POSITION_INT at 5 Hz, GPS_RAW_INT at 2 Hz."""
    position, velocity = flight.signals["position"], flight.signals["velocity"]
    metres = sensors.local(position.y)
    local, moving = _rows(metres), _rows(velocity.y)
    degrees, height = _degrees_e7(position.y[:, :2]), _whole(position.y[:, 2:] * 1e3, 32)
    above, speed = _whole(-1e3 * metres[:, 2:], 32), _whole(velocity.y * 100.0, 16)
    heading = _heading(quaternion.slerp(flight.t, autopilot, position.t, _SECOND))
    for i, t in enumerate(position.t.tolist()):
        ms, where = t // 10**6, (*degrees[i], *height[i])
        place = (*local[i], *moving[i])
        yield _Sent(t, 3, mavlink.MAVLink_local_position_ned_message(ms, *place))
        if i % 2 == 0:
            rest = (*above[i], *speed[i], heading[i])
            yield _Sent(t, 4, mavlink.MAVLink_global_position_int_message(ms, *where, *rest))
        if i % 5 == 0:
            ground, course = _course(velocity.y[i])
            fix = mavlink.MAVLink_gps_raw_int_message(
                ms * 1000, 3, *where, eph=80, epv=120, vel=ground, cog=course, satellites_visible=14
            )
            yield _Sent(t, 5, fix)


def _status(flight: Flight) -> Iterator[_Sent]:
    """HEARTBEAT and SYSTEM_TIME, once a second."""
    for t in range(int(flight.t[0]), int(flight.t[-1]), _SECOND):
        heartbeat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 209, 5, 4, 3
        )
        yield _Sent(t, 6, heartbeat)
        unix = (t + (flight.utc_offset or 0)) // 1000
        yield _Sent(t, 7, mavlink.MAVLink_system_time_message(unix, t // 10**6))


def _station(flight: Flight) -> Iterator[_Sent]:
    """HEARTBEAT of the ground station that records."""
    for t in range(int(flight.t[0]) + _SECOND // 3, int(flight.t[-1]), _SECOND):
        heartbeat = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
        )
        yield _Sent(t, 0, heartbeat)


def _heading(q: Array) -> list[int]:
    """Heading, hundredths of a degree from north, clockwise; 65535 where unknown."""
    yaw = np.degrees(quaternion.to_euler(q)[:, 2])
    centi = np.where(np.isnan(yaw), 65535, np.rint(yaw % 360.0 * 100.0) % 36000)
    return [int(value) for value in centi.tolist()]


def _course(velocity: Array) -> tuple[int, int]:
    """Ground speed, cm/s, and course over ground, hundredths of a degree."""
    north, east, _ = velocity
    course = np.degrees(np.arctan2(east, north)) % 360.0
    return round(float(np.hypot(north, east)) * 100.0), round(float(course) * 100.0) % 36000


def _degrees_e7(degrees: Array) -> list[list[int]]:
    return _whole(degrees * 1e7, 32)


def _rows(values: Array) -> list[list[float]]:
    """Round so far that another machine's last bit does not show in a float32."""
    rows: list[list[float]] = (np.round(values, 7) + 0.0).tolist()  # and no -0.0
    return rows


def _whole(values: Array, bits: int) -> list[list[int]]:
    """Round to signed integers, held at the ends of their range."""
    top = 2 ** (bits - 1)
    rows: list[list[int]] = np.clip(np.rint(values), -top, top - 1).astype(np.int64).tolist()
    return rows
