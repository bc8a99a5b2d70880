"""DataFlash logs that are damaged, hostile or of several boots."""

import struct
from contextlib import suppress

import numpy as np
import pytest
from dataflash_logs import Log, flight
from numpy.testing import assert_allclose, assert_array_equal

from attest import readers, simulation
from attest.errors import ReadError
from attest.readers import ReadOptions, dataflash_scan
from attest.simulation import dataflash

TIMES = np.arange(100.0, 110.0, 0.04)


def read(tmp_path, log, name="flight.BIN", **options):
    path = tmp_path / name
    path.write_bytes(bytes(getattr(log, "data", log)))
    return readers.read(path, ReadOptions(**options))


def notes(recording):
    return {note.text: note.count for note in recording.notes}


def seconds(recording, name="gyro"):
    return recording.signals[name].t / 1e9


@pytest.fixture(scope="module")
def simulated():
    return dataflash.encode(simulation.simulate("quadcopter"))


def scan(tmp_path, data):
    path = tmp_path / "damaged.BIN"
    path.write_bytes(data)
    return dataflash_scan.scan(path, {"IMU", "MAG", "ATT", "XKQ", "SIM", "POS", "GPS"})


def rows(found):
    """Messages as comparable things."""
    return {
        name: {tuple(row) for row in zip(*(c.tolist() for c in t.columns.values()), strict=True)}
        for name, t in found.tables.items()
    }


def damaged(data, kind, rng, times):
    """Damage a log behind its definitions."""
    data = bytearray(data)
    for at in sorted(rng.integers(6_000, len(data) - 200, times), reverse=True):
        if kind == "flips":
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == "cuts":
            del data[at : at + int(rng.integers(1, 200))]
        elif kind == "insertions":
            data[at:at] = rng.bytes(int(rng.integers(1, 200)))
        else:
            data[at : at + 64] = bytes(64)
    return bytes(data)


@pytest.mark.parametrize("kind", ["flips", "cuts", "insertions", "zeros"])
@pytest.mark.parametrize("seed", range(3))
def test_damage_costs_what_it_hit(tmp_path, simulated, kind, seed):
    whole = rows(scan(tmp_path, simulated))
    found = rows(scan(tmp_path, damaged(simulated, kind, np.random.default_rng(seed), 100)))
    total = sum(map(len, whole.values()))
    kept = sum(len(whole[name] & found[name]) for name in whole)
    wrong = sum(len(found[name] - whole[name]) for name in found)
    hit = {"flips": 1, "cuts": 7, "insertions": 1, "zeros": 4}[kind]
    assert total - kept <= 100 * hit
    assert wrong <= {"flips": 100, "zeros": 100}.get(kind, 10), "a flip within cannot be told"


def test_what_lies_before_a_broken_header_is_known_by_its_time(tmp_path):
    log = flight(TIMES[:50])
    at = len(log.data)
    flight(TIMES[50:], log)
    log.data[at] ^= 0xFF  # of an IMU; the ATT before it has no header behind it
    recording = read(tmp_path, log)
    assert len(recording.signals["gyro"].t) == len(TIMES) - 1
    assert len(recording.references["ATT"].t) == len(TIMES)
    (text,) = (text for text in notes(recording) if "without a message" in text)
    assert text == "stretches without a message skipped, 36 bytes"


@pytest.mark.parametrize("left", [1, 2, 3, 20, 34])
def test_a_cut_message_at_the_end_is_left_out(tmp_path, left):
    log = flight(TIMES)
    size = len(log.data)
    log.add("IMU", 110_000_000)
    recording = read(tmp_path, bytes(log.data[: size + left]))
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert notes(recording)["the log ends within a message: left out"] == 1


def test_absurd_times_are_dropped_and_counted(tmp_path):
    log = flight(TIMES[:100])
    log.add("IMU", 2**63).add("IMU", 90 * 10**6).add("IMU", 200_000 * 10**6)
    recording = read(tmp_path, flight(TIMES[100:], log))
    assert_allclose(seconds(recording), TIMES, rtol=0, atol=1e-9)
    told = notes(recording)
    assert told["IMU[0] without a usable time dropped"] == 1
    assert told["IMU[0] with a stray time dropped"] == 2
    assert recording.restarts == ()


def test_a_boot_behind_another_goes_on_one_sample_later(tmp_path):
    log = flight(np.arange(5.0, 10.0, 0.04), flight(TIMES))
    recording = read(tmp_path, log)
    t = seconds(recording)
    assert len(t) == 375
    assert_allclose(t[250] - t[249], 0.04, atol=1e-9)
    assert recording.restarts == (recording.signals["gyro"].t[250],)
    (text,) = (text for text in notes(recording) if "reboot" in text)
    assert text == "the boot clock fell back by 105.0 s at 10.0 s: taken as a reboot"


def test_a_boot_that_knows_utc_goes_on_where_it_belongs(tmp_path):
    log = Log()
    for start, unix in ((100.0, 0), (5.0, 60)):
        for i in range(125):
            t = start + 0.04 * i
            log.add("IMU", round(t * 1e6), 0, 0.1)
            if i % 25 == 0:
                milliseconds = round((unix + 0.04 * i) * 1e3)
                log.add("GPS", round(t * 1e6), 0, 3, milliseconds, 2200, 47.4, 8.5, 500.0)
    recording = read(tmp_path, log)
    t = seconds(recording)
    assert_allclose(t[125] - t[0], 60.0, atol=1e-6)
    assert len(recording.restarts) == 1


