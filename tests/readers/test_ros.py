"""ROS logs into a recording: every container and type, equal to what rosbags reads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import IMU, KINDS, START, Log, compass, flight, header, times, xyz
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as BagWriter

from attest import readers, report
from attest.errors import ReadError
from attest.readers import ReadOptions
from attest.report import summary

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


def test_the_digest_of_a_folder_is_that_of_its_files(tmp_path):
    (tmp_path / "copy").mkdir()
    log = flight(Log("db3"))
    folder, copy = log.write(tmp_path), log.write(tmp_path / "copy")
    assert summary.sha256(folder) == summary.sha256(copy)
    (copy / "metadata.yaml").write_text("other")
    assert summary.sha256(folder) != summary.sha256(copy)


def test_logs_of_a_folder_by_content(tmp_path):
    for name, log in (("b", Log("db3")), ("a", Log("bag"))):
        (tmp_path / name / ".hidden").mkdir(parents=True)
        flight(log).write(tmp_path / name)
        flight(log).write(tmp_path / name / ".hidden")
    (tmp_path / "notes.txt").write_text("no log")
    assert readers.logs_in(tmp_path) == [tmp_path / "a/log.bag", tmp_path / "b/log_db3"]
    assert readers.logs_in(tmp_path / "a/.hidden") == [tmp_path / "a/.hidden/log.bag"]
    assert readers.logs_in(tmp_path / "a/log.bag") == [tmp_path / "a/log.bag"]
