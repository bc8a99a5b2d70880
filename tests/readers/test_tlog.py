"""Messages into a recording: units, vehicles, clocks, and every error."""

import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pymavlink.dialects.v20 import ardupilotmega as mav

from attest import readers
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.readers import ReadOptions

FORMATS = ", ".join(readers.NAMES)
UNIX = 1_700_000_000_000_000
"""Receiver's clock when the sender's boot clock reads zero, microseconds."""


class Log:
    """A log in the making."""

    def __init__(self, stamps=True):
        self.data, self.stamps, self.writers = bytearray(), stamps, {}

    def add(self, message, boot, sender=(1, 1), late=0.02):
        """Append a message that the receiver got a little after ``boot`` seconds."""
        if sender not in self.writers:
            self.writers[sender] = mav.MAVLink(None, *sender)
        if self.stamps:
            self.data += struct.pack(">Q", UNIX + round((boot + late) * 1e6))
        self.data += message.pack(self.writers[sender])
        return self

    def read(self, tmp_path, **options):
        path = tmp_path / "flight.log"
        path.write_bytes(self.data)
        return readers.read(path, ReadOptions(**options))


def raw_imu(boot, gyro=(10, 20, 30), mag=(200, 0, 400)):
    return mav.MAVLink_raw_imu_message(round(boot * 1e6), 0, 0, -1000, *gyro, *mag)


def scaled(boot, number=2, mag=(200, 0, 400)):
    kind = getattr(mav, f"MAVLink_scaled_imu{number or ''}_message")
    return kind(round(boot * 1e3), 0, 0, -1000, 10, 20, 30, *mag)


def attitude(boot, roll=0.1):
    return mav.MAVLink_attitude_message(round(boot * 1e3), roll, 0.0, 0.2, 0, 0, 0)


def heartbeat(autopilot=3, kind=2):
    return mav.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)


def flight(boots, log=None, sender=(1, 1), shift=0.0):
    """IMU and attitude at these boot times, received ``shift`` seconds later than usual."""
    log = log or Log()
    for boot in boots:
        log.add(raw_imu(boot), boot + shift, sender).add(attitude(boot), boot + shift, sender)
    return log


def times(recording, name="gyro"):
    return recording.signals[name].t / 1e9


def notes(recording):
    return {note.text: note.count for note in recording.notes}


BOOTS = np.arange(100, 110, 0.1)


def test_units_and_axes(tmp_path):
    recording = flight(BOOTS).add(heartbeat(), 110).read(tmp_path)
    assert (recording.format, recording.world, recording.body) == ("tlog", "ned", "frd")
    assert recording.vehicle == "ArduPilot quadrotor, system 1, component 1"
    assert_allclose(recording.signals["gyro"].y[0], [0.01, 0.02, 0.03])
    assert_allclose(recording.signals["accel"].y[0], [0, 0, -9.80665])
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5])
    assert recording.signals["gyro"].source == "RAW_IMU"
    assert_allclose(times(recording), BOOTS)
    q = recording.references["ATTITUDE"].q
    assert_allclose(quaternion.to_euler(q[0]), [0.1, 0, 0.2], atol=1e-7)
    assert recording.references["ATTITUDE"].kind == "autopilot"


def test_highres_imu_gives_only_the_fields_it_updated(tmp_path):
    log = Log()
    for i, boot in enumerate(BOOTS):
        updated = 0b000_111_111 | (0b111_000_000 if i % 4 == 0 else 0)
        log.add(
            mav.MAVLink_highres_imu_message(
                round(boot * 1e6), 0, 0, -9.8, 0.1, 0.2, 0.3, 0.2, 0, 0.4, 0, 0, 0, 0, updated
            ),
            boot,
        )
    recording = log.read(tmp_path)
    assert [len(recording.signals[name].t) for name in ("gyro", "accel", "mag")] == [100, 100, 25]
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5], rtol=1e-6)
    assert_allclose(recording.signals["gyro"].y[0], [0.1, 0.2, 0.3], rtol=1e-6)
    assert notes(recording)["HIGHRES_IMU mag without a value dropped"] == 75


