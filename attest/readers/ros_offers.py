"""What each decoded topic can give: gyroscope, magnetometer, an attitude, and so on."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from attest.readers import gps
from attest.readers.ros_decode import Array, Group, Ints, Table, alike
from attest.readers.values import any_of

Axes = Literal["rep103", "px4"]

IDENTITY = 1e-9
"""An orientation this near to none, throughout, is a placeholder."""
MICROSECOND = 1000
GAUSS = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Offer:
    """One quantity from one topic."""

    role: str
    """``gyro``, ``accel``, ``mag``, ``velocity``, ``position``, ``torque``, ``point``,
    ``fix``, ``reference``."""
    topic: str
    type: str
    record: Ints
    """When each was recorded, ns."""
    stamp: Ints
    """When each was measured by its own word, ns; 0 where it does not say."""
    y: Array
    """Values; quaternions (w, x, y, z)."""
    frame: str = ""
    """The frame that values are in, or that an attitude is against."""
    child: str = ""
    """The frame whose attitude it is."""
    name: str = ""
    """Of a reference, or of a point."""
    axes: Axes = "rep103"
    empty: int = 0
    """Messages that say themselves that they hold no such value."""
    poor: int = 0
    """Messages that say themselves that it is too inaccurate to be of use."""


def imu(table: Table) -> Iterator[Offer]:
    """Rate, specific force and orientation; a covariance of -1 says that one is not there."""
    when = stamped(table)
    for role, path in (("gyro", "angular_velocity"), ("accel", "linear_acceleration")):
        y = gathered(table, lambda group, path=path: group.vector(path))
        yield _offer(table, role, y, _held(table, f"{path}_covariance"), when)
    q = gathered(table, lambda group: quaternions(group, "orientation"))
    held = _held(table, "orientation_covariance") & any_of(q != 0.0)
    yield replace(_offer(table, "reference", q, held, when), name=table.topic)


def magnetic_field(table: Table) -> Iterator[Offer]:
    """Magnetic field."""
    yield _measured(table, "mag", "magnetic_field")


def vector(table: Table) -> Iterator[Offer]:
    """Magnetic field, where the topic calls the vector so: others may be anything."""
    if re.search(r"(?<![a-z])(?:mag|compass)", table.topic.lower()):  # and no image
        yield _measured(table, "mag", "vector")


def fix(table: Table) -> Iterator[Offer]:
    """Place on the globe, where the receiver has one; and when it has, 1, and when not, -1."""
    names = ("latitude", "longitude", "altitude")
    y = gathered(table, lambda group: _columns(group, names))
    held = gathered(table, lambda group: group.numbers("status.status")) >= 0
    yield _offer(table, "position", y, held)
    yield _offer(table, "fix", np.where(held, 1.0, -1.0)[:, np.newaxis])


def odometry(table: Table) -> Iterator[Offer]:
    """Attitude, and the velocity, which is in the body, turned to the world."""
    from attest.geometry import quaternion

    yield _attitude(table, "pose.pose.orientation", "child_frame_id")
    q = gathered(table, lambda group: quaternions(group, "pose.pose.orientation"))
    speed = gathered(table, lambda group: group.vector("twist.twist.linear"))
    size = np.linalg.norm(q, axis=1)
    held, precise = (size > 0.5) & (size < 2.0), _precise(table)
    good = held & precise
    turned = quaternion.rotate(quaternion.normalize(q[good]), speed[good])
    offer = _offer(table, "velocity", speed, good)
    poor = int((held & ~precise).sum())
    yield replace(offer, y=turned, empty=offer.empty - poor, poor=poor)


def twist(table: Table) -> Iterator[Offer]:
    """Velocity in the world; one in the body is told by its frame."""
    yield _measured(table, "velocity", "twist.linear")


def twist_with_covariance(table: Table) -> Iterator[Offer]:
    """Velocity in the world, as far as it is accurate by its own word."""
    speed = gathered(table, lambda group: group.vector("twist.twist.linear"))
    precise = _precise(table)
    offer = _offer(table, "velocity", speed, precise)
    yield replace(offer, empty=0, poor=offer.empty)


def wrench(table: Table) -> Iterator[Offer]:
    """Torque."""
    yield _measured(table, "torque", "wrench.torque")


def pose(table: Table) -> Iterator[Offer]:
    """Attitude."""
    yield _attitude(table, "pose.orientation")


def pose_with_covariance(table: Table) -> Iterator[Offer]:
    """Attitude."""
    yield _attitude(table, "pose.pose.orientation")


def transform(table: Table) -> Iterator[Offer]:
    """Attitude of the child frame."""
    yield _attitude(table, "transform.rotation", "child_frame_id")


def quaternion_stamped(table: Table) -> Iterator[Offer]:
    """Attitude."""
    yield _attitude(table, "quaternion")


def sensor_combined(table: Table) -> Iterator[Offer]:
    """PX4's rate and specific force."""
    yield _px4(table, "gyro", "gyro_rad")
    yield _px4(table, "accel", "accelerometer_m_s2")


