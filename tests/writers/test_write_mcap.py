import errno
import json
import os
from dataclasses import replace

import numpy as np
import pytest
import yaml
from mcap.reader import NonSeekingReader, make_reader
from numpy.testing import assert_array_equal
from results import SECOND, UTC, result
from rosbags.highlevel import AnyReader

from attest import writers
from attest.errors import WriteError
from attest.geometry import quaternion
from attest.recording import Clock, Signal
from attest.writers import mcap_file
from attest.writers.mcap import LAST_STAMP, write_mcap

TOPICS = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/attest/fts/pose": "geometry_msgs/msg/PoseStamped",
    "/attest/fts/imu": "sensor_msgs/msg/Imu",
    "/attest/fts/bias": "geometry_msgs/msg/Vector3Stamped",
    "/attest/fts/euler": "geometry_msgs/msg/Vector3Stamped",
    "/attest/fts/error": "attest_msgs/msg/AttitudeError",
    "/attest/fts/state": "attest_msgs/msg/ObserverState",
    "/attest/fts/torque": "geometry_msgs/msg/Vector3Stamped",
    "/attest/reference/SIMSTATE/pose": "geometry_msgs/msg/PoseStamped",
    "/attest/mag": "sensor_msgs/msg/MagneticField",
}


def written(folder, made):
    path = folder / "fts.mcap"
    write_mcap(path, [made])
    return path


def decoded(path):
    """Messages of each topic, with their times, by rosbags and the definitions in the file."""
    topics = {}
    with AnyReader([path]) as reader:
        for connection, t, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            topics.setdefault(connection.topic, []).append((t, message))
    return topics


def summary(path):
    with path.open("rb") as file:
        return make_reader(file, validate_crcs=True).get_summary()


def metadata(path):
    with path.open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def wxyz(q):
    return [q.w, q.x, q.y, q.z]


def stamps(topic):
    return np.array([t for t, _ in topic])


@pytest.fixture(scope="module")
def made():
    return result(300)


@pytest.fixture(scope="module")
def topics(made, tmp_path_factory):
    return decoded(written(tmp_path_factory.mktemp("mcap"), made))


def test_every_topic_has_the_schema_that_the_design_says(made, tmp_path):
    read = summary(written(tmp_path, made))
    found = {c.topic: read.schemas[c.schema_id].name for c in read.channels.values()}
    assert found == TOPICS
    assert {c.message_encoding for c in read.channels.values()} == {"cdr"}
    assert {s.encoding for s in read.schemas.values()} == {"ros2msg"}


def test_poses_are_the_estimates_to_the_last_bit(made, topics):
    poses = topics["/attest/fts/pose"]
    assert_array_equal([wxyz(m.pose.orientation) for _, m in poses], made.estimates.q)
    assert_array_equal(stamps(poses), made.estimates.t + UTC)
    assert all(xyz(m.pose.position) == [0, 0, 0] for _, m in poses)
    assert {m.header.frame_id for _, m in poses} == {"world"}


def test_header_stamp_is_the_log_time(topics):
    for topic in set(TOPICS) - {"/tf", "/tf_static"}:
        headers = [(t, m.header.stamp) for t, m in topics[topic]]
        assert all(s.sec * SECOND + s.nanosec == t for t, s in headers), topic


def test_transforms_lead_from_map_to_body_and_reference(made, topics):
    [(_, static)] = topics["/tf_static"]
    [up] = static.transforms
    assert (up.header.frame_id, up.child_frame_id) == ("map", "world")
    down = quaternion.rotate(np.array(wxyz(up.transform.rotation)), np.eye(3)[2])
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-15)
    moving = [m.transforms[0] for _, m in topics["/tf"]]
    assert {m.header.frame_id for m in moving} == {"world"}
    of_body = [wxyz(m.transform.rotation) for m in moving if m.child_frame_id == "fts"]
    assert_array_equal(of_body, made.estimates.q)
    frames = {m.child_frame_id for m in moving}
    assert frames == {"fts", "reference/SIMSTATE"}


def test_enu_world_is_the_map(tmp_path):
    made = result(20)
    made = replace(made, recording=replace(made.recording, world="enu"))
    [(_, static)] = decoded(written(tmp_path, made))["/tf_static"]
    assert wxyz(static.transforms[0].transform.rotation) == [1, 0, 0, 0]


def test_imu_bias_and_torque_are_the_estimates(made, topics):
    imu = [m for _, m in topics["/attest/fts/imu"]]
    assert_array_equal([wxyz(m.orientation) for m in imu], made.estimates.q)
    assert_array_equal([xyz(m.angular_velocity) for m in imu], made.estimates.angular_velocity)
    accel = made.recording.signals["accel"].y  # on the same clock, so not interpolated
    assert_array_equal([xyz(m.linear_acceleration) for m in imu], accel)
    assert not any(m.linear_acceleration_covariance.any() for m in imu)
    bias = [xyz(m.vector) for _, m in topics["/attest/fts/bias"]]
    assert_array_equal(bias, made.estimates.gyro_bias)
    torque = [xyz(m.vector) for _, m in topics["/attest/fts/torque"]]
    assert_array_equal(torque, made.estimates.states["disturbance_torque"])