def test_imu_is_chosen_by_rate_then_completeness_and_can_be_named(tmp_path):
    log = flight(BOOTS[::4])
    for boot in BOOTS:
        log.add(scaled(boot, 2, mag=(0, 0, 0)), boot)
    recording = log.read(tmp_path)
    assert recording.signals["gyro"].source == "SCALED_IMU2"
    assert recording.signals["mag"].source == "RAW_IMU", "the faster one has no magnetometer"
    recording = log.read(tmp_path, imu="RAW_IMU")
    assert recording.signals["gyro"].source == "RAW_IMU"
    with pytest.raises(ReadError, match=r"no SCALED_IMU3 to read. The log holds: RAW_IMU, SCALED_"):
        log.read(tmp_path, imu="SCALED_IMU3")


def test_velocity_and_position(tmp_path):
    log = flight(BOOTS)
    for boot in BOOTS:
        place = (481234567, 112345678, 500_000, 0)
        velocity = (100, -200, 50)
        log.add(
            mav.MAVLink_global_position_int_message(round(boot * 1e3), *place, *velocity, 0), boot
        )
    recording = log.read(tmp_path)
    assert_allclose(recording.signals["velocity"].y[0], [1, -2, 0.5])
    assert_allclose(recording.signals["position"].y[0], [48.1234567, 11.2345678, 500])


def moving(fix, accuracy=lambda _: 0, **options):
    """Return a flight whose receiver's fix and accuracy [mm/s] are functions of the seconds."""
    log = flight(BOOTS)
    for boot in BOOTS:
        ms = round(boot * 1e3)
        log.add(mav.MAVLink_local_position_ned_message(ms, 0, 0, 0, boot, 2.0, 3.0), boot)
        told = {"satellites_visible": 9, "vel_acc": accuracy(boot)} | options
        where = (481234567, 112345678, 500_000, 80, 120, 0, 0)
        log.add(mav.MAVLink_gps_raw_int_message(ms * 1000, fix(boot), *where, **told), boot)
    return log


def test_velocity_of_an_autopilot_is_taken_while_its_receiver_has_a_fix(tmp_path):
    recording = moving(lambda boot: 3 if boot < 103.95 else 2).read(tmp_path)
    assert len(recording.signals["velocity"].t) == 40
    assert notes(recording)["LOCAL_POSITION_NED velocity without a 3D fix dropped"] == 60
    told = [note.text for note in recording.notes if note.doubt]
    assert "LOCAL_POSITION_NED velocity without a 3D fix dropped" in told
    poor = moving(lambda _: 4, lambda boot: 300 if boot < 107.95 else 2500).read(tmp_path)
    assert len(poor.signals["velocity"].t) == 80
    assert notes(poor)["LOCAL_POSITION_NED velocity no better than 2 m/s dropped"] == 20
    unknown = moving(lambda _: 3, satellites_visible=255).read(tmp_path)
    assert len(unknown.signals["velocity"].t) == 100


def test_velocity_of_an_autopilot_that_never_has_a_fix_is_of_something_else(tmp_path):
    recording = moving(lambda _: 1).read(tmp_path)
    assert len(recording.signals["velocity"].t) == 100


def test_zero_velocity_and_null_island_are_none(tmp_path):
    log = flight(BOOTS)
    for boot in BOOTS:
        log.add(mav.MAVLink_local_position_ned_message(round(boot * 1e3), 0, 0, 0, 0, 0, 0), boot)
        log.add(mav.MAVLink_gps_raw_int_message(round(boot * 1e6), 1, 0, 0, 0, 0, 0, 0, 0, 0), boot)
    recording = log.read(tmp_path)
    assert set(recording.signals) == {"gyro", "accel", "mag"}
    assert "LOCAL_POSITION_NED with a velocity of zero throughout: not used" in notes(recording)


def test_truth_comes_first_and_takes_the_time_of_the_message_before(tmp_path):
    log = Log()
    for boot in BOOTS:
        log.add(raw_imu(boot), boot).add(attitude(boot), boot)
        log.add(mav.MAVLink_simstate_message(0.1, 0, 0.2, *[0] * 8), boot)
        log.add(mav.MAVLink_ahrs2_message(0, 0, 0, 0, 0, 0), boot)
    recording = log.read(tmp_path)
    assert list(recording.references) == ["SIMSTATE", "ATTITUDE"]
    assert recording.references["SIMSTATE"].kind == "truth"
    assert_allclose(recording.references["SIMSTATE"].t / 1e9, BOOTS)
    assert notes(recording)[
        "SIMSTATE without a time of its own: took that of the message before"
    ] == len(BOOTS)
    assert "AHRS2 without an attitude throughout: not used" in notes(recording)


