"""Which topics are taken, what their stamps and units are worth, and what the user may name."""

import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import IMU, START, Log, compass, flight, header, times, xyz, xyzw

from attest import pipeline, readers
from attest.errors import ConfigError, ReadError
from attest.readers import ReadOptions

DAY = 86_400 * 10**9
POSE = "geometry_msgs/msg/PoseStamped"


def read(log, tmp_path, **options):
    path = tmp_path / "log_mcap"
    shutil.rmtree(path, ignore_errors=True)
    return readers.read(log.write(tmp_path), ReadOptions(**options))


def texts(recording):
    return {note.text: note.count for note in recording.notes}


def doubts(recording):
    return [note.text for note in recording.notes if note.doubt]


def sources(recording):
    return {name: signal.source for name, signal in recording.signals.items()}


def poses(log, topic, orientation, count=50):
    for i, t in enumerate(times(count)):
        log.add(topic, POSE, t, frame="map", pose={"orientation": xyzw(orientation(i))})
    return log


def swing(i):
    return np.array([np.cos(0.05 * i), 0.0, 0.0, np.sin(0.05 * i)])


def test_the_topic_with_most_messages_is_taken_and_the_others_are_told(tmp_path):
    log = flight(flight(Log(), "/slow", rate=10, count=5), "/quick")
    log = compass(compass(log, "/mag_b"), "/mag_a")
    recording = read(log, tmp_path)
    assert sources(recording) == {"gyro": "/quick", "accel": "/quick", "mag": "/mag_a"}
    assert texts(recording).keys() == {
        "gyro from /quick, not /slow: --set input.topics.gyro=TOPIC takes another",
        "mag from /mag_a, not /mag_b: --set input.topics.mag=TOPIC takes another",
    }
    topics = recording.details["topics"]
    assert topics[-1] == {"topic": "/slow", "type": IMU, "messages": 5, "used": []}


def test_the_user_may_name_topics(tmp_path):
    log = compass(flight(flight(Log(), "/slow", rate=10, count=5), "/quick"), "/mag")
    named = read(log, tmp_path, topics={"gyro": "/slow"})
    assert sources(named) == {"gyro": "/slow", "accel": "/slow", "mag": "/mag"}
    named = read(log, tmp_path, topics={"accel": "/slow"})
    assert (named.signals["gyro"].source, named.signals["accel"].source) == ("/quick", "/slow")
    assert sources(read(log, tmp_path, imu="/slow"))["gyro"] == "/slow"
    with pytest.raises(ReadError) as caught:
        read(log, tmp_path, topics={"gyro": "/mag"})
    path = tmp_path / "log_mcap"
    message = f"{path}: /mag gives no gyro. Topics that do: /slow, /quick."
    assert str(caught.value) == message


def test_topics_are_part_of_the_configuration(tmp_path):
    log = flight(flight(Log(), "/slow", rate=10, count=20), "/quick", count=200)
    path = log.write(tmp_path)
    configuration = pipeline.configure("fts", ["input.topics.gyro=/slow"])
    assert pipeline.read(path, configuration).signals["gyro"].source == "/slow"
    with pytest.raises(ConfigError, match=r"unknown key 'input.topics.gyr'. Did you mean 'gyro'"):
        pipeline.configure("fts", ["input.topics.gyr=/slow"])


def test_references_are_truth_by_name_only(tmp_path):
    log = flight(Log(), orientation=swing)
    for topic in ("/robot/pose", "/optitrack/robot", "/robot/gt", "/length/pose"):
        poses(log, topic, swing)
    recording = read(log, tmp_path)
    kinds = {name: reference.kind for name, reference in recording.references.items()}
    assert kinds == {"/optitrack/robot": "truth", "/robot/gt": "truth", "/imu": "autopilot",
                     "/length/pose": "autopilot", "/robot/pose": "autopilot"}  # fmt: skip
    assert list(recording.references)[:3] == ["/optitrack/robot", "/robot/gt", "/imu"]
    assert "/robot/gt taken as truth, as its name has 'gt'" in texts(recording)
    first = read(log, tmp_path, topics={"reference": "/robot/pose"})
    assert next(iter(first.references)) == "/robot/pose"


