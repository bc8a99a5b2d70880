"""DataFlash messages into a recording: equality with pymavlink, units, clocks, every error."""

from collections import defaultdict
from contextlib import closing

import numpy as np
import pytest
from dataflash_logs import Log, flight
from numpy.testing import assert_allclose, assert_array_equal
from pymavlink import DFReader

from attest import readers, simulation
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.readers import ReadOptions, dataflash_scan, dataflash_text
from attest.simulation import dataflash

TIMES = np.arange(100.0, 110.0, 0.04)


def read(tmp_path, log, name="flight.BIN", **options):
    path = tmp_path / name
    path.write_bytes(log if isinstance(log, bytes) else bytes(log.data))
    return readers.read(path, ReadOptions(**options))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def seconds(recording, name="gyro"):
    return recording.signals[name].t / 1e9


def expected(path, kind):
    """What pymavlink reads: by message, the columns and all values."""
    found = defaultdict(list)
    with closing(kind(str(path))) as log:
        while (message := log.recv_msg()) is not None:
            found[message.get_type()].append(message)
    return found


def assert_equal(tables, messages, names):
    assert names
    for name in names:
        table, theirs = tables[name], messages[name]
        assert len(table) == len(theirs), name
        for column, values in table.columns.items():
            if values.ndim > 1:
                continue
            told = [getattr(message, column) for message in theirs]
            if values.dtype.kind == "S":
                assert [value.decode("latin-1") for value in values] == told, (name, column)
            else:
                assert_array_equal(values.astype(float), np.array(told, float), f"{name}.{column}")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    path = tmp_path_factory.mktemp("dataflash") / "quadcopter.BIN"
    path.write_bytes(dataflash.encode(simulation.simulate("quadcopter")))
    return path


def test_every_message_is_as_pymavlink_reads_it(simulated):
    messages = expected(simulated, DFReader.DFReader_binary)
    scan = dataflash_scan.scan(simulated, set(messages))
    assert scan.counts == {name: len(found) for name, found in messages.items()}
    assert_equal(scan.tables, messages, set(messages))


@pytest.mark.shared
@pytest.mark.parametrize("name", ["bluerov2.BIN", "plane_truncated.BIN"])
def test_recorded_logs_are_as_pymavlink_reads_them(shared, name):
    path = shared / "dataflash" / name
    messages = expected(path, DFReader.DFReader_binary)
    messages.pop("FMT")  # of which pymavlink gives some again
    messages.pop("MODE")  # which it names
    scan = dataflash_scan.scan(path, set(messages))
    assert {key: scan.counts[key] for key in messages} == {k: len(v) for k, v in messages.items()}
    assert_equal(scan.tables, messages, set(messages))


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "rates", "references"),
    [
        (
            "bluerov2",
            {"gyro": (594, 25.0), "accel": (594, 25.0), "mag": (237, 10.0), "velocity": (237, 10.0)},
            ["XKQ[0]", "ATT", "AHR2", "XKF1[0]"],
        ),
        (
            "plane_truncated",
            {"gyro": (45, 49.9), "accel": (45, 49.9), "mag": (8, 10.0), "velocity": (24, 24.9),
             "position": (23, 24.8)},
            ["NKQ1", "NKQ2", "ATT", "AHR2", "NKF1"],
        ),
    ],
)  # fmt: skip
def test_recorded_logs(shared, name, rates, references):
    recording = readers.read(shared / "dataflash" / f"{name}.BIN")
    rhythm = {key: (len(s.t), pytest.approx(1e9 / np.median(np.diff(s.t)), rel=0.01))
              for key, s in recording.signals.items()}  # fmt: skip
    assert rates == rhythm
    assert [*recording.references] == references
    assert {r.kind for r in recording.references.values()} == {"autopilot"}
    down = np.mean(recording.signals["accel"].y[:, 2])
    assert -10.5 < down < -9.0


@pytest.mark.parametrize("chars", ["bBghHiIf", "dcCeELqQ"])
def test_every_character_of_a_format_is_as_pymavlink_reads_it(tmp_path, chars):
    rng, log, path = np.random.default_rng(1), Log(), tmp_path / "all.BIN"
    columns = ",".join(["TimeUS", *(f"F{char}" for char in chars), "n", "N", "Z"])
    log.define("ALL", "Q" + chars + "nNZ", columns)
    limits = {"b": 2**7, "B": 2**8, "h": 2**15, "H": 2**16, "i": 2**31, "I": 2**32, "q": 2**62,
              "Q": 2**62, "c": 300, "C": 600, "e": 2e7, "E": 4e7, "L": 200}  # fmt: skip
    for i in range(200):
        values = [rng.normal() if c in "gfd" else int(rng.integers(0, limits[c])) for c in chars]
        log.add("ALL", 10_000 * i, *values, "abcd", "a name", "a text")
    path.write_bytes(log.data)
    messages = expected(path, DFReader.DFReader_binary)
    assert_equal(dataflash_scan.scan(path, {"ALL"}).tables, messages, {"ALL"})


def test_text_is_as_pymavlink_reads_it(tmp_path):
    path = tmp_path / "flight.log"
    path.write_bytes(flight(TIMES, XKQ=(0, 1.0, 0.0, 0.0, 0.0)).add("MSG", 1, "a b").text())
    messages = expected(path, DFReader.DFReader_text)
    names = {"IMU", "MAG", "ATT", "XKQ"}
    assert_equal(dataflash_text.scan(path, names).tables, messages, names)


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
    none = read(tmp_path, flight(TIMES, GPS=(0, 1, *fix[2:])))
    assert none.signals.keys() == {"gyro", "accel", "mag"}
    assert none.clock.utc_offset is None


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


def test_simulated_log_has_what_the_flight_had(simulated):
    flown, recording = simulation.simulate("quadcopter"), readers.read(simulated)
    heard = flown.received(flown.t)
    assert_array_equal(recording.references["SIM"].t, flown.t[heard])
    off = np.abs(np.einsum("ij,ij->i", recording.references["SIM"].q, flown.q[heard]))
    assert_allclose(off, 1.0, atol=1e-6)
    gyro = flown.signals["gyro"]
    assert_allclose(recording.signals["gyro"].y, gyro.y[flown.received(gyro.t)], atol=1e-6)
    assert recording.clock.utc_offset == pytest.approx(flown.utc_offset, abs=2e6)
    assert recording.vehicle == "ArduCopter V4.6.0 (simulated)"


def test_a_flight_without_sensors_has_no_log():
    with pytest.raises(ConfigError) as error:
        dataflash.encode(simulation.simulate("fts-7.1"))
    assert str(error.value).endswith("for a .BIN. Write a .csv instead.")