def test_motion_capture_with_a_clock_of_its_own(tmp_path):
    log = flight(BOOTS)
    for boot in BOOTS:
        log.add(mav.MAVLink_att_pos_mocap_message(
            round((boot + 5000) * 1e6), [1, 0, 0, 0], 0, 0, 0), boot, (255, 190))  # fmt: skip
    recording = log.read(tmp_path)
    reference = recording.references["ATT_POS_MOCAP"]
    assert reference.kind == "truth"
    assert_allclose(reference.t / 1e9, BOOTS, atol=1e-3)
    assert any("clock of its own" in note.text for note in recording.notes if note.doubt)


def test_odometry_in_the_right_frames_only(tmp_path):
    log = flight(BOOTS)
    for i, boot in enumerate(BOOTS):
        world, body = (20, 12) if i % 2 else (21, 12)
        log.add(
            mav.MAVLink_odometry_message(
                round(boot * 1e6), world, body, 0, 0, 0, [1, 0, 0, 0], *[0] * 6, [0] * 21, [0] * 21
            ),
            boot,
        )
    recording = log.read(tmp_path)
    assert recording.references["ODOMETRY"].kind == "autopilot"
    assert len(recording.references["ODOMETRY"].t) == 50
    assert notes(recording)["ODOMETRY attitude without a value dropped"] == 50
    assert any("local frame" in note.text for note in recording.notes if note.doubt)


def test_attitude_quaternion_is_taken_without_its_offset_for_display(tmp_path):
    log, half = flight(BOOTS), 0.5**0.5
    for boot in BOOTS:
        q, offset = (half, half, 0, 0), (half, 0, half, 0)
        log.add(
            mav.MAVLink_attitude_quaternion_message(round(boot * 1e3), *q, 0, 0, 0, offset), boot
        )
    recording = log.read(tmp_path)
    assert_allclose(recording.references["ATTITUDE_QUATERNION"].q[0], [half, half, 0, 0], rtol=1e-6)
    assert any("offset for display" in note.text for note in recording.notes if note.doubt)


def test_values_that_are_not_numbers_are_dropped(tmp_path):
    log = flight(BOOTS).add(attitude(111, roll=float("nan")), 111)
    recording = log.read(tmp_path)
    assert len(recording.references["ATTITUDE"].t) == len(BOOTS)
    assert notes(recording)["ATTITUDE attitude not finite dropped"] == 1


def test_vehicle_is_the_autopilot_not_the_ground_station(tmp_path):
    log = flight(BOOTS).add(heartbeat(), 110)
    log = flight(np.arange(100, 110, 0.05), log, (1, 154)).add(heartbeat(8, 26), 110, (1, 154))
    log.add(heartbeat(8, 6), 110, (255, 190))
    recording = log.read(tmp_path)
    assert recording.details["vehicle"] == "1/1"
    assert [sender["id"] for sender in recording.details["senders"]] == ["1/1", "1/154", "255/190"]


@pytest.mark.parametrize(
    ("uid", "uid2", "told"),
    [
        (7, (*range(1, 13), *[0] * 6), "uid 0102030405060708090a0b0c000000000000"),
        (0xAB00000000000001, (0,) * 18, "uid ab00000000000001"),
        (0, (0,) * 18, None),
    ],
)
def test_the_vehicle_has_the_number_of_its_processor(tmp_path, uid, uid2, told):
    version = mav.MAVLink_autopilot_version_message(
        0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid, uid2
    )
    log = flight(BOOTS).add(heartbeat(), 110).add(version, 110)
    assert log.read(tmp_path).vehicle_id == told
    other = flight(BOOTS).add(heartbeat(), 110).add(version, 110, (1, 154))
    assert other.read(tmp_path).vehicle_id is None


def test_several_vehicles(tmp_path):
    log = flight(BOOTS).add(heartbeat(), 110)
    log = flight(BOOTS[:50], log, (2, 1)).add(heartbeat(), 110, (2, 1))
    recording = log.read(tmp_path)
    assert recording.details["vehicle"] == "1/1"
    note = "another vehicle in the log (2/1): 1/1 was taken, choose with --vehicle"
    assert notes(recording)[note] == 1
    for wanted in ("2", "2/1"):
        recording = log.read(tmp_path, vehicle=wanted)
        assert recording.details["vehicle"] == "2/1"
        assert len(recording.signals["gyro"].t) == 50
    with pytest.raises(ReadError, match=r"no vehicle 3 in the log. Choose one of: 1/1, 2/1."):
        log.read(tmp_path, vehicle="3")
    with pytest.raises(ConfigError, match="vehicle 'x' is no system id"):
        log.read(tmp_path, vehicle="x")


