"""The messages that give signals, and their definitions for files that carry none."""

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

MARKERS = ("Markers", "MarkerArray", "MarkersList")
"""Names of the messages of motion-capture drivers, in packages of their own."""

PX4 = {
    "px4_msgs/msg/SensorCombined": (
        "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n"
        "int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\n"
    ),
    "px4_msgs/msg/VehicleMagnetometer": (
        "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32[3] magnetometer_ga\n"
    ),
    "px4_msgs/msg/VehicleAttitude": ("uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\n"),
}
"""How PX4's messages begin, in every release since 1.11."""

WANTED = frozenset(
    {
        "sensor_msgs/msg/Imu",
        "sensor_msgs/msg/MagneticField",
        "sensor_msgs/msg/NavSatFix",
        "sensor_msgs/msg/PointCloud2",
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "geometry_msgs/msg/PoseArray",
        "geometry_msgs/msg/TransformStamped",
        "geometry_msgs/msg/QuaternionStamped",
        "geometry_msgs/msg/Vector3Stamped",
        "geometry_msgs/msg/TwistStamped",
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        "geometry_msgs/msg/WrenchStamped",
        "tf2_msgs/msg/TFMessage",
        "tf/msg/tfMessage",
        *PX4,
    }
)

Definitions = Mapping[str, Any]
"""Fields by name of the type, as rosbags parses them."""


def ros2_name(name: str) -> str:
    """Spell a type as ROS 2 does: ``sensor_msgs/Imu`` is ``sensor_msgs/msg/Imu``."""
    path = PurePosixPath(name)
    return name if len(path.parts) != 2 else f"{path.parts[0]}/msg/{path.parts[1]}"


def is_wanted(type_: str) -> bool:
    """Whether messages of a type may give a signal."""
    return type_ in WANTED or PurePosixPath(type_).name in MARKERS
