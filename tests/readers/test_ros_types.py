"""Every type of ROS message that gives a signal, in every container."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import IMU, KINDS, START, Log, compass, flight, header, times, xyz, xyzw

from attest import inspection, readers
from attest.geometry import quaternion

TURN = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""A quarter turn about the third axis."""


def swing(i):
    """Turn about the third axis, with the number of the message."""
    return np.array([np.cos(0.05 * i), 0.0, 0.0, np.sin(0.05 * i)])


def read(log, tmp_path):
    return readers.read(log.write(tmp_path))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def doubts(recording):
    return [note.text for note in recording.notes if note.doubt]


@pytest.mark.parametrize("kind", KINDS)
def test_other_signals(tmp_path, kind):
    log = flight(Log(kind))
    for i, t in enumerate(times()):
        status = 0 if i else -1
        log.add("/fix", "sensor_msgs/msg/NavSatFix", t, latitude=47.0, longitude=8.0, altitude=i,
                status={"status": status})  # fmt: skip
        log.add("/vel", "geometry_msgs/msg/TwistStamped", t, frame="map",
                twist={"linear": xyz(1 + i, 2, 3)})  # fmt: skip
        log.add("/cmd", "geometry_msgs/msg/WrenchStamped", t, wrench={"torque": xyz(i, 5, 6)})
        log.add("/magnetic", "geometry_msgs/msg/Vector3Stamped", t, vector=xyz(0.2, 0.1, -0.4))
        log.add("/rpy", "geometry_msgs/msg/Vector3Stamped", t, vector=xyz(1, 2, 3))
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["position"].y, [(47.0, 8.0, i) for i in range(1, 50)])
    assert notes(recording)["/fix position without a value dropped"] == 1
    assert notes(recording)["/vel velocity without a 3D fix dropped"] == 1
    assert_array_equal(recording.signals["velocity"].y[7], [9, 2, 3])
    assert_array_equal(recording.signals["torque"].y[7], [7, 5, 6])
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 1e-5, -4e-5])
    assert recording.signals["mag"].source == "/magnetic"
    assert doubts(recording) == ["/magnetic reads 0.458, which is gauss and no tesla: taken so"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("type_", "path"),
    [
        ("geometry_msgs/msg/PoseStamped", "pose.orientation"),
        ("geometry_msgs/msg/PoseWithCovarianceStamped", "pose.pose.orientation"),
        ("nav_msgs/msg/Odometry", "pose.pose.orientation"),
        ("geometry_msgs/msg/TransformStamped", "transform.rotation"),
        ("geometry_msgs/msg/QuaternionStamped", "quaternion"),
    ],
)
def test_attitudes(tmp_path, kind, type_, path):
    log = flight(Log(kind))
    for i, t in enumerate(times()):
        fields = xyzw(swing(i))
        for name in reversed(path.split(".")):
            fields = {name: fields}
        log.add("/vicon/drone", type_, t, frame="map", **fields)
    reference = read(log, tmp_path).references["/vicon/drone"]
    assert reference.kind == "truth"
    assert_allclose(reference.q, [swing(i) for i in range(50)], atol=1e-15)


@pytest.mark.parametrize(
    ("statuses", "type_", "kept"),
    [
        (range(10, 30), "geometry_msgs/msg/TwistStamped", 30),
        (range(10, 30), "nav_msgs/msg/Odometry", 50),  # of other sensors too, and tells of itself
        (
            range(50),
            "geometry_msgs/msg/TwistStamped",
            50,
        ),  # never a fix: the velocity is of something else
    ],
)
def test_velocity_while_the_receiver_has_no_fix_is_left_out(tmp_path, statuses, type_, kept):
    log = flight(Log())
    fields = {"twist": {"linear": xyz(1, 2, 3)}}
    if type_.endswith("Odometry"):
        fields = {"pose": {"pose": {"orientation": xyzw(TURN)}}, "twist": fields}
    for i, t in enumerate(times()):
        log.add("/vel", type_, t, frame="map", **fields)
        log.add("/fix", "sensor_msgs/msg/NavSatFix", t, latitude=47.0, longitude=8.0, altitude=i,
                status={"status": -1 if i in statuses else 0})  # fmt: skip
    recording = read(log, tmp_path)
    assert len(recording.signals["velocity"].t) == kept
    assert ("/vel velocity without a 3D fix dropped" in notes(recording)) is (kept < 50)


def test_velocity_of_odometry_is_turned_to_the_world(tmp_path):
    log = flight(Log())
    for t in times():
        log.add("/odometry", "nav_msgs/msg/Odometry", t, frame="map",
                pose={"pose": {"orientation": xyzw(TURN)}},
                twist={"twist": {"linear": xyz(1, 2, 3)}})  # fmt: skip
    recording = read(log, tmp_path)
    assert_allclose(recording.signals["velocity"].y[0], [-2, 1, 3])
    assert recording.references["/odometry"].kind == "autopilot"


@pytest.mark.parametrize("kind", KINDS)
def test_trees_of_transforms(tmp_path, kind):
    type_ = "tf/msg/tfMessage" if kind in {"bag", "mcap-ros1"} else "tf2_msgs/msg/TFMessage"
    own = {"tf__tfMessage": "geometry_msgs/TransformStamped[] transforms\n"}
    log = flight(Log(kind, **own), frame="base")
    for i, t in enumerate(times()):
        moving = {"header": header(t, "map"), "child_frame_id": "base",
                  "transform": {"rotation": xyzw(swing(i))}}  # fmt: skip
        joint = {"header": header(t, "base"), "child_frame_id": "arm",
                 "transform": {"rotation": xyzw(swing(2 * i))}}  # fmt: skip
        log.add("/tf", type_, t, transforms=[moving, joint] if i % 2 else [joint, moving])
    references = read(log, tmp_path).references
    assert list(references) == ["/tf/map/base"]
    assert_allclose(references["/tf/map/base"].q, [swing(i) for i in range(50)], atol=1e-15)