def test_euler_is_in_degrees(made, topics):
    angles = np.degrees(quaternion.to_euler(made.estimates.q))
    assert_array_equal([xyz(m.vector) for _, m in topics["/attest/fts/euler"]], angles)


def test_reference_and_error_are_left_out_where_there_is_none(made, topics):
    held = np.isfinite(made.metrics.error_deg[:, 0])
    assert 0 < held.sum() < len(held)
    reference = topics["/attest/reference/SIMSTATE/pose"]
    assert_array_equal([wxyz(m.pose.orientation) for _, m in reference], made.metrics.q_ref[held])
    error = topics["/attest/fts/error"]
    assert_array_equal(stamps(error), made.estimates.t[held] + UTC)
    angles = [[m.total, m.heading, m.inclination] for _, m in error]
    assert_array_equal(angles, made.metrics.error_deg[held])


def test_state_tells_everything_that_the_observer_diagnosed(made, topics):
    state = [m for _, m in topics["/attest/fts/state"]]
    assert_array_equal([m.s_norm for m in state], made.estimates.s_norm)
    assert_array_equal([m.cost for m in state], made.estimates.cost)
    assert np.isnan([m.lyapunov for m in state]).all()
    assert_array_equal([m.updated for m in state], made.estimates.updated)
    assert state[0].vectors == ["accel", "mag"]
    names = [*(f"disturbance_torque[{i}]" for i in range(3)), "step_size"]
    assert state[0].state_names == names
    values = np.column_stack(list(made.estimates.states.values()))
    assert_array_equal([m.states for m in state], values)


def test_mag_is_at_its_own_times(made, topics):
    mag = made.recording.signals["mag"]
    assert_array_equal(stamps(topics["/attest/mag"]), mag.t + UTC)
    assert_array_equal([xyz(m.magnetic_field) for _, m in topics["/attest/mag"]], mag.y)


def test_lyapunov_function_and_no_states(tmp_path):
    made = result(20)
    V = np.linspace(1.0, 0.0, 20)
    made = replace(made, estimates=replace(made.estimates, lyapunov=V, states={}))
    topics = decoded(written(tmp_path, made))
    state = [m for _, m in topics["/attest/fts/state"]]
    assert_array_equal([m.lyapunov for m in state], V)
    assert state[0].state_names == []
    assert len(state[0].states) == 0
    assert "/attest/fts/torque" not in topics


def test_without_reference_mag_and_accel_their_topics_are_not_there(tmp_path):
    topics = decoded(written(tmp_path, result(20, reference=False, mag=False, accel=False)))
    missing = {"/attest/reference/SIMSTATE/pose", "/attest/fts/error", "/attest/mag"}
    assert set(topics) == set(TOPICS) - missing
    _, imu = topics["/attest/fts/imu"][0]
    assert imu.linear_acceleration_covariance[0] == -1
    assert xyz(imu.linear_acceleration) == [0, 0, 0]


def test_specific_force_is_interpolated_to_the_estimates(tmp_path):
    made = result(20)
    t = made.estimates.t[[0, -1]]
    accel = Signal(t, np.array([[0.0, 2.0, 4.0], [1.0, 2.0, 0.0]]))
    recording = replace(made.recording, signals={"accel": accel})
    topics = decoded(written(tmp_path, replace(made, recording=recording)))
    found = np.array([xyz(m.linear_acceleration) for _, m in topics["/attest/fts/imu"]])
    share = (made.estimates.t - t[0]) / (t[1] - t[0])
    np.testing.assert_allclose(found[:, 0], share, rtol=1e-15)
    np.testing.assert_allclose(found[:, 2], 4.0 - 4.0 * share, atol=1e-14)


def test_checksums_hold_and_messages_are_in_order_of_time_over_many_chunks(tmp_path):
    path = written(tmp_path, result(3000))
    assert summary(path).statistics.chunk_count > 2
    with path.open("rb") as file:
        counts = {}
        last = 0
        for schema, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages(
            log_time_order=False
        ):
            assert schema.name == TOPICS[channel.topic]
            assert message.log_time == message.publish_time >= last
            last = message.log_time
            counts[channel.id] = counts.get(channel.id, 0) + 1
    assert counts == summary(path).statistics.channel_message_counts