@pytest.mark.parametrize(
    "more",
    [
        {"orientation": lambda _: (0, 0, 0, 0)},
        {"orientation": lambda _: (1, 0, 0, 0)},
        {"orientation": swing, "orientation_covariance": [-1.0, *[0] * 8]},
    ],
)
def test_placeholders_are_no_orientation(tmp_path, more):
    assert not read(flight(Log(), **more), tmp_path).references


def test_what_a_covariance_says_is_not_there_is_not_taken(tmp_path):
    nothing = [-1.0, *[0.0] * 8]
    log = flight(flight(Log(), "/ahrs", angular_velocity_covariance=nothing), "/unit", count=40)
    recording = read(log, tmp_path)
    assert (recording.signals["gyro"].source, recording.signals["accel"].source) == (
        "/unit",
        "/unit",
    )


@pytest.mark.parametrize(
    ("strength", "unit"), [(0.5, "gauss"), (50.0, "µT"), (500.0, "mG"), (50_000.0, "nT")]
)
def test_a_magnetometer_in_another_unit_is_mended(tmp_path, strength, unit):
    field = strength * np.array([0.6, 0.0, -0.8])
    recording = read(compass(flight(Log()), field=field), tmp_path)
    assert_allclose(recording.signals["mag"].y[0], [3e-5, 0, -4e-5])
    assert doubts(recording) == [f"/mag reads {strength:.3g}, which is {unit} and no tesla: "
                                 "taken so"]  # fmt: skip


def test_a_magnetometer_of_no_strength_is_a_direction(tmp_path):
    recording = read(compass(flight(Log()), field=(1.0, 0.0, 0.0)), tmp_path)
    assert_array_equal(recording.signals["mag"].y[0], [1, 0, 0])
    text = "/mag reads 1, no strength of the Earth's field: direction only"
    assert text in texts(recording)


def test_a_stamp_of_zero_or_far_off_gives_way_to_the_recorder(tmp_path):
    log = Log()
    for i, t in enumerate(times()):
        stamp = None if i == 3 else t + 3 * DAY if i == 7 else t
        log.add("/imu", IMU, t, 1000, header=header(stamp), angular_velocity=xyz(i, 1, 1))
    recording = read(log, tmp_path)
    expected = START + np.array(times())
    expected[[3, 7]] += 1000
    assert_array_equal(recording.signals["gyro"].t, expected)
    text = "/imu stamp zero or over 60 s from the recorder's time, which was taken"
    assert texts(recording)[text] == 2


def test_no_stamps_at_all_leave_the_recorder(tmp_path):
    log = Log()
    for i, t in enumerate(times()):
        log.add("/imu", IMU, t, 1000, header=header(None), angular_velocity=xyz(i, 1, 1))
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["gyro"].t, START + np.array(times()) + 1000)
    assert texts(recording)["/imu without stamps: recorder's time taken"] == 50
    assert recording.clock.name == "recorder's time"


def test_stamps_of_another_clock_are_moved_if_steady_and_else_dropped(tmp_path):
    log = compass(Log())
    for i, t in enumerate(times()):
        log.add("/imu", IMU, t, header=header(t - DAY), angular_velocity=xyz(i, 1, 1))
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["gyro"].t, START + np.array(times()))
    assert "/imu stamped 86400 s from the recorder's time, steadily: moved by that" in texts(
        recording
    )
    log = Log()
    for i, t in enumerate(times()):
        log.add("/imu", IMU, t, header=header(2 * t - 9 * DAY + 10**9 * i),
                angular_velocity=xyz(i, 1, 1))  # fmt: skip
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["gyro"].t, START + np.array(times()))
    assert doubts(recording) == ["/imu stamped 9 days from the recorder's time: recorder's time "
                                 "taken"]  # fmt: skip