def test_mag_is_turned_into_the_frame_of_the_imu_by_static_transforms(tmp_path):
    log = compass(flight(Log(), frame="imu"), frame="compass")
    for parent, child in (("base", "imu"), ("base", "compass")):
        rotation = xyzw(TURN if child == "compass" else (1, 0, 0, 0))
        still = {"header": header(0, parent), "child_frame_id": child,
                 "transform": {"rotation": rotation}}  # fmt: skip
        log.add("/tf_static", "tf2_msgs/msg/TFMessage", 0, transforms=[still])
    recording = read(log, tmp_path)
    assert_allclose(recording.signals["mag"].y[0], [-1e-6, 2e-5, -4e-5], atol=1e-18)
    text = "mag in frame 'compass', gyro in 'imu': turned by the log's static transforms"
    assert text in notes(recording)
    assert not recording.references


@pytest.mark.parametrize(("mount", "doubted"), [((0, 1, 0, 0), False), ((1, 0, 0, 0), True)])
def test_an_imu_upside_down_is_doubted_unless_the_static_transforms_say_so(
    tmp_path, mount, doubted
):
    log = Log()
    for t in times():
        log.add("/imu", IMU, t, angular_velocity=xyz(0.1, t / 1e9, 0),
                linear_acceleration=xyz(0, 0, -9.8))  # fmt: skip
    still = {"header": header(0, "base"), "child_frame_id": "imu",
             "transform": {"rotation": xyzw(mount)}}  # fmt: skip
    log.add("/tf_static", "tf2_msgs/msg/TFMessage", 0, transforms=[still])
    recording = read(log, tmp_path)
    told = [note.text for note in inspection.doubts(recording) if "upside down" in note.text]
    assert bool(told) is doubted
    so = "accel_z is down: the sensor is upside down, as the log's static transforms say"
    assert (so in notes(recording)) is not doubted
    assert so not in doubts(recording)


def test_px4_in_its_own_axes_and_clock(tmp_path):
    definitions = {
        "px4_msgs__SensorCombined": "uint64 timestamp\nfloat32[3] gyro_rad\n"
        "uint32 gyro_integral_dt\nint32 accelerometer_timestamp_relative\n"
        "float32[3] accelerometer_m_s2\nuint32 accelerometer_integral_dt\n",
        "px4_msgs__VehicleMagnetometer": "uint64 timestamp\nuint64 timestamp_sample\n"
        "uint32 device_id\nfloat32[3] magnetometer_ga\n",
        "px4_msgs__VehicleAttitude": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\n",
    }
    log = Log("mcap", **definitions)
    for i, t in enumerate(times()):
        boot = 5_000_000 + t // 1000
        log.add("/fmu/sensor", "px4_msgs/msg/SensorCombined", t, timestamp=boot,
                gyro_rad=[0.1, 0.2, i], accelerometer_m_s2=[0, 0, -9.8])  # fmt: skip
        log.add("/fmu/mag", "px4_msgs/msg/VehicleMagnetometer", t, timestamp=boot,
                magnetometer_ga=[0.2, 0.0, 0.4])  # fmt: skip
        log.add("/fmu/att", "px4_msgs/msg/VehicleAttitude", t, timestamp=boot, q=swing(i))
        # the same attitude, north-east-down and forward-right-down, as ROS would have it
        enu = quaternion.multiply(quaternion.multiply([0, *np.sqrt([0.5, 0.5]), 0], swing(i)),
                                  np.array([0.0, 1, 0, 0]))  # fmt: skip
        log.add("/mocap/pose", "geometry_msgs/msg/PoseStamped", t, frame="map",
                pose={"orientation": xyzw(enu)})  # fmt: skip
    recording = read(log, tmp_path)
    assert (recording.world, recording.body) == ("ned", "frd")
    assert_array_equal(recording.signals["gyro"].t, START + np.array(times()))
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5], rtol=1e-6)
    assert {name: r.kind for name, r in recording.references.items()} == {
        "/mocap/pose": "truth",
        "/fmu/att": "autopilot",
    }
    for reference in recording.references.values():
        close = np.abs(np.sum(reference.q * [swing(i) for i in range(50)], axis=1))
        assert_allclose(close, 1.0, atol=1e-6)
    assert notes(recording)["/fmu/sensor stamped 19676 days from the recorder's time, steadily: "
                            "moved by that"] == 1  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "type_", ["nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistWithCovarianceStamped"]
)
def test_velocity_that_calls_itself_inaccurate_is_dropped(tmp_path, kind, type_):
    log, said = flight(Log(kind)), np.zeros(36)
    said[14] = 1e6  # of what keeps to the ground
    pose = {"pose": {"pose": {"orientation": xyzw(TURN)}}} if "Odometry" in type_ else {}
    for i, t in enumerate(times()):
        said[7] = 9.0 if i < 10 else 0.25
        twist = {"twist": {"linear": xyz(1, 2, 3)}, "covariance": said.copy()}
        log.add("/velocity", type_, t, frame="map", twist=twist, **pose)
    recording = read(log, tmp_path)
    assert len(recording.signals["velocity"].t) == 40
    assert notes(recording)["/velocity velocity no better than 2 m/s dropped"] == 10
    assert "/velocity velocity no better than 2 m/s dropped" in doubts(recording)