def test_index_finds_each_message(tmp_path):
    path = written(tmp_path, result(3000))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        start = UTC + 30 * SECOND
        span = {"starting_at": start, "ending_before": start + SECOND}
        found = list(reader.iter_messages(["/attest/fts/pose"], **span))
        assert [message.sequence for _, _, message in found] == list(range(1250, 1300))
        both = list(reader.iter_messages(["/tf"], **span))
        assert len(both) == 100  # body and reference


def test_profile_library_metadata_and_attachment(made, tmp_path):
    path = written(tmp_path, made)
    with path.open("rb") as file:
        reader = make_reader(file)
        header = reader.get_header()
        [attachment] = list(reader.iter_attachments())
    assert (header.profile, header.library.split()[0]) == ("ros2", "attest")
    assert attachment.name == "configuration.yaml"
    assert yaml.safe_load(attachment.data) == made.configuration
    assert attachment.log_time == made.estimates.t[0] + UTC
    read = metadata(path)
    assert read["attest/configuration"]["gains.k_p"] == "2.0"
    assert read["attest/configuration"]["weights"] == "[3.0, 2.0]"
    assert read["attest/summary"]["metrics.dip"] == "null"
    assert float(read["attest/summary"]["metrics.total.rmse_deg"]) == made.metrics.total.rmse
    assert read["attest/versions"]["attest"] == "0.1.0"
    assert read["attest/clock"]["message_time"] == "UTC since 1970"


def test_equal_runs_give_equal_bytes_but_for_nothing(tmp_path):
    first = result(300)
    second = replace(first, summary={**first.summary, "timing": {"reading_s": 0.1234}})
    paths = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for path, made in zip(paths, (first, second), strict=True):
        write_mcap(path, [made])
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize(
    ("utc", "start", "first", "words"),
    [
        (None, 5 * SECOND, 5 * SECOND, "log's clock"),
        (None, 0, 0, "log's clock"),
        (None, -3 * SECOND, 0, "since the first message"),
        (-9 * SECOND, 5 * SECOND, 0, "since the first message"),
        (LAST_STAMP, 5 * SECOND, 0, "since the first message"),
    ],
)
def test_times_that_ros_cannot_hold_count_from_the_first_message(
    tmp_path, utc, start, first, words
):
    made = result(20, utc=utc, start=start)
    path = written(tmp_path, made)
    times = stamps(decoded(path)["/attest/fts/pose"])
    assert_array_equal(times, made.estimates.t - made.estimates.t[0] + first)
    clock = metadata(path)["attest/clock"]
    assert clock["message_time"].startswith(words)
    assert made.estimates.t[0] + int(clock["message_time_minus_log_clock_ns"]) == first


HOSTILE = "a b/../ü\x00\n|`/1st //\udcff"


def test_hostile_names_are_spelt_as_ros_allows(tmp_path):
    made = result(20)
    names = (HOSTILE, "mag")
    made = replace(
        made,
        samples=replace(made.samples, names=names),
        metrics=replace(made.metrics, reference=HOSTILE),
        recording=replace(made.recording, clock=Clock(HOSTILE, UTC)),
        configuration={HOSTILE: HOSTILE},
        summary={HOSTILE: {HOSTILE: HOSTILE}},
    )
    path = written(tmp_path, made)
    topics = decoded(path)
    assert "/attest/reference/a_b/_/_/_1st_/_/pose" in topics
    _, state = topics["/attest/fts/state"][0]
    assert state.vectors[1] == "mag"
    assert json.dumps(metadata(path)["attest/summary"])


def test_run_without_estimates_is_written(tmp_path):
    made = result(2)
    empty = {
        name: getattr(made.estimates, name)[:0]
        for name in ("t", "q", "angular_velocity", "gyro_bias", "s_norm", "cost", "updated")
    }
    made = replace(
        made,
        estimates=replace(made.estimates, states={}, **empty),
        metrics=None,
        recording=replace(made.recording, signals={}),
    )
    assert summary(written(tmp_path, made)).statistics.message_count == 0


def test_full_disk_is_one_line_and_leaves_the_old_file(made, tmp_path, monkeypatch):
    path = tmp_path / "fts.mcap"
    path.write_bytes(b"old")

    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(mcap_file, "add_chunk", refuse)
    with pytest.raises(WriteError) as caught:
        write_mcap(path, [made])
    assert str(caught.value) == (
        f"{path}: cannot write: No space left on device. "
        "Free some space, or choose another folder with --output."
    )
    assert path.read_bytes() == b"old"
    assert [other.name for other in tmp_path.iterdir()] == ["fts.mcap"]


def test_every_output_is_written_by_its_observers_name(made, tmp_path):
    paths = list(writers.write([made], tmp_path / "flight"))
    assert [path.name for path in paths] == ["fts.mcap", "fts.rrd", "fts.json"]
    assert sorted(paths) == sorted((tmp_path / "flight").iterdir())