def vehicle_magnetometer(table: Table) -> Iterator[Offer]:
    """PX4's magnetic field, in gauss."""
    offer = _px4(table, "mag", "magnetometer_ga")
    yield replace(offer, y=offer.y * GAUSS)


def vehicle_attitude(table: Table) -> Iterator[Offer]:
    """PX4's attitude, (w, x, y, z), of a body forward-right-down against north-east-down."""
    yield replace(_px4(table, "reference", "q"), name=table.topic)


def transforms(table: Table) -> Iterator[Offer]:
    """Attitude of each child against its parent."""
    parts: dict[tuple[str, str], list[tuple[Ints, Ints, Array]]] = {}
    for group in table.groups:
        for i in range(group.length("transforms")):
            path = f"transforms.{i}"
            stamp = group.stamp(f"{path}.header.stamp")
            q = quaternions(group, f"{path}.transform.rotation")
            for parent, child, rows in _pairs(group, path):
                part = (group.rows[rows], stamp[rows], q[rows])
                parts.setdefault((parent, child), []).append(part)
    for (parent, child), found in parts.items():
        rows, stamp, q = (np.concatenate(column) for column in zip(*found, strict=True))
        order = np.argsort(rows, kind="stable")
        yield Offer("reference", table.topic, table.type, table.record[rows[order]], stamp[order],
                    q[order], parent, child, f"{table.topic}/{parent}/{child}")  # fmt: skip


OFFERS: dict[str, Callable[[Table], Iterator[Offer]]] = {
    "sensor_msgs/msg/Imu": imu,
    "sensor_msgs/msg/MagneticField": magnetic_field,
    "sensor_msgs/msg/NavSatFix": fix,
    "nav_msgs/msg/Odometry": odometry,
    "geometry_msgs/msg/PoseStamped": pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_with_covariance,
    "geometry_msgs/msg/TransformStamped": transform,
    "geometry_msgs/msg/QuaternionStamped": quaternion_stamped,
    "geometry_msgs/msg/Vector3Stamped": vector,
    "geometry_msgs/msg/TwistStamped": twist,
    "geometry_msgs/msg/TwistWithCovarianceStamped": twist_with_covariance,
    "geometry_msgs/msg/WrenchStamped": wrench,
    "tf2_msgs/msg/TFMessage": transforms,
    "tf/msg/tfMessage": transforms,
    "px4_msgs/msg/SensorCombined": sensor_combined,
    "px4_msgs/msg/VehicleMagnetometer": vehicle_magnetometer,
    "px4_msgs/msg/VehicleAttitude": vehicle_attitude,
}


def is_placeholder(q: Array) -> bool:
    """Whether an orientation is identity throughout, as drivers fill in what they do not know."""
    return bool(np.all(np.abs(q[:, 1:]) < IDENTITY) and np.all(np.abs(q[:, 0]) > 0.5))


def gathered(table: Table, take: Callable[..., NDArray[np.generic]]) -> Array:
    """Return a value of every message, in the order of the table's messages."""
    if len(table.groups) == 1:
        return np.asarray(take(table.groups[0]))
    order = np.argsort(rows_of(table), kind="stable")
    values: Array = np.concatenate([take(group) for group in table.groups])[order]
    return values