@pytest.mark.parametrize("unit", ["ms", "us"])
def test_the_wrap_of_a_32_bit_clock_is_undone(tmp_path, unit):
    period = 2**32 / (1e3 if unit == "ms" else 1e6)
    log, boots = Log(), period + np.arange(-2, 2, 0.1)
    for boot in boots:
        wrapped = boot % period
        log.add(scaled(wrapped) if unit == "ms" else raw_imu(wrapped), boot)
    recording = log.read(tmp_path)
    assert_allclose(times(recording), boots, atol=1e-3)
    assert recording.restarts == ()


def test_a_reboot_is_placed_by_arrival_and_noted_once(tmp_path):
    log = flight(BOOTS)
    log = flight(np.arange(2, 8, 0.1), log, shift=118.0)  # restarted 10 s after the last sample
    recording = log.read(tmp_path)
    assert_allclose(times(recording), [*BOOTS, *np.arange(120, 126, 0.1)], atol=1e-3)
    assert recording.restarts == (120_000_000_000,)
    assert [note.count for note in recording.notes if "reboot" in note.text] == [1]
    assert notes(recording)["the boot clock fell back by 107.9 s at 20.0 s: taken as a reboot"] == 1


def test_a_reboot_without_stamps_follows_one_period_later(tmp_path):
    log = flight(np.arange(2, 8, 0.1), flight(BOOTS, Log(stamps=False)))
    recording = log.read(tmp_path)
    assert_allclose(times(recording), [*BOOTS, *np.arange(110, 116, 0.1)], atol=1e-3)
    assert recording.clock.utc_offset is None
    assert any("raw stream" in note.text and note.doubt for note in recording.notes)


def test_messages_that_come_late_are_no_reboot(tmp_path):
    order = [*BOOTS[:40], *BOOTS[60:80], *BOOTS[50:53], *BOOTS[80:]]
    recording = flight(order).read(tmp_path)
    assert recording.restarts == ()
    assert_allclose(times(recording), [*BOOTS[:40], *BOOTS[60:]])
    assert [note.count for note in recording.notes if "came late" in note.text] == [1]
    assert notes(recording)["RAW_IMU with a stray time dropped"] == 3


def test_duplicates_and_a_stray_time_are_dropped_and_counted(tmp_path):
    log = flight(BOOTS[:50])
    log.add(raw_imu(BOOTS[49]), 105).add(raw_imu(90_000), 105)
    recording = flight(BOOTS[50:], log).read(tmp_path)
    assert_allclose(times(recording), BOOTS)
    assert recording.restarts == ()
    assert notes(recording)["RAW_IMU with a repeated or earlier time dropped"] == 1
    assert notes(recording)["RAW_IMU with a stray time dropped"] == 1


def test_utc_by_the_receiver_and_by_system_time(tmp_path):
    log = flight(BOOTS)
    recording = log.read(tmp_path)
    assert recording.clock.utc_offset == (UNIX + 20_000) * 1000, "the least latency is left in"
    log.add(mav.MAVLink_system_time_message(UNIX + 103_500_000, 100_000), 110)
    recording = log.read(tmp_path)
    assert recording.clock.name == "autopilot boot clock, UTC by SYSTEM_TIME"
    assert recording.clock.utc_offset == (UNIX + 3_500_000) * 1000


def test_imu_in_utc_and_attitude_since_boot(tmp_path):
    log = Log()
    for boot in BOOTS:
        log.add(raw_imu(UNIX / 1e6 + boot), boot).add(attitude(boot), boot)
        log.add(mav.MAVLink_system_time_message(UNIX + round(boot * 1e6), round(boot * 1e3)), boot)
    recording = log.read(tmp_path)
    assert recording.clock.utc_offset == 0
    difference = recording.references["ATTITUDE"].t - recording.signals["gyro"].t
    assert np.abs(difference).max() < 2_000_000


def test_counts_of_another_autopilot_are_doubted(tmp_path):
    recording = flight(BOOTS).add(heartbeat(autopilot=12), 110).read(tmp_path)
    assert any("raw counts" in note.text for note in recording.notes if note.doubt)


