"""What a flight's topics say, as ROS has it: body forward-left-up, world east-north-up (REP-103).

    /imu/data_raw  /imu/mag  /gps/fix  /velocity  /wrench  /points
    /ground_truth/pose, the truth, and /autopilot/pose, what the autopilot believes

A gyroscope and an accelerometer of different times have a topic each. A flight without gyroscope
keeps its own axes: such points are seen from no vehicle that would have a front.

Stamps are UTC; a flight without a date is on simulated time, which starts at one second, for a
stamp of zero says that there is none. The recorder is a few milliseconds late.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from rosbags.typesys.store import Typestore

from attest.errors import ConfigError
from attest.geometry import frames
from attest.recording import Signal
from attest.simulation.flight import Array, Flight, Times

BODY, WORLD = "base_link", "map"
"""Frames."""
_START = 10**9  # ns, of simulated time
_SECOND = 10**9
_LATENCY = (1_000_000, 5_000_000)  # of the recorder, ns
_DECIMALS = {"mag": 13}  # so far that another machine's last bit does not show
_CARRIED = ("gyro", "accel", "mag", "position", "velocity", "torque")
_POINT = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("id", "<u4")])
_FIELDS = (("x", 0, 8), ("y", 8, 8), ("z", 16, 8), ("id", 24, 6))
"""Of a cloud: name, offset, and 8 for float64, 6 for uint32."""


class Published(NamedTuple):
    """One message on a topic."""

    t: int
    """When it was recorded, ns."""
    topic: str
    type: str
    message: Any


class _Topic(NamedTuple):
    """Messages of one topic before they have a header."""

    name: str
    type: str
    frame: str
    t: Times
    fields: list[dict[str, Any]]


def publish(flight: Flight, store: Typestore) -> list[Published]:
    """Return all messages in the order in which they were recorded.

    Raises
    ------
    ConfigError
        The flight has signals for which ROS has no message.
    """
    foreign = [name for name in flight.signals if name not in _CARRIED and not _is_point(name)]
    if foreign:
        lack = ", ".join(foreign)
        raise ConfigError(f"ROS has no message for {lack} of {flight.scenario}. Write a .csv.")
    rng = np.random.default_rng([flight.seed, 2])  # apart from the flight's own noise
    sent = [one for topic in _topics(flight, store.types) for one in _sent(flight, topic, store)]
    late = rng.integers(*_LATENCY, len(sent)).tolist()
    recorded = [one._replace(t=one.t + delay) for one, delay in zip(sent, late, strict=True)]
    return sorted(recorded, key=lambda one: one.t)


def _is_point(name: str) -> bool:
    return name.removeprefix("point").isdecimal()


def _sent(flight: Flight, topic: _Topic, store: Typestore) -> Iterator[Published]:
    """Put a header before what was received."""
    make, heard = store.types[topic.type], flight.received(topic.t)
    offset = _START if flight.utc_offset is None else flight.utc_offset
    for i in np.flatnonzero(heard).tolist():
        at = int(topic.t[i]) + offset
        header = _header(store, at, i, topic.frame)
        yield Published(at, topic.name, topic.type, make(header=header, **topic.fields[i]))


def _header(store: Typestore, at: int, number: int, frame: str) -> Any:
    """Fill in a header, which counts the messages in ROS 1."""
    kind = "std_msgs/msg/Header"
    stamp = store.types["builtin_interfaces/msg/Time"](sec=at // _SECOND, nanosec=at % _SECOND)
    names = {name for name, _ in store.get_msgdef(kind).fields}
    count = {"seq": number} if "seq" in names else {}
    return store.types[kind](stamp=stamp, frame_id=frame, **count)


def _topics(flight: Flight, types: Mapping[str, Any]) -> Iterator[_Topic]:
    yield from _inertial(flight, types)
    yield from _vectors(flight, types)
    if "position" in flight.signals:
        yield _fix(flight.signals["position"], types)
    poses = {"/ground_truth/pose": flight.q, "/autopilot/pose": flight.autopilot}
    for name, q in poses.items():
        if q is not None:
            yield _pose(name, flight, q, types)
    points = {name: signal for name, signal in flight.signals.items() if _is_point(name)}
    if points:
        yield _clouds(points, types)


def _inertial(flight: Flight, types: Mapping[str, Any]) -> Iterator[_Topic]:
    """Both in one message where they have the same times."""
    held = {name: flight.signals[name] for name in ("gyro", "accel") if name in flight.signals}
    clocks = {signal.t.tobytes() for signal in held.values()}
    if len(clocks) == 1:
        yield _imu("/imu/data_raw", flight, held, types)
        return
    for name, signal in held.items():
        yield _imu(f"/imu/{name}", flight, {name: signal}, types)


def _imu(
    topic: str, flight: Flight, held: Mapping[str, Signal], types: Mapping[str, Any]
) -> _Topic:
    """Fill in Imu; a covariance that begins with -1 says that a value is not there."""
    t = next(iter(held.values())).t
    nothing, unknown = np.array([-1.0, *np.zeros(8)]), np.zeros(9)
    blank = [_vector(types, np.zeros(3))] * len(t)
    gyro, accel = (
        _three(flight, name, held[name], types) if name in held else blank
        for name in ("gyro", "accel")
    )
    fixed = {
        "orientation": _quaternion(types, np.array([1.0, 0.0, 0.0, 0.0])),
        "orientation_covariance": nothing,
        "angular_velocity_covariance": unknown if "gyro" in held else nothing,
        "linear_acceleration_covariance": unknown if "accel" in held else nothing,
    }
    fields = [
        {**fixed, "angular_velocity": rate, "linear_acceleration": force}
        for rate, force in zip(gyro, accel, strict=True)
    ]
    return _Topic(topic, "sensor_msgs/msg/Imu", BODY, t, fields)


def _vectors(flight: Flight, types: Mapping[str, Any]) -> Iterator[_Topic]:
    """MagneticField, TwistStamped in the world, WrenchStamped."""
    zero, signals = _vector(types, np.zeros(3)), flight.signals
    if "mag" in signals:
        mag = _three(flight, "mag", signals["mag"], types)
        rest = {"magnetic_field_covariance": np.zeros(9)}
        fields = [{"magnetic_field": field, **rest} for field in mag]
        yield _Topic("/imu/mag", "sensor_msgs/msg/MagneticField", BODY, signals["mag"].t, fields)
    if "velocity" in signals:
        twist = types["geometry_msgs/msg/Twist"]
        velocity = _three(flight, "velocity", signals["velocity"], types)
        fields = [{"twist": twist(linear=one, angular=zero)} for one in velocity]
        kind = "geometry_msgs/msg/TwistStamped"
        yield _Topic("/velocity", kind, WORLD, signals["velocity"].t, fields)
    if "torque" in signals:
        wrench = types["geometry_msgs/msg/Wrench"]
        torque = _three(flight, "torque", signals["torque"], types)
        fields = [{"wrench": wrench(force=zero, torque=one)} for one in torque]
        yield _Topic(
            "/wrench", "geometry_msgs/msg/WrenchStamped", BODY, signals["torque"].t, fields
        )


def _fix(position: Signal, types: Mapping[str, Any]) -> _Topic:
    status = types["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
    rest = {
        "status": status,
        "position_covariance": np.zeros(9),
        "position_covariance_type": 0,
    }
    fields = [
        {"latitude": latitude, "longitude": longitude, "altitude": altitude, **rest}
        for latitude, longitude, altitude in np.round(position.y, 9).tolist()
    ]
    return _Topic("/gps/fix", "sensor_msgs/msg/NavSatFix", BODY, position.t, fields)


def _pose(topic: str, flight: Flight, q: Array, types: Mapping[str, Any]) -> _Topic:
    """Fill in PoseStamped, at the true place."""
    place, turned = flight.position, q
    if _turns(flight):
        place = _world(place)
        turned = frames.bring(q)
    point, pose = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Pose"]
    fields = [
        {"pose": pose(position=_vector(types, at, point), orientation=_quaternion(types, one))}
        for at, one in zip(_rounded(place), _rounded(turned), strict=True)
    ]
    return _Topic(topic, "geometry_msgs/msg/PoseStamped", WORLD, flight.t, fields)


def _clouds(points: Mapping[str, Signal], types: Mapping[str, Any]) -> _Topic:
    """Fill in PointCloud2: of each moment the points that are seen, with their numbers."""
    t = np.concatenate([signal.t for signal in points.values()])
    rows = np.zeros(len(t), _POINT)
    rows["id"] = np.repeat(
        [int(name.removeprefix("point")) for name in points],
        [len(signal.t) for signal in points.values()],
    )
    rows["x"], rows["y"], rows["z"] = _rounded(np.concatenate([p.y for p in points.values()])).T
    order = np.lexsort((rows["id"], t))
    moments, starts = np.unique(t[order], return_index=True)
    listed = [
        types["sensor_msgs/msg/PointField"](name=name, offset=offset, datatype=kind, count=1)
        for name, offset, kind in _FIELDS
    ]
    fields = [
        {"height": 1, "width": len(seen), "fields": listed, "is_bigendian": False,
         "point_step": _POINT.itemsize, "row_step": seen.nbytes, "is_dense": True,
         "data": np.frombuffer(seen.tobytes(), np.uint8)}
        for seen in np.split(rows[order], starts[1:])
    ]  # fmt: skip
    return _Topic("/points", "sensor_msgs/msg/PointCloud2", "camera", moments, fields)


def _turns(flight: Flight) -> bool:
    """Whether the flight has axes of a vehicle to turn."""
    return flight.world == "ned" and "gyro" in flight.signals


def _world(y: Array) -> Array:
    """Take north-east-down to east-north-up."""
    east_north_up: Array = y[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])
    return east_north_up


def _three(flight: Flight, name: str, signal: Signal, types: Mapping[str, Any]) -> list[Any]:
    """Return a signal as Vector3, in the axes of ROS."""
    y = signal.y
    if _turns(flight):
        y = _world(y) if name == "velocity" else y * np.array([1.0, -1.0, -1.0])
    return [_vector(types, row) for row in _rounded(y, _DECIMALS.get(name, 9))]


def _rounded(y: Array, decimals: int = 9) -> Array:
    rounded: Array = np.round(y, decimals) + 0.0  # and no -0.0
    return rounded


def _vector(types: Mapping[str, Any], xyz: Array, kind: Any = None) -> Any:
    x, y, z = xyz.tolist()
    return (kind or types["geometry_msgs/msg/Vector3"])(x=x, y=y, z=z)


def _quaternion(types: Mapping[str, Any], wxyz: Array) -> Any:
    w, x, y, z = wxyz.tolist()
    return types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)
