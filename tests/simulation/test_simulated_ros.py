import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag2 import Reader as FolderReader
from rosbags.typesys import Stores, get_typestore

from attest import pipeline, readers, simulation
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.recording import Signal
from attest.simulation.degrade import resample

FORMATS = (".bag", ".mcap", ".db3", "")
UNDATED = 10**9
"""Where simulated time begins, ns."""


def written(folder, flight, suffix=".bag"):
    path = folder / f"flight{suffix}"
    simulation.write(path, flight)
    return path


def to_ned(recording, name):
    """Return a signal in the axes of the flight, by a matrix written out."""
    body = np.diag([1.0, -1.0, -1.0])
    world = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    turn = {"velocity": world, "position": np.eye(3)}.get(name, body)
    return recording.signals[name].y @ turn.T


def attitude_in_ned(q):
    body = np.diag([1.0, -1.0, -1.0])
    world = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    return world @ quaternion.to_matrix(q) @ body


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("scenario", ["quadcopter", "fixed-wing", "handheld"])
def test_a_flight_reads_back_in_ros_axes(scenario, suffix, simulated, tmp_path):
    flight = simulated(scenario, seed=0)
    recording = readers.read(written(tmp_path, flight, suffix))
    assert (recording.world, recording.body) == ("enu", "flu")
    assert recording.signals.keys() == flight.signals.keys()
    offset = UNDATED if flight.utc_offset is None else flight.utc_offset
    assert recording.clock.utc_offset == (None if flight.utc_offset is None else 0)
    for name, signal in flight.signals.items():
        kept = flight.received(signal.t)
        assert_array_equal(recording.signals[name].t, signal.t[kept] + offset)
        step = 1e-13 if name == "mag" else 1e-9
        assert_allclose(to_ned(recording, name), signal.y[kept], rtol=0, atol=0.6 * step)
    kept = flight.received(flight.t)
    truth = recording.references["/ground_truth/pose"]
    assert truth.kind == "truth"
    assert_array_equal(truth.t, flight.t[kept] + offset)
    expected = quaternion.to_matrix(flight.q[kept])
    assert_allclose(attitude_in_ned(truth.q), expected, rtol=0, atol=1e-8)
    assert ("/autopilot/pose" in recording.references) == (flight.autopilot is not None)
    assert not any(note.doubt for note in recording.notes)


@pytest.mark.parametrize("suffix", FORMATS)
def test_points_read_back_in_their_own_axes(suffix, simulated, tmp_path):
    flight = simulated("docking", seed=0)
    recording = readers.read(written(tmp_path, flight, suffix))
    assert recording.signals.keys() == flight.signals.keys()
    for name, signal in flight.signals.items():
        assert_array_equal(recording.signals[name].t, signal.t + UNDATED)
        assert_allclose(recording.signals[name].y, signal.y, rtol=0, atol=6e-10)
    truth = recording.references["/ground_truth/pose"]
    assert_allclose(truth.q, flight.q, rtol=0, atol=1e-8)


def test_relative_attitude_from_ros_is_that_from_csv(simulated, tmp_path):
    flight, configuration = simulated("docking", seed=0), pipeline.configure("docking")
    logs = [written(tmp_path, flight, suffix) for suffix in (".mcap", ".csv")]
    mcap, csv = (pipeline.run(log, configuration) for log in logs)
    assert csv.metrics.total.median < 0.5
    # the points are rounded to 1e-9 m, and are over 0.4 m apart
    assert mcap.metrics.total.rmse == pytest.approx(csv.metrics.total.rmse, abs=1e-5)


def test_without_gyroscope_and_points_there_is_nothing(simulated, tmp_path):
    flight = simulated("docking", seed=0)
    path = written(tmp_path, dataclasses.replace(flight, signals={}))
    with pytest.raises(readers.ReadError, match=r"no gyroscope .*holds: geometry_msgs/msg/PoseS"):
        readers.read(path)


def test_torque_reads_back(simulated, tmp_path):
    flight = simulated("handheld", seed=0)
    t = flight.signals["gyro"].t[::10]
    torque = Signal(t, np.random.default_rng(0).normal(size=(len(t), 3)))
    known = dataclasses.replace(flight, signals={**flight.signals, "torque": torque})
    recording = readers.read(written(tmp_path, known))
    assert_allclose(to_ned(recording, "torque"), torque.y, rtol=0, atol=6e-10)


def test_sensors_of_different_times_have_topics_of_their_own(simulated, tmp_path):
    flight = resample(simulated("handheld", seed=0), "accel", 50.0)
    recording = readers.read(written(tmp_path, flight))
    assert recording.signals["gyro"].source == "/imu/gyro"
    assert recording.signals["accel"].source == "/imu/accel"
    assert_array_equal(recording.signals["accel"].t, flight.signals["accel"].t + UNDATED)
    gyro = recording.signals["gyro"]
    assert len(gyro.t) == len(flight.signals["gyro"].t)


def test_rosbags_reads_every_message(simulated, tmp_path):
    flight = simulated("quadcopter", seed=0)
    counts = {"/imu/data_raw": 3123, "/imu/mag": 3123, "/gps/fix": 624, "/velocity": 624,
              "/ground_truth/pose": 1561, "/autopilot/pose": 1561}  # fmt: skip
    with BagReader(written(tmp_path, flight, ".bag")) as bag:
        assert {one.topic: one.msgcount for one in bag.connections} == counts
    with FolderReader(written(tmp_path, flight, "")) as folder:
        assert {one.topic: one.msgcount for one in folder.connections} == counts
        assert folder.duration == pytest.approx(64e9, rel=0.01)


def test_an_imu_says_that_it_has_no_orientation(simulated, tmp_path):
    path = written(tmp_path, simulated("quadcopter", seed=0), ".bag")
    store = get_typestore(Stores.ROS1_NOETIC)
    with AnyReader([path], default_typestore=store) as log:
        connections = [one for one in log.connections if one.topic == "/imu/data_raw"]
        connection, recorded, raw = next(log.messages(connections=connections))
        imu = log.deserialize(raw, connection.msgtype)
    assert imu.orientation_covariance[0] == -1.0
    assert imu.linear_acceleration.z > 5.0  # standing, in a body whose z is up
    stamp = imu.header.stamp.sec * 10**9 + imu.header.stamp.nanosec
    assert 0 < recorded - stamp < 10**7


@pytest.mark.parametrize("suffix", FORMATS)
def test_the_same_seed_makes_the_same_files(suffix, tmp_path):
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        path = written(tmp_path / name, simulation.simulate("docking"), suffix)
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        made.append([(file.name, file.read_bytes()) for file in files])
    assert made[0] == made[1]


def test_a_folder_is_written_again_but_not_into_another(simulated, tmp_path):
    flight = simulated("docking", seed=0)
    path = written(tmp_path, flight, "")
    assert {file.name for file in path.iterdir()} == {"docking.mcap", "metadata.yaml"}
    simulation.write(path, flight)
    with pytest.raises(ConfigError, match=r"flight: a folder that holds other files\. Give a new"):
        simulation.write(path, simulated("handheld", seed=0))


@pytest.mark.parametrize("suffix", FORMATS)
def test_vectors_that_ros_has_no_message_for_are_one_line(suffix, simulated, tmp_path):
    with pytest.raises(ConfigError, match=r"ROS has no message for v1, v2, v3 of fts-7\.1\. Write"):
        written(tmp_path, simulated("fts-7.1", seed=0), suffix)
