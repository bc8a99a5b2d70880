"""DataFlash messages into a recording: units, instances, clocks, every error."""

import numpy as np
import pytest
from dataflash_logs import Log, flight
from numpy.testing import assert_allclose, assert_array_equal

from attest import readers
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import ReadOptions

TIMES = np.arange(100.0, 110.0, 0.04)


def read(tmp_path, log, name="flight.BIN", **options):
    path = tmp_path / name
    path.write_bytes(log if isinstance(log, bytes) else bytes(log.data))
    return readers.read(path, ReadOptions(**options))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def seconds(recording, name="gyro"):
    return recording.signals[name].t / 1e9


@pytest.mark.parametrize("ending", [b"\n", b"\r\n"])
def test_text_gives_the_same_recording(tmp_path, ending):
    log = flight(TIMES, GPS=(0, 3, 1000, 2200, 47.4, 8.55, 500.0, 5.0, 90.0, -1.0))
    log.add("MSG", 1, "ArduCopter V4.6.0")
    units(log)
    binary = read(tmp_path, log)
    text = read(tmp_path, log.text().replace(b"\n", ending), "flight.log")
    assert text.vehicle == binary.vehicle == "ArduCopter V4.6.0"
    assert text.clock == binary.clock
    for name, signal in binary.signals.items():
        assert_array_equal(text.signals[name].t, signal.t)
        assert_allclose(text.signals[name].y, signal.y, rtol=1e-7)
    assert_allclose(text.references["ATT"].q, binary.references["ATT"].q)


def units(log, **other):
    """Append units of IMU and MAG as ArduPilot 4 does."""
    labels = {"s": "s", "#": "instance", "E": "rad/s", "o": "m/s/s", "G": "Gauss", "k": "deg/s"}
    for unit, label in labels.items():
        log.add("UNIT", 0, ord(unit), label)
    for letter, factor in {"-": 0.0, "0": 1.0, "C": 0.001, "F": 1e-6}.items():
        log.add("MULT", 0, ord(letter), float(np.float32(factor)))
    told = {"IMU": ("s#EEEooo", "F-000000"), "MAG": ("s#GGGGGG-s", "F-CCCCCC-F")} | other
    for name, ids in told.items():
        log.add("FMTU", 0, log.kinds[name][0], *ids)
    return log


@pytest.mark.parametrize("told", [False, True])
def test_units_and_axes(tmp_path, told):
    log = flight(TIMES)
    recording = read(tmp_path, units(log) if told else log)
    assert (recording.format, recording.world, recording.body) == ("dataflash", "ned", "frd")
    assert_allclose(recording.signals["gyro"].y[0], [0.1, 0.2, 0.3], rtol=1e-7)
    assert_allclose(recording.signals["accel"].y[0], [0, 0, -9.8], rtol=1e-7)
    assert_allclose(recording.signals["mag"].y[0], [2e-5, 0, 4e-5], rtol=1e-12)
    assert recording.signals["gyro"].source == "IMU[0]"
    assert_allclose(seconds(recording), TIMES, rtol=0, atol=1e-9)
    euler = quaternion.to_euler(recording.references["ATT"].q[0])
    assert_allclose(np.degrees(euler), [5.73, 0, 11.46], atol=1e-9)
    assert recording.references["ATT"].kind == "autopilot"
    assert "magnetometer as the autopilot corrected it by its own offsets" in notes(recording)


def test_a_log_may_tell_other_units(tmp_path):
    recording = read(tmp_path, units(flight(TIMES), IMU=("s#kkkooo", "F-CCC000")))
    assert_allclose(recording.signals["gyro"].y[0], np.radians([1e-4, 2e-4, 3e-4]), rtol=1e-6)


def test_velocity_and_place_of_a_receiver(tmp_path):
    fix = (0, 3, 1000, 2200, 47.4, 8.55, 500.0, 5.0, 90.0, -1.0)
    recording = read(tmp_path, flight(TIMES, GPS=fix))
    assert_allclose(recording.signals["velocity"].y[0], [0, 5, -1], atol=1e-9)
    assert_allclose(recording.signals["position"].y[0], [47.4, 8.55, 500])
    # week 2200 began on 6 March 2022; 18 leap seconds
    assert recording.clock.utc_offset == pytest.approx((1646524800 + 1 - 18 - 105) * 1e9, abs=6e9)
    # week 1700 began on 5 August 2012; 16 leap seconds
    old = read(tmp_path, flight(TIMES, GPS=(*fix[:3], 1700, *fix[4:])))
    assert old.clock.utc_offset - recording.clock.utc_offset == (-500 * 604800 + 2) * 10**9
    none = read(tmp_path, flight(TIMES, GPS=(0, 1, *fix[2:])))
    assert none.signals.keys() == {"gyro", "accel", "mag"}
    assert none.clock.utc_offset is None


