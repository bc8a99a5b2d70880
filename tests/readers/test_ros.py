"""ROS logs into a recording: every container and type, equal to what rosbags reads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import IMU, KINDS, START, Log, compass, flight, header, times, xyz, xyzw
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as BagWriter

from attest import readers, report
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import ReadOptions

TURN = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""A quarter turn about the third axis."""
SHARED = (
    "rosbag1/ardrone_imu.bag",
    "rosbag1/phidgets_upside_down.bag",
    "rosbag1/razor_vector3_gauss.bag",
    "rosbag1/xsens_tilt_laser.bag",
    "rosbag2/ardrone_imu_mcap",
    "rosbag2/sparkfun_razor_sqlite3",
)


def swing(i):
    """Turn about the third axis, with the number of the message."""
    return np.array([np.cos(0.05 * i), 0.0, 0.0, np.sin(0.05 * i)])


def read(log, tmp_path, **options):
    return readers.read(log.write(tmp_path), ReadOptions(**options))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def doubts(recording):
    return [note.text for note in recording.notes if note.doubt]


def as_rosbags_reads(path, topic):
    """Return stamps and fields of a topic's messages, by rosbags."""
    with AnyReader([path]) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        found = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(connections)]
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in found]
    return np.array(stamps), found


def vectors(messages, name):
    fields = [getattr(message, name) for message in messages]
    return np.array([(field.x, field.y, field.z) for field in fields])


def assert_equal_to_rosbags(recording, path):
    stamps, found = as_rosbags_reads(path, recording.signals["gyro"].source)
    for signal, field in (("gyro", "angular_velocity"), ("accel", "linear_acceleration")):
        assert_array_equal(recording.signals[signal].t, stamps)
        assert_array_equal(recording.signals[signal].y, vectors(found, field))


@pytest.mark.parametrize("name", SHARED)
@pytest.mark.shared
def test_recorded_logs_read_as_rosbags_reads_them(shared, name):
    path = shared / name
    recording = readers.read(path)
    assert_equal_to_rosbags(recording, path)
    mag = recording.signals["mag"]
    stamps, found = as_rosbags_reads(path, mag.source)
    field = "vector" if hasattr(found[0], "vector") else "magnetic_field"
    expected = vectors(found, field)
    finite = np.isfinite(expected).all(axis=1)
    assert_array_equal(mag.y, expected[finite])
    assert_array_equal(mag.t, stamps[finite])


@pytest.mark.shared
def test_a_recorded_orientation_reads_as_rosbags_reads_it(shared):
    path = shared / "rosbag1/ardrone_imu.bag"
    (reference,) = readers.read(path).references.values()
    _, found = as_rosbags_reads(path, "/ardrone/imu")
    q = np.array([[getattr(m.orientation, axis) for axis in "wxyz"] for m in found])
    assert (reference.name, reference.kind) == ("/ardrone/imu", "autopilot")
    assert_allclose(np.abs(np.sum(q * reference.q, axis=1)), 1.0, atol=1e-9)


@pytest.mark.shared
def test_what_is_no_orientation_is_no_reference(shared):
    for name in ("phidgets_upside_down", "razor_vector3_gauss"):
        assert not readers.read(shared / f"rosbag1/{name}.bag").references
    text = "/imu/data_raw orientation is identity throughout: no reference"
    assert text in notes(readers.read(shared / "rosbag1/razor_vector3_gauss.bag"))