def test_junk_in_front_and_behind(tmp_path):
    log = flight(BOOTS)
    log.data[:0] = np.random.default_rng(1).bytes(5_000)
    log.data += np.random.default_rng(2).bytes(5_000)
    recording = log.read(tmp_path)
    assert recording.format == "tlog"
    assert_allclose(times(recording), BOOTS)
    assert recording.details["bytes_skipped"] == 10_000


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty. Record or copy the log again."),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(range(256)) * 8,
         f"not a log that attest knows ({FORMATS}). Check that it is the file you meant."),
    ],
)  # fmt: skip
def test_files_that_are_no_logs(tmp_path, content, message):
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    with pytest.raises(ReadError) as caught:
        readers.read(path)
    assert str(caught.value) == f"{path}: {message}"


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ReadError) as caught:
        readers.read(tmp_path / "no.tlog")
    assert str(caught.value) == f"{tmp_path / 'no.tlog'}: no such file. Check the path."
    with pytest.raises(ReadError, match="no log in this folder"):
        readers.recognise(tmp_path)


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "held"), [("attitude_only", "ATTITUDE"), ("one_message", "BATTERY_STATUS")]
)
def test_logs_without_inertial_data(shared, name, held):
    path = shared / "tlog" / f"{name}.tlog"
    with pytest.raises(ReadError) as caught:
        readers.read(path)
    assert str(caught.value) == (
        f"{path}: no inertial data: no gyroscope, it holds {held} only. attest needs one of "
        "HIGHRES_IMU, RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3."
    )


@pytest.mark.shared
def test_quadplane(shared):
    recording = readers.read(shared / "tlog" / "quadplane_sitl.tlog")
    assert list(recording.references) == ["SIMSTATE", "ATTITUDE", "AHRS3", "AHRS2"]
    assert len([note for note in recording.notes if "reboot" in note.text]) == 1
    truth, own = recording.references["SIMSTATE"], recording.references["ATTITUDE"]
    q = quaternion.slerp(own.t, own.q, truth.t, 1_000_000_000)
    there = np.isfinite(q[:, 0])
    error = quaternion.log(quaternion.multiply(truth.q[there], quaternion.conjugate(q[there])))
    assert there.mean() > 0.99
    assert np.degrees(np.sqrt(np.mean(np.sum(error**2, axis=1)))) < 0.2
    assert recording.signals["velocity"].source == "LOCAL_POSITION_NED"
    assert 1_533_736_536 < recording.clock.utc_offset / 1e9 < 1_533_736_537


@pytest.mark.shared
@pytest.mark.parametrize("name", ["bluerov2", "bluerov2_bad_crc"])
def test_bluerov(shared, name):
    recording = readers.read(shared / "tlog" / f"{name}.tlog")
    assert recording.details["vehicle"] == "1/1"
    assert list(recording.references) == ["ATTITUDE", "AHRS2"]
    assert recording.restarts == ()
    assert_allclose(np.linalg.norm(recording.signals["accel"].y, axis=1).mean(), 9.8, rtol=0.05)


@pytest.mark.shared
def test_same_log_same_recording(shared):
    path = shared / "tlog" / "quadplane_sitl.tlog"
    one, two = readers.read(path), readers.read(path)
    assert one.notes == two.notes
    assert one.details == two.details
    for name, signal in one.signals.items():
        assert signal.t.tobytes() == two.signals[name].t.tobytes()
        assert signal.y.tobytes() == two.signals[name].y.tobytes()


BASE = bytes(flight(BOOTS[:20]).add(heartbeat(), 102).data)
edits = st.lists(
    st.tuples(st.integers(0, len(BASE) - 1), st.binary(max_size=12), st.integers(0, 12)),
    max_size=12,
)


@settings(max_examples=150)
@given(edits=edits)
def test_mutated_logs_raise_nothing_else(tmp_path_factory, edits):
    data = bytearray(BASE)
    for at, put, cut in edits:
        data[at : at + cut] = put
    check_only_read_errors(tmp_path_factory, bytes(data))


@settings(max_examples=100)
@given(data=st.binary(max_size=2000))
def test_random_bytes_raise_nothing_else(tmp_path_factory, data):
    check_only_read_errors(tmp_path_factory, data)


def wild(draw_bytes):
    """A sound frame with any payload: whatever a field can hold."""
    number, payload = draw_bytes
    body = bytes([len(payload), 0, 0, 0, 1, 1, *number.to_bytes(3, "little")]) + payload
    crc = mav.x25crc(body + bytes([mav.mavlink_map[number].crc_extra])).crc
    return struct.pack(">Q", UNIX) + b"\xfd" + body + struct.pack("<H", crc)