@pytest.mark.parametrize("filtered", [False, True])
def test_velocity_is_taken_while_the_receiver_has_a_good_fix(tmp_path, filtered):
    log = Log()
    log.define("GPA", "QBf", "TimeUS,I,SAcc")
    for t in TIMES:
        status = 3 if t < 107.99 else 1
        log.add("IMU", round(t * 1e6), 0, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8)
        fix = (status, 1000, 2200, 47.4, 8.55, 500.0, 5.0, 90.0, -1.0)
        log.add("GPS", round(t * 1e6), 0, *fix)
        log.add("GPA", round(t * 1e6), 0, 3.0 if t < 101.99 else 0.3)
        if filtered:
            log.add("XKF1", round(t * 1e6), 0, 10.0, -20.0, 30.0, 1.0, 2.0, 3.0)
    recording = read(tmp_path, log)
    source = "XKF1[0]" if filtered else "GPS[0]"
    assert recording.signals["velocity"].source == source
    assert_allclose(seconds(recording, "velocity")[[0, -1]], [102.0, 107.96])
    assert notes(recording)[f"{source} velocity without a 3D fix dropped"] == 50
    assert notes(recording)[f"{source} velocity no better than 2 m/s dropped"] == 50


@pytest.mark.parametrize("value", [np.nan, 1e6])
def test_velocity_is_the_receivers_where_the_filters_cannot_be_used(tmp_path, value):
    fix = (0, 3, 1000, 2200, 47.4, 8.55, 500.0, 5.0, 90.0, -1.0)
    wild = (0, 10.0, -20.0, 30.0, value, value, value)
    recording = read(tmp_path, flight(TIMES, GPS=fix, XKF1=wild))
    assert recording.signals["velocity"].source == "GPS[0]"


def test_velocity_and_references_of_the_filter(tmp_path):
    q = quaternion.from_euler(*np.radians([10.0, -20.0, 30.0]))
    more = {"XKF1": (0, 10.0, -20.0, 30.0, 1.0, 2.0, 3.0), "XKQ": (0, *q), "AHR2": (1.0, 2.0, 3.0),
            "SIM": (10.0, -20.0, 30.0), "POS": (47.4, 8.55, 500.0)}  # fmt: skip
    recording = read(tmp_path, flight(TIMES, **more))
    assert [*recording.references] == ["SIM", "XKQ[0]", "ATT", "AHR2", "XKF1[0]"]
    assert [r.kind for r in recording.references.values()] == ["truth", *["autopilot"] * 4]
    for name in ("SIM", "XKQ[0]", "XKF1[0]"):
        assert_allclose(recording.references[name].q[0], q, atol=1e-6)
    assert_allclose(recording.signals["velocity"].y[0], [1, 2, 3])
    assert recording.signals["position"].source == "POS"


def test_an_instance_can_be_chosen(tmp_path):
    log = Log()
    for t in TIMES:
        for i in range(2):
            log.add("IMU", round(t * 1e6), i, 0.1 * i, 0.0, 0.0, 0.0, 0.0, -9.8)
    assert read(tmp_path, log).signals["gyro"].source == "IMU[0]"
    assert read(tmp_path, log, imu="IMU").signals["gyro"].source == "IMU[0]"
    second = read(tmp_path, log, imu="IMU[1]")
    assert_allclose(second.signals["gyro"].y[:, 0], 0.1, rtol=1e-6)
    with pytest.raises(ReadError) as error:
        read(tmp_path, log, imu="IMU[2]")
    assert str(error.value).endswith(
        "flight.BIN: no IMU[2] to read. The log holds: IMU[0], IMU[1]."
    )


def test_old_logs_number_their_sensors_by_name(tmp_path):
    log = Log()
    chars, columns = "Qffffff", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
    for name in ("IMU", "IMU2"):
        log.define(name, chars, columns)
    for t in TIMES:
        log.add("IMU", round(t * 1e6), 0.1).add("IMU2", round(t * 1e6), 0.2)
    assert read(tmp_path, log).signals["gyro"].source == "IMU"
    assert_allclose(read(tmp_path, log, imu="IMU2").signals["gyro"].y[0, 0], 0.2, rtol=1e-6)