@pytest.mark.parametrize("kind", KINDS)
def test_every_container_reads_as_rosbags_reads_it(tmp_path, kind):
    log = compass(flight(Log(kind), orientation=swing))
    path = log.write(tmp_path)
    recording = readers.read(path)
    assert recording.format == kind.removesuffix("-ros1")
    assert (recording.world, recording.body) == ("enu", "flu")
    assert recording.clock.utc_offset == 0
    if kind != "mcap-ros1":  # which rosbags does not read
        assert_equal_to_rosbags(recording, path)
    i = np.arange(50)
    assert_array_equal(recording.signals["gyro"].t, START + np.array(times()))
    assert_array_equal(recording.signals["gyro"].y[:, 0], 0.1 * i)
    assert_array_equal(recording.signals["accel"].y[:, 2], 9.8 + 0.01 * i)
    assert_array_equal(recording.signals["mag"].y, [(2e-5, 1e-6, -4e-5)] * 25)
    assert_allclose(recording.references["/imu"].q, [swing(k) for k in i], atol=1e-15)
    assert [topic["used"] for topic in recording.details["topics"]] == [
        ["gyro", "accel", "reference"],
        ["mag"],
    ]
    assert "/imu" in report.text_of_info(report.describe(recording))


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_storage_files_read_without_their_folder(tmp_path, kind):
    folder = compass(flight(Log(kind))).write(tmp_path)
    (storage,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    assert_array_equal(
        readers.read(storage).signals["gyro"].y, readers.read(folder).signals["gyro"].y
    )
    assert readers.is_log(folder)
    assert readers.logs_in(tmp_path) == [folder]
    (folder / "metadata.yaml").unlink()
    assert readers.logs_in(tmp_path) == [storage]
    assert not readers.is_log(folder)
    with pytest.raises(ReadError, match="a folder, and no log in this folder was named"):
        readers.read(folder)


@pytest.mark.parametrize("compression", list(BagWriter.CompressionFormat))
def test_compressed_bags(tmp_path, compression):
    log = flight(Log("bag"))
    plain = read(log, tmp_path)
    packed = readers.read(log._bag(tmp_path / "packed.bag", compression))
    assert_array_equal(plain.signals["gyro"].y, packed.signals["gyro"].y)


@pytest.mark.parametrize(("kind", "mode"), [("db3", "FILE"), ("db3", "MESSAGE"), ("mcap", "FILE")])
def test_compressed_folders(tmp_path, kind, mode):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode

    log = flight(Log(kind))
    options = {"mode": CompressionMode[mode], "format": CompressionFormat.ZSTD}
    recording = readers.read(log.write(tmp_path, **options))
    assert_array_equal(recording.signals["gyro"].y[:, 0], 0.1 * np.arange(50))
    assert recording.format == kind


def test_frames_of_several_lengths_go_the_slow_way_and_give_the_same(tmp_path):
    log = Log("bag")
    for i, t in enumerate(times(300)):
        log.add("/imu", IMU, t, frame="f" * (i % 97), angular_velocity=xyz(i, 1, 2),
                linear_acceleration=xyz(0, 0, 9.8))  # fmt: skip
    path = log.write(tmp_path)
    assert_equal_to_rosbags(readers.read(path), path)


def test_big_endian_messages(tmp_path):
    log = flight(Log("mcap"))
    message = log.fill(IMU, {"header": header(10**9), "angular_velocity": xyz(1, 2, 3),
                             "linear_acceleration": xyz(4, 5, 6)})  # fmt: skip
    data = log.store.serialize_cdr(message, IMU, little_endian=False)
    log.messages.append(("/imu", IMU, START + 10**9, bytes(data)))
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["gyro"].y[-1], [1, 2, 3])
    assert recording.signals["accel"].t[-1] == START + 10**9


def test_what_cannot_be_decoded_is_skipped_by_channel(tmp_path):
    path = compass(flight(Log("mcap-ros1"))).write(tmp_path)
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        json = writer.register_schema("sensor_msgs/msg/Imu", "jsonschema", b"{}")
        bad = writer.register_schema("my_msgs/msg/Markers", "ros2msg", b"??? not a definition\n")
        empty = writer.register_schema("my_msgs/msg/MarkerArray", "", b"")
        log = flight(Log("mcap"))
        text, _ = log.store.generate_msgdef(IMU)
        good = writer.register_schema(IMU, "ros2msg", text.encode())
        channels = [
            writer.register_channel("/json", "json", json),
            writer.register_channel("/bad", "cdr", bad),
            writer.register_channel("/empty", "cdr", empty),
        ]
        imu = writer.register_channel("/imu", "cdr", good)
        for _, _, t, data in log.messages:
            for channel in channels:
                writer.add_message(channel, t, b"{}", t)
            writer.add_message(imu, t, data, t)
        writer.finish()
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 50
    assert notes(recording).keys() >= {
        "/json in an encoding that attest cannot decode: skipped",
        "/bad skipped: no definition of my_msgs/msg/Markers that can be read",
        "/empty skipped: no definition of my_msgs/msg/MarkerArray that can be read",
    }


def test_a_database_without_definitions_is_read_as_ros_defines_them(tmp_path):
    import sqlite3

    folder = compass(flight(Log("db3"))).write(tmp_path)
    with sqlite3.connect(folder / "log_db3.db3") as connection:
        connection.execute("DROP TABLE message_definitions")
        connection.execute("DROP TABLE schema")
    connection.close()
    recording = readers.read(folder)
    assert len(recording.signals["mag"].t) == 25
    assert "sensor_msgs/msg/Imu taken as ROS and PX4 define it: the log does not" in notes(
        recording
    )


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
    assert_array_equal(recording.signals["velocity"].y[7], [8, 2, 3])
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
