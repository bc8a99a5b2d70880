"""ULog topics into a recording: units, instances, clocks, every error."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ulog_logs import Log, flight

from attest import readers
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import ReadOptions

TIMES = np.arange(100.0, 104.0, 0.004)
TURNED = quaternion.from_euler(*np.radians([10.0, -20.0, 30.0]))


def read(tmp_path, log, **options):
    path = tmp_path / "flight.ulg"
    path.write_bytes(log if isinstance(log, bytes) else bytes(log.data))
    return readers.read(path, ReadOptions(**options))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def seconds(recording, name="gyro"):
    return recording.signals[name].t / 1e9


def test_units_and_axes(tmp_path):
    recording = read(tmp_path, flight(TIMES))
    assert (recording.format, recording.world, recording.body) == ("ulog", "ned", "frd")
    assert_allclose(recording.signals["gyro"].y[0], [0.1, 0.2, 0.3], rtol=1e-6)
    assert_allclose(recording.signals["accel"].y[0], [0, 0, -9.8], rtol=1e-6)
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5], rtol=1e-6)
    assert recording.signals["mag"].source == "vehicle_magnetometer"
    assert_allclose(seconds(recording), TIMES, rtol=0, atol=1e-9)
    assert_allclose(recording.references["vehicle_attitude"].q[0], [1, 0, 0, 0])
    assert recording.clock.utc_offset is None
    assert [*notes(recording)] == ["magnetometer as the autopilot corrected it by its calibration"]


def test_the_magnetometer_of_2016_is_new_where_its_time_says_so(tmp_path):
    log = Log()
    log.topics["sensor_combined"] += (
        " magnetometer_timestamp_relative:int32_t magnetometer_ga:float[3]"
    )
    for i, t in enumerate(TIMES):
        late = -(i % 3) * 4000 - 500  # a new value every third time
        log.add("sensor_combined", t, 0.1, 0, 0, 0, 0, 0, -9.8, late, 0.2, 0.0, 0.4)
    recording = read(tmp_path, log)
    assert_allclose(seconds(recording, "mag"), TIMES[::3] - 0.0005, rtol=0, atol=1e-9)
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5], rtol=1e-6)


def test_an_accelerometer_without_a_time_has_no_value(tmp_path):
    log = flight(TIMES)
    log.add("sensor_combined", 104.0, 0.1, 0, 0, 0x7FFFFFFF, 0, 0, -9.8)
    recording = read(tmp_path, log)
    assert len(recording.signals["accel"].t) == len(TIMES)
    assert notes(recording)["sensor_combined accel without a value dropped"] == 1


def test_increments_are_rates(tmp_path):
    log = Log()
    for t in TIMES:
        log.add("vehicle_imu", t, round(t * 1e6) - 300, 4e-4, 0, 0, 0, 0, -0.0392, 4000, 4000)
    recording = read(tmp_path, log)
    assert_allclose(recording.signals["gyro"].y[0], [0.1, 0, 0], rtol=1e-6)
    assert_allclose(recording.signals["accel"].y[0], [0, 0, -9.8], rtol=1e-6)
    assert_allclose(seconds(recording), TIMES - 0.0003, rtol=0, atol=1e-9)


def test_raw_sensors_come_second_and_are_named_so(tmp_path):
    log = flight(TIMES[::100])
    for t in TIMES:
        for instance in range(2):
            log.add("sensor_gyro", t, 0, 0, 0.5 + instance, instance=instance)
            log.add("sensor_accel", t, 0, 0, 0, 0, -9.0 - instance, instance=instance)
    recording = read(tmp_path, log)
    assert recording.signals["gyro"].source == "sensor_gyro[0]", "the corrected one is slow"
    text = "sensor_gyro[0] is raw: the autopilot's calibration is not in it"
    assert text in notes(recording)
    recording = read(tmp_path, log, imu="sensor_gyro[1]")
    assert recording.signals["gyro"].y[0, 0] == 1.5
    assert recording.signals["accel"].y[0, 2] == -10.0
    assert read(tmp_path, log, imu="sensor_combined").signals["gyro"].source == "sensor_combined"
    with pytest.raises(ReadError) as error:
        read(tmp_path, log, imu="vehicle_imu")
    held = "sensor_combined, sensor_gyro[0], sensor_gyro[1]"
    assert str(error.value).endswith(f"no vehicle_imu to read. The log holds: {held}.")


def test_bursts_are_taken_apart(tmp_path):
    log = Log()
    for i, t in enumerate(TIMES):
        counts = [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3]
        burst = (round(t * 1e6), 1000.0, 0.001, 4, *counts, *[0] * 8)
        log.add("sensor_gyro_fifo", t, *burst)
        log.add("sensor_accel_fifo", t, *burst[:4], *[0] * 8, *[-9800] * 4)
    recording = read(tmp_path, log)
    gyro = recording.signals["gyro"]
    assert_allclose(gyro.y[:, 0], 0.001 * np.arange(4 * len(TIMES)), rtol=1e-6)
    assert_allclose(np.diff(gyro.t), 1e6)
    assert gyro.t[3] == 100 * 10**9
    assert_allclose(recording.signals["accel"].y[:, 2], -9.8, rtol=1e-6)


def test_velocity_is_used_where_it_is_valid(tmp_path):
    log = flight(TIMES)
    for i, t in enumerate(TIMES):
        log.add("vehicle_local_position", t, 1.0, 2.0, 3.0, i > 9, 1)
    recording = read(tmp_path, log)
    assert_allclose(recording.signals["velocity"].y[0], [1, 2, 3])
    assert_allclose(seconds(recording, "velocity"), TIMES[10:], rtol=0, atol=1e-9)
    assert notes(recording)["vehicle_local_position velocity without a value dropped"] == 10


def test_velocity_that_calls_itself_inaccurate_is_dropped(tmp_path):
    log = Log()
    log.topics["vehicle_local_position"] += " evh:float evv:float"
    for i, t in enumerate(flight_times := TIMES[:500]):
        log.add("sensor_combined", t, 0.1)
        log.add("vehicle_local_position", t, 1.0, 2.0, 3.0, 1, 1, 0.2, 9.0 if i < 20 else 0.3)
    recording = read(tmp_path, log)
    assert_allclose(seconds(recording, "velocity"), flight_times[20:], rtol=0, atol=1e-9)
    text = "vehicle_local_position velocity no better than 2 m/s dropped"
    assert notes(recording)[text] == 20


def test_velocity_of_a_receiver_needs_a_fix_and_accuracy(tmp_path):
    log = Log()
    log.topics["vehicle_gps_position"] += " s_variance_m_s:float satellites_used:uint8_t"
    for i, t in enumerate(TIMES[:500]):
        where = (474_000_000, 85_000_000, 500_000, 1.0, 2.0, 3.0, 0)
        fix, accuracy, satellites = 2 if i < 10 else 3, 4.0 if i < 30 else 0.3, 3 if i < 60 else 9
        log.add("sensor_combined", t, 0.1)
        log.add("vehicle_gps_position", t, 0, *where, fix, 1, accuracy, satellites)
    recording = read(tmp_path, log)
    assert len(recording.signals["velocity"].t) == 440
    assert notes(recording)["vehicle_gps_position velocity without a 3D fix dropped"] == 60


def test_a_place_that_is_no_number_is_dropped_without_a_word_of_numpy(tmp_path):
    """Some NaN of damaged bytes signal it in arithmetic, which numpy warns of."""
    log, (signalling,) = Log(), struct.unpack("<d", (0x7FF0_0000_0000_0001).to_bytes(8, "little"))
    for i, t in enumerate(TIMES):
        log.add("sensor_combined", t, 0.1)
        log.add("vehicle_global_position", t, signalling if i < 5 else 47.4, 8.5, 500.0)
    assert len(read(tmp_path, log).signals["position"].t) == len(TIMES) - 5


def test_a_receiver_gives_velocity_place_and_utc(tmp_path):
    log, unix = Log(), 1_700_000_000.0
    for t in TIMES:
        fix = (474_000_000, 85_000_000, 500_000, 1.0, 2.0, 3.0, -200_000, 3, 1)
        log.add("sensor_combined", t, 0.1)
        log.add("vehicle_gps_position", t, round((unix + t - 0.2) * 1e6), *fix)
        log.add("vehicle_local_position", t, 9.0, 9.0, 9.0, 0, 1)
    recording = read(tmp_path, log)
    assert_allclose(recording.signals["velocity"].y[0], [1, 2, 3])
    assert_allclose(recording.signals["position"].y[0], [47.4, 8.5, 500])
    assert recording.clock.utc_offset == unix * 10**9
    text = "vehicle_local_position without a valid velocity throughout: not used"
    assert text in notes(recording)


def test_references_by_worth(tmp_path):
    more = {
        "vehicle_attitude_groundtruth": TURNED,
        "estimator_attitude": (0, *TURNED),
        "vehicle_visual_odometry": (1, *TURNED),
        "vehicle_mocap_odometry": (1, *TURNED),
    }
    recording = read(tmp_path, flight(TIMES, **more))
    kinds = {name: reference.kind for name, reference in recording.references.items()}
    assert [*kinds.items()] == [
        ("vehicle_attitude_groundtruth", "truth"),
        ("vehicle_mocap_odometry", "truth"),
        ("vehicle_attitude", "autopilot"),
        ("estimator_attitude", "autopilot"),
        ("vehicle_visual_odometry", "autopilot"),
    ]
    assert_allclose(recording.references["vehicle_mocap_odometry"].q[0], TURNED, atol=1e-7)
    doubts = [note.text for note in recording.notes if note.doubt]
    assert doubts == ["vehicle_visual_odometry in a local frame: its heading is not from north"]


def test_stray_stamps_are_cut_and_counted(tmp_path):
    log = Log(start=99_900_000)
    log.add("sensor_combined", 1.5, 0.1).add("vehicle_attitude", 2.0, 1.0)
    log.add("vehicle_attitude", 3.0, 1.0)
    flight(TIMES, log).add("vehicle_attitude", 1194.0, 1.0)
    log.add("vehicle_attitude", 2.0**44, 1.0)
    recording = read(tmp_path, log)
    assert_allclose(seconds(recording)[[0, -1]], TIMES[[0, -1]], rtol=0, atol=1e-9)
    assert len(recording.references["vehicle_attitude"].t) == len(TIMES)
    told = notes(recording)
    assert told["sensor_combined with a stray time dropped"] == 1
    assert told["vehicle_attitude with a stray time dropped"] == 3
    assert told["vehicle_attitude without a usable time dropped"] == 1


def test_dropouts_are_counted(tmp_path):
    log = flight(TIMES).raw("O", struct.pack("<H", 30)).raw("O", struct.pack("<H", 12))
    assert notes(read(tmp_path, log))["dropouts of the logger, 42 ms"] == 2


def test_the_vehicle_is_named(tmp_path):
    log = Log().info("sys_name", "PX4").info("ver_hw", "FMU\x07V5").info("ver_sw", "abc")
    key = b"uint32_t ver_sw_release"
    log.raw("I", bytes([len(key)]) + key + struct.pack("<I", 0x010E03FF))
    assert read(tmp_path, flight(TIMES, log)).vehicle == "PX4 v1.14.3 on FMUV5"


@pytest.mark.parametrize(
    ("told", "number"),
    [("000600000000383638393239510D0035", "uid 000600000000383638393239510d0035"),
     ("0" * 36, None), ("many words", None), ("ab" * 100, None)]
)  # fmt: skip
def test_the_vehicle_has_the_number_of_its_processor(tmp_path, told, number):
    assert read(tmp_path, flight(TIMES, Log().info("sys_uuid", told))).vehicle_id == number


def test_appended_data_is_read_behind_what_was_cut(tmp_path):
    log = flight(TIMES[:500], Log().flags())
    whole = bytes(log.data)
    rest = Log()
    rest.ids = log.ids
    for t in TIMES[500:]:
        rest.add("sensor_combined", t, 0.1)
    cut = len(whole) - 7  # within the last message
    start = 16 + 3 + 16
    appended = whole[:cut] + bytes(rest.data[16:])
    flagged = appended[: start - 8] + b"\1" + appended[start - 7 : start]
    flagged += struct.pack("<3Q", cut, 0, 0) + appended[start + 24 :]
    recording = read(tmp_path, flagged)
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert len(recording.references["vehicle_attitude"].t) == 499


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Log().add("cpuload", 1.0), "no inertial topic. Log sensor_combined."),
        (Log, "no inertial topic. Log sensor_combined."),
        (
            lambda: flight(TIMES, Log().flags(incompatible=2)),
            "a ULog of a later kind than attest knows. Convert it with pyulog.",
        ),
        (
            lambda: Log().add("sensor_combined", 1.0, np.nan, 0, 0),
            "no sample of sensor_combined can be used. Choose another one.",
        ),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path, make, message):
    with pytest.raises(ReadError) as error:
        read(tmp_path, make())
    assert str(error.value) == f"{tmp_path / 'flight.ulg'}: {message}"