def test_raw_sensors_at_their_own_rate_and_time_are_taken(tmp_path):
    log = Log()
    for i, t in enumerate(np.arange(100.0, 102.0, 0.001)):
        micros = round(t * 1e6)
        log.add("GYR", micros + 300, 0, micros, 0.1).add("ACC", micros + 400, 0, micros, 0, 0, -9.8)
        if i % 20 == 0:
            log.add("IMU", micros, 0, 0.5, 0.0, 0.0, 0.0, 0.0, -9.8)
    recording = read(tmp_path, log)
    gyro, accel = recording.signals["gyro"], recording.signals["accel"]
    assert (gyro.source, accel.source) == ("GYR[0]", "ACC[0]")
    assert_allclose(seconds(recording)[:3], [100.0, 100.001, 100.002], rtol=0, atol=1e-9)
    assert_array_equal(gyro.t, accel.t)


def test_the_magnetometer_has_the_time_of_its_sample(tmp_path):
    log, late = Log(), 2**32 / 1e6  # S has 32 bits and begins anew
    for t in TIMES - TIMES[50] + late:
        micros = round(t * 1e6)
        log.add("IMU", micros)
        log.add("MAG", micros, 0, 1, 2, 3, 0, 0, 0, 1, (micros - 5000) % 2**32)
    mag, gyro = (read(tmp_path, log).signals[name] for name in ("mag", "gyro"))
    assert_array_equal(mag.t, gyro.t - 5_000_000)


def test_unhealthy_magnetometers_are_not_used(tmp_path):
    log = flight(TIMES)
    log.add("MAG", round(110.5e6), 0, 1, 2, 3, 0, 0, 0, 0)
    recording = read(tmp_path, log)
    assert len(recording.signals["mag"].t) == len(TIMES)
    assert notes(recording)["MAG[0] mag without a value dropped"] == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: flight([]).add("MSG", 1, "x"),
            "no IMU or GYR message, so no inertial data. Log IMU.",
        ),
        (Log, "no IMU or GYR message, so no inertial data. Log IMU."),
        (
            lambda: Log().define("IMU", "fff", "GyrX,GyrY,GyrZ").add("IMU", 1.0, 2.0, 3.0),
            "IMU carries no TimeUS. attest cannot use such a log.",
        ),
        (
            lambda: flight([]).add("IMU", 1, 0, np.nan),
            "no sample of IMU[0] can be used. Choose another one.",
        ),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path, make, message):
    with pytest.raises(ReadError) as error:
        read(tmp_path, make())
    assert str(error.value) == f"{tmp_path / 'flight.BIN'}: {message}"


@pytest.mark.parametrize("form", ["flight.BIN", "flight.log"])
@pytest.mark.parametrize(
    ("values", "declination"), [((0.0, 0.0625), 0.0625), ((0.1, -0.25), -0.25), ((0.1, 0.0), None),
                                ((np.nan,), None), ((100.0,), None), ((), None)]
)  # fmt: skip
def test_the_declination_is_the_last_that_the_vehicle_was_told(tmp_path, form, values, declination):
    log = flight(TIMES)
    for value in values:
        log.add("PARM", 1, "COMPASS_DEC", value).add("PARM", 1, "COMPASS_OFS_X", 7.0)
    data = bytes(log.data) if form.endswith("BIN") else log.text()
    assert read(tmp_path, data, form).declination == declination


@pytest.mark.parametrize("form", ["flight.BIN", "flight.log"])
@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"SYSID_THISMAV": 3.0, "BRD_SERIAL_NUM": 1207.0}, "serial 1207"),
        ({"SYSID_THISMAV": 3.0, "BRD_SERIAL_NUM": 0.0}, "system 3"),
        ({"MAV_SYSID": 4.0}, "system 4"),
        ({"BRD_SERIAL_NUM": np.nan, "SYSID_THISMAV": 1e30}, None),
        ({}, None),
    ],
)
def test_the_vehicle_has_the_number_of_its_board_or_its_own(tmp_path, form, values, told):
    log = flight(TIMES)
    for name, value in values.items():
        log.add("PARM", 1, name, value)
    data = bytes(log.data) if form.endswith("BIN") else log.text()
    assert read(tmp_path, data, form).vehicle_id == told


def test_parameters_of_another_form_tell_nothing(tmp_path):
    log = Log()
    log.define("PARM", "QIf", "TimeUS,Name,Value")
    log.add("PARM", 1, 5, 0.1)
    recording = read(tmp_path, flight(TIMES, log))
    assert recording.declination is recording.vehicle_id is None