def test_messages_out_of_order_and_twins(tmp_path):
    log = Log()
    order = [0, 2, 1, 3, 3, 4]
    for i, t in enumerate(times(6)):
        log.add("/imu", IMU, t, header=header(order[i] * 10**7), angular_velocity=xyz(i, 1, 1))
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["gyro"].y[:, 0], [0, 2, 1, 3, 5])
    assert texts(recording)["/imu message out of order, put in order"] == 1
    assert texts(recording)["/imu message with the stamp of another dropped"] == 1


def test_velocity_in_the_body_or_in_a_lab_is_not_taken_unless_named(tmp_path):
    log = flight(Log(), frame="base_link")
    for t in times():
        for topic, frame in (("/body", "base_link"), ("/vicon/vel", "world")):
            log.add(topic, "geometry_msgs/msg/TwistStamped", t, frame=frame,
                    twist={"linear": xyz(1, 2, 3)})  # fmt: skip
    recording = read(log, tmp_path)
    assert "velocity" not in recording.signals
    assert len([text for text in texts(recording) if "input.topics.velocity=TOPIC" in text]) == 2
    named = read(log, tmp_path, topics={"velocity": "/vicon/vel"})
    assert_array_equal(named.signals["velocity"].y[0], [1, 2, 3])


def test_world_as_the_user_declares_it(tmp_path):
    recording = read(flight(Log(), orientation=swing), tmp_path, world="ned")
    assert (recording.world, recording.body) == ("ned", "frd")
    assert_allclose(recording.references["/imu"].q, [swing(i) for i in range(50)], atol=1e-15)


def test_own_results_read_back_and_are_called_estimates(tmp_path, sample_logs):
    result = pipeline.run(sample_logs / "quadcopter.tlog", pipeline.configure("fts"))
    mcap = next(path for path in pipeline.write([result], tmp_path) if path.suffix == ".mcap")
    recording = readers.read(mcap)
    assert recording.world == "ned"
    assert recording.references["/attest/fts/pose"].kind == "autopilot"
    assert not [r for r in recording.references.values() if r.kind == "truth"]
    assert_allclose(recording.references["/attest/fts/pose"].q, result.estimates.q, atol=1e-12)
    assert recording.signals["mag"].source == "/attest/mag"
    text = "gyro from /attest/fts/imu, which is attest's own estimate and no measurement"
    assert text in doubts(recording)


@pytest.mark.shared
def test_one_flight_in_two_containers_gives_one_estimate(shared):
    configuration = pipeline.configure("fts")
    names = ("rosbag1/ardrone_imu.bag", "rosbag2/ardrone_imu_mcap")
    bag, folder = (pipeline.run(shared / name, configuration) for name in names)
    assert_array_equal(bag.estimates.t, folder.estimates.t)
    assert_allclose(bag.estimates.q, folder.estimates.q, atol=1e-9)
    assert len(folder.summary["log"]["sha256"]) == 64
    assert folder.summary["reference"]["name"] == "/ardrone/imu"


def test_what_a_vehicle_shall_do_is_no_measurement(tmp_path):
    log = flight(Log("mcap"))
    turning = lambda i: (np.cos(0.01 * i), 0.0, 0.0, np.sin(0.01 * i))  # noqa: E731
    poses(log, "/mavros/setpoint_position/local", turning, count=400)
    poses(log, "/mavros/local_position/pose", turning)
    recording = read(log, tmp_path)
    assert "/mavros/setpoint_position/local" not in recording.references
    assert "/mavros/local_position/pose" in recording.references
    assert any("is a command: not used" in text for text in texts(recording))
    asked = read(log, tmp_path, topics={"reference": "/mavros/setpoint_position/local"})
    assert next(iter(asked.references)) == "/mavros/setpoint_position/local"


def test_an_image_is_no_magnetometer(tmp_path):
    log = flight(Log("mcap"))
    for t in times(50):
        log.add(
            "/image_proc/offset", "geometry_msgs/msg/Vector3Stamped", t, vector=xyz(1.0, 2.0, 3.0)
        )
    assert "image" not in sources(read(log, tmp_path)).get("mag", "")
