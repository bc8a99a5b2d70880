"""The ROS 2 message definitions that an MCAP of ours carries, so that anybody can read it."""

SEPARATOR = "=" * 80

DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "geometry_msgs/Vector3Stamped": "std_msgs/Header header\ngeometry_msgs/Vector3 vector\n",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "sensor_msgs/Imu": """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
""",
    "sensor_msgs/MagneticField": """\
std_msgs/Header header
geometry_msgs/Vector3 magnetic_field
float64[9] magnetic_field_covariance
""",
    "attest_msgs/AttitudeError": """\
# Estimate against reference, q_e = q_est * inverse(q_ref), in the world
std_msgs/Header header
float64 total        # degrees
float64 heading      # degrees, about the vertical
float64 inclination  # degrees, of the vertical
""",
    "attest_msgs/ObserverState": """\
# Diagnostics of an attitude observer; NaN where it has none
std_msgs/Header header
float64 s_norm         # |s_L|, the residual
float64 cost           # Wahba's cost of the estimate
float64 lyapunov       # the paper's Lyapunov function, where truth is known
bool[] updated         # which vectors were used
string[] vectors       # their names
string[] state_names   # states of this observer only
float64[] states       # their values, SI units
""",
}
"""Each message without its dependencies, by package and name."""


def definition(name: str) -> str:
    """Spell a message such as ``sensor_msgs/msg/Imu`` in full, dependencies behind it."""
    first, *others = _with_dependencies(name.replace("/msg/", "/"))
    text = DEFINITIONS[first]
    return text + "".join(f"{SEPARATOR}\nMSG: {other}\n{DEFINITIONS[other]}" for other in others)


def _with_dependencies(name: str) -> list[str]:
    """Name a message, then all that it needs, each once, in order of first use."""
    found = [name]
    for line in DEFINITIONS[name].splitlines():
        used = line.split(maxsplit=1)[0].removesuffix("[]")
        if used in DEFINITIONS:
            found += _with_dependencies(used)
    return list(dict.fromkeys(found))