numbers = st.sampled_from(
    [0, 2, 24, 26, 27, 30, 31, 32, 33, 102, 104, 105, 108, 116, 138, 164, 331]
)
frames = st.lists(st.tuples(numbers, st.binary(max_size=60)).map(wild), min_size=1, max_size=30)


@settings(max_examples=150)
@given(frames=frames)
def test_any_field_values_raise_nothing_else(tmp_path_factory, frames):
    check_only_read_errors(tmp_path_factory, b"".join(frames))
    check_only_read_errors(tmp_path_factory, BASE + b"".join(frames) + BASE)


def check_only_read_errors(tmp_path_factory, data):
    path = Path(tmp_path_factory.getbasetemp()) / "wild.tlog"
    path.write_bytes(data)
    message = refusal(path)
    assert message is None or (message.startswith(f"{path}: ") and "\n" not in message)


def refusal(path):
    try:
        readers.read(path)
    except ReadError as error:
        return str(error)


def test_times_that_only_fall_take_time_in_proportion_to_the_log():
    from attest.readers import mavlink_clock as clock
    from attest.readers import mavlink_restarts

    n = 100_000
    t = np.arange(n)[::-1] * clock.SECOND
    index = np.arange(n)
    times = clock.Times(index, t, np.zeros(n, np.int64), index, np.zeros(n, np.bool_))
    assert len(mavlink_restarts.falls({"RAW_IMU": times})) == n - 1  # minutes, were it quadratic


@pytest.mark.parametrize("seed", range(60))
def test_sound_frames_of_senseless_content_are_a_recording_or_one_line(sample_logs, tmp_path, seed):
    """Bytes of payloads are changed and the checksums made right again: no damage to be seen."""
    from pymavlink.generator.mavcrc import x25crc

    rng = np.random.default_rng(seed)
    data = bytearray((sample_logs / "quadcopter.tlog").read_bytes()[:120_000])
    at = 8
    while at + 12 <= len(data) and at + 12 + data[at + 1] <= len(data):
        end = at + 10 + data[at + 1]
        if rng.random() < (0.05, 0.5)[seed % 2] and data[at + 1]:
            # times stand first: their highest bytes do the most
            last = min(end, at + 18) if rng.random() < 0.7 else end
            data[int(rng.integers(at + 10, last))] = int(rng.integers(256))
            number = int.from_bytes(data[at + 7 : at + 10], "little")
            crc = x25crc(bytes(data[at + 1 : end]))
            crc.accumulate(bytes([mav.mavlink_map[number].crc_extra]))
            data[end : end + 2] = crc.crc.to_bytes(2, "little")
        at = end + 2 + 8
    path = tmp_path / "senseless.tlog"
    path.write_bytes(data)
    with suppress(ReadError):  # nothing else may come of it
        assert len(readers.read(path).signals["gyro"].t)


def test_level_and_north_now_and_then_is_an_attitude(tmp_path):
    log = Log()
    for i, boot in enumerate(BOOTS):
        level = mav.MAVLink_attitude_message(
            round(boot * 1e3), *[0.0 if i % 10 else 0.3] * 3, 0, 0, 0
        )
        log.add(raw_imu(boot), boot).add(level, boot)
    assert len(log.read(tmp_path).references["ATTITUDE"].t) == len(BOOTS)


def test_a_loss_of_more_than_a_hundredth_is_a_warning(tmp_path):
    few, many = flight(BOOTS), flight(BOOTS)
    few.add(raw_imu(BOOTS[-1]), 110)
    for _ in range(50):
        many.add(raw_imu(BOOTS[-1]), 110)
    told = [
        next(note for note in log.read(tmp_path).notes if "repeated" in note.text)
        for log in (few, many)
    ]
    assert [(note.count, note.doubt) for note in told] == [(1, False), (50, True)]


def parameter(name, value):
    return mav.MAVLink_param_value_message(name.encode(), value, 9, 100, 1)


def test_the_declination_is_the_last_that_the_vehicle_was_told(tmp_path):
    log = Log()
    log.add(parameter("COMPASS_DEC", 0.1), 100).add(parameter("COMPASS_OFS_X", 7.0), 100)
    flight(BOOTS, log).add(parameter("COMPASS_DEC", 0.5), 110, sender=(2, 1))
    assert log.read(tmp_path).declination == pytest.approx(0.1)
    assert log.add(parameter("COMPASS_DEC", -0.2), 110).read(tmp_path).declination == (
        pytest.approx(-0.2)
    )
    assert log.add(parameter("COMPASS_DEC", 0.0), 110).read(tmp_path).declination is None