def rows_of(table: Table) -> Ints:
    """Return which messages were decoded, group by group."""
    return np.concatenate([group.rows for group in table.groups])


def quaternions(group: Group, path: str) -> Array:
    """Return a quaternion as (w, x, y, z)."""
    return group.vector(path, "wxyz")


def stamped(table: Table) -> tuple[Ints, Ints]:
    """Return when each decoded message was recorded and, by its header, measured."""
    stamp = gathered(table, lambda group: group.stamp()).astype(np.int64)
    return table.record[np.sort(rows_of(table))], stamp


def text_of(table: Table, path: str) -> str:
    """Return the text that most messages have."""
    count: Counter[str] = Counter()
    for group in table.groups:
        if group.has(path):
            count.update({text: len(rows) for text, rows in group.texts(path)})
    return count.most_common(1)[0][0].lstrip("/") if count else ""


def _columns(group: Group, paths: tuple[str, ...]) -> Array:
    return np.stack([group.numbers(path).astype(np.float64) for path in paths], axis=1)


def _held(table: Table, path: str) -> NDArray[np.bool_]:
    """Mark the messages that do not say, by a covariance of -1, that they hold no value."""
    held: NDArray[np.bool_] = gathered(table, lambda group: group.first(path)) != -1.0
    return held


def _precise(table: Table) -> NDArray[np.bool_]:
    """Mark the messages whose speed over ground is known; zero covariance is an unknown one.

    The third axis is left out: what drives gives it as unknown, and keeps to the ground.
    """
    path = "twist.covariance"
    covariance = gathered(table, lambda group: group.numbers(path).astype(np.float64)[:, [0, 7]])
    known = np.nan_to_num(covariance).max(axis=1) <= gps.WORST**2
    held: NDArray[np.bool_] = known & (covariance[:, 0] != -1.0)
    return held


def _measured(table: Table, role: str, path: str) -> Offer:
    return _offer(table, role, gathered(table, lambda group: group.vector(path)))


def _attitude(table: Table, path: str, child: str = "") -> Offer:
    q = gathered(table, lambda group: quaternions(group, path))
    offer = _offer(table, "reference", q)
    return replace(offer, name=table.topic, child=text_of(table, child) if child else "")


def _offer(
    table: Table,
    role: str,
    y: Array,
    held: NDArray[np.bool_] | None = None,
    when: tuple[Ints, Ints] | None = None,
) -> Offer:
    record, stamp = when or stamped(table)
    frame, empty = text_of(table, "header.frame_id"), 0
    if held is not None and not held.all():
        record, stamp, y, empty = record[held], stamp[held], y[held], int((~held).sum())
    return Offer(role, table.topic, table.type, record, stamp, y, frame, empty=empty)


def _px4(table: Table, role: str, path: str) -> Offer:
    stamp = gathered(table, lambda group: group.numbers("timestamp").astype(np.int64))
    y = gathered(table, lambda group: group.numbers(path).astype(np.float64))
    record = table.record[np.sort(rows_of(table))]
    return Offer(role, table.topic, table.type, record, stamp.astype(np.int64) * MICROSECOND, y,
                 axes="px4")  # fmt: skip


def _pairs(group: Group, path: str) -> Iterator[tuple[str, str, Ints]]:
    """Yield parent, child and the rows that have both."""
    parents = group.texts(f"{path}.header.frame_id")
    children = group.texts(f"{path}.child_frame_id")
    pair = np.empty(sum(len(rows) for _, rows in parents), np.int64)
    for i, (_, rows) in enumerate(parents):
        pair[rows] = i * len(children)
    for j, (_, rows) in enumerate(children):
        pair[rows] += j
    different, which = np.unique(pair, return_inverse=True)
    for both, rows in zip(different.tolist(), alike(which), strict=True):
        i, j = divmod(both, len(children))
        yield parents[i][0].lstrip("/"), children[j][0].lstrip("/"), rows