def test_a_format_may_change_between_boots(tmp_path):
    log = flight(TIMES)
    log.define("IMU", "QBfffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T")
    for t in TIMES + 10:
        log.add("IMU", round(t * 1e6), 0, 0.4, 0, 0, 0, 0, -9.8, 30.0)
    gyro = read(tmp_path, log).signals["gyro"]
    assert len(gyro.t) == 2 * len(TIMES)
    assert_allclose(gyro.y[[0, -1], 0], [0.1, 0.4], rtol=1e-6)


def test_a_format_that_contradicts_its_length_is_told(tmp_path):
    log = flight(TIMES)
    log.define("XKQ", "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4", length=40)
    body = struct.pack("<QB4f", 1, 0, 1, 0, 0, 0).ljust(37, b"\0")
    log.data += bytes([0xA3, 0x95, log.kinds["XKQ"][0]]) + body
    assert notes(read(tmp_path, log))["XKQ whose format does not fit its length: not used"] == 1


@pytest.mark.parametrize("junk", [b"\0" * 300, b"\xff" * 300, bytes(range(256))])
def test_a_log_behind_junk_is_recognised(tmp_path, junk):
    recording = read(tmp_path, junk + bytes(flight(TIMES).data))
    assert len(recording.signals["gyro"].t) == len(TIMES)


def test_instances_that_hardly_occur_are_damage(tmp_path):
    log = flight(TIMES, XKQ=(0, 1.0, 0.0, 0.0, 0.0))
    log.add("XKQ", 110_000_000, 77, 1.0, 0.0, 0.0, 0.0)
    recording = read(tmp_path, log)
    assert [*recording.references] == ["XKQ[0]", "ATT"]
    assert notes(recording)["XKQ of instances that hardly occur dropped"] == 1


def test_values_that_no_sensor_measures_are_dropped(tmp_path):
    log = flight(TIMES).add("IMU", 110_000_000, 0, 1e6).add("IMU", 110_040_000, 0, np.inf)
    recording = read(tmp_path, log)
    assert len(recording.signals["gyro"].t) == len(TIMES)
    told = notes(recording)
    assert told["IMU[0] gyro beyond what a sensor measures dropped"] == 1
    assert told["IMU[0] gyro not finite dropped"] == 1


@pytest.mark.parametrize(
    "junk",
    [
        b"\xa3\x95" * 200_000,
        b"\xa3\x95\x80" * 200_000,
        b"\xa3\x95\x81" * 200_000,
        b"\xa3\x95\x80\x82\x03TINYB" * 50_000,
    ],
    ids=["marks", "definitions", "messages", "tiny"],
)
def test_headers_without_end_do_not_hide_the_log(tmp_path, junk):
    log = flight(TIMES[:125])
    data = bytes(log.data) + junk + bytes(flight(TIMES[125:]).data)
    found = scan(tmp_path, data).tables["ATT"].columns["TimeUS"]
    assert np.isin(np.round(TIMES * 1e6), found).sum() >= len(TIMES) - 2


@pytest.mark.parametrize("seed", range(20))
def test_no_damage_is_more_than_an_error(tmp_path, simulated, seed):
    rng = np.random.default_rng(seed)
    data = bytearray(simulated[:60_000])
    for _ in range(int(rng.integers(1, 100))):
        at = int(rng.integers(0, len(data) if seed % 2 else 4_000))
        data[at : at + int(rng.integers(0, 20))] = rng.bytes(int(rng.integers(0, 20)))
    with suppress(ReadError):
        assert len(read(tmp_path, bytes(data)).signals["gyro"].t)


def test_text_lines_that_are_none_are_skipped(tmp_path):
    text = flight(TIMES).text()
    lines = text.split(b"\n")
    far = b"IMU, 99999999999999999999999, 0, 1, 1, 1, 1, 1, 1"
    broken = [b"IMU, 1, 0", b"IMU, x, 0, 1, 1, 1, 1, 1, 1", b"no message", far]
    lines[100:100] = broken
    recording = read(tmp_path, b"\n".join(lines), "flight.log")
    whole = read(tmp_path, text, "whole.log")
    assert_array_equal(recording.signals["gyro"].y, whole.signals["gyro"].y)
    assert any("without a message skipped" in text for text in notes(recording))


def test_text_of_many_names_is_sorted_all_the_same(tmp_path):
    lines = flight(TIMES).text().split(b"\n")
    lines[50:50] = [b"%d, 1" % i for i in range(2000)]
    recording = read(tmp_path, b"\n".join(lines), "flight.log")
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert recording.details["messages"]["IMU"] == len(TIMES)
    assert recording.details["bytes_skipped"] == 0


def test_a_text_longer_than_any_takes_no_room_for_each(tmp_path):
    log = flight(TIMES).add("MSG", 1, "x" * 100_000)
    for i in range(2000):
        log.add("MSG", i, "y")
    recording = read(tmp_path, log.text(), "flight.log")
    assert recording.details["messages"]["MSG"] == 2000
    assert recording.details["bytes_skipped"] == len(" 1, " + "x" * 100_000 + "\n")


def test_numbers_of_text_may_be_none(tmp_path):
    text = flight(TIMES).text() + b"IMU, 110000000, 0, nan, 1, 1, 1, 1, 1\n"
    recording = read(tmp_path, text, "flight.log")
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert notes(recording)["IMU[0] gyro not finite dropped"] == 1


@pytest.mark.parametrize("value", ["+-5", "--5", "-", "", "99999999999999999999", "5x"])
def test_lines_with_what_is_no_whole_number_are_skipped(tmp_path, value):
    text = flight(TIMES).text() + f"MAG, 110000000, 0, {value}, 1, 1, 1, 1, 1, 1, 1, 1\n".encode()
    text += f"IMU, 110000000, {value}, 1, 1, 1, 1, 1, 1\n".encode()
    recording = read(tmp_path, text, "flight.log")
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert any("without a message skipped" in each for each in notes(recording))
