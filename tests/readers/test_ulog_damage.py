"""ULogs that are damaged or hostile."""

import struct
from contextlib import suppress

import numpy as np
import pytest
from ulog_logs import Log, flight

from attest import readers, simulation
from attest.errors import ReadError
from attest.readers import ulog_format, ulog_frames, ulog_tables, ulog_topics
from attest.simulation import ulog

TIMES = np.arange(100.0, 104.0, 0.004)


def read(tmp_path, log):
    path = tmp_path / "flight.ulg"
    path.write_bytes(bytes(getattr(log, "data", log)))
    return readers.read(path)


def notes(recording):
    return {note.text: note.count for note in recording.notes}


@pytest.fixture(scope="module")
def simulated():
    return ulog.encode(simulation.simulate("quadcopter"))


def rows(data):
    """Rows of each topic as comparable things."""
    sound = ulog_frames.sound(data, ulog_topics.WANTED)
    found = ulog_tables.streams(data, sound, ulog_tables.definitions(None, sound))
    return {
        name: {tuple(row) for row in zip(*(c.tolist() for c in one.data.values()), strict=True)}
        for name, (one,) in found.items()
    }


def damaged(data, kind, rng, times):
    """Damage a log behind its definitions."""
    data = bytearray(data)
    for at in sorted(rng.integers(3_000, len(data) - 200, times), reverse=True):
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
def test_damage_costs_what_it_hit(simulated, kind, seed):
    whole = rows(simulated)
    found = rows(damaged(simulated, kind, np.random.default_rng(seed), 100))
    total = sum(map(len, whole.values()))
    kept = sum(len(whole[name] & found[name]) for name in whole)
    wrong = sum(len(found[name] - whole[name]) for name in found)
    hit = {"flips": 2, "cuts": 9, "insertions": 3, "zeros": 5}[kind]
    assert total - kept <= 100 * hit
    assert wrong <= 100


def test_a_truncated_log_gives_what_is_there(tmp_path):
    log = flight(TIMES)
    size = len(log.data)
    log.add("sensor_combined", 104.0, 1.0)
    for left in range(1, len(log.data) - size):
        recording = read(tmp_path, bytes(log.data[: size + left]))
        assert len(recording.signals["gyro"].t) == len(TIMES)
        assert notes(recording)["the log ends within a message: left out"] == 1


def test_junk_between_messages_is_skipped_and_counted(tmp_path):
    log = flight(TIMES[:500])
    log.data += b"\xee" * 777
    recording = read(tmp_path, flight(TIMES[500:], log))
    assert len(recording.signals["gyro"].t) == len(TIMES)
    assert notes(recording)["stretches without a message skipped, 777 bytes"] == 1


def test_a_size_that_leads_far_away_costs_one_message(tmp_path):
    log = flight(TIMES[:500])
    for kind in "DFIMPQLCAB":
        log.data += struct.pack("<HB", 0xFFF0, ord(kind))
    recording = read(tmp_path, flight(TIMES[500:], log))
    assert len(recording.signals["gyro"].t) == len(TIMES)


def test_data_of_topics_without_a_name_is_counted(tmp_path):
    log = flight(TIMES)
    for _ in range(3):
        log.raw("D", struct.pack("<HQ", 999, 1))
    log.raw("S", ulog_frames.SYNC)
    recording = read(tmp_path, log)
    assert notes(recording)["data of topics that the log does not name skipped"] == 3


FORMATS = {
    "itself": [b"sensor_combined:uint64_t timestamp;sensor_combined[9] x;"],
    "each other": [b"a:b x;", b"b:a x;", b"sensor_combined:uint64_t timestamp;a x;"],
    "exponential": [
        *(f"f{i}:f{i + 1} a;f{i + 1} b;".encode() for i in range(40)),
        b"f40:uint8_t x;",
        b"sensor_combined:uint64_t timestamp;f0 x;",
    ],
    "longer than a message": [b"sensor_combined:uint64_t timestamp;uint8_t[65535] x;"],
    "unknown type": [b"sensor_combined:uint64_t timestamp;quaternion q;"],
    "no time": [b"sensor_combined:float[3] gyro_rad;"],
    "short time": [b"sensor_combined:uint32_t timestamp;float[3] gyro_rad;"],
    "one name twice": [b"sensor_combined:uint64_t timestamp;float a;float a;"],
    "too many fields": [b"sensor_combined:uint64_t timestamp;uint8_t[60000] x;"],
}


@pytest.mark.parametrize("formats", FORMATS.values(), ids=FORMATS.keys())
def test_formats_that_cannot_be_are_refused(tmp_path, formats):
    hostile = Log()
    for form in formats:
        hostile.raw("F", form)
    hostile.raw("A", struct.pack("<BH", 0, 0) + b"sensor_combined")
    hostile.raw("D", struct.pack("<HQ", 0, 1) + bytes(100))
    with pytest.raises(ReadError, match="no inertial topic"):
        read(tmp_path, hostile)
    sound = ulog_frames.sound(bytes(hostile.data), ulog_topics.WANTED)
    assert sound.refused == ("sensor_combined",)


def test_what_is_refused_is_told(tmp_path):
    log = flight(TIMES).raw("F", b"sensor_mag:uint64_t timestamp;sensor_mag x;")
    log.raw("A", struct.pack("<BH", 0, 77) + b"sensor_mag")
    recording = read(tmp_path, log)
    assert notes(recording)["sensor_mag described so that it cannot be read: not used"] == 1


def test_subscriptions_are_held_to_a_budget():
    catalogue = ulog_format.Catalogue()
    ulog_format.define(catalogue, b"sensor_mag:uint64_t timestamp;uint8_t[1900] x;")
    for number in range(1000):
        name = struct.pack("<BH", 0, number) + b"sensor_mag"
        ulog_format.subscribe(catalogue, name, {"sensor_mag"})
    assert len(catalogue.subscribed) == ulog_format.BUDGET // 1901
    assert catalogue.refused == {"sensor_mag"}


def test_the_library_says_nothing_on_stdout(tmp_path, capsys):
    log = flight(TIMES).raw("I", b"\x05a b c").raw("P", b"\xff").raw("I", b"\x10char[3] sys_name")
    read(tmp_path, damaged(log.data, "flips", np.random.default_rng(1), 50))
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("seed", range(20))
def test_no_damage_is_more_than_an_error(tmp_path, simulated, seed):
    rng = np.random.default_rng(seed)
    data = bytearray(simulated[:60_000])
    for _ in range(int(rng.integers(1, 100))):
        at = int(rng.integers(0, len(data) if seed % 2 else 2_500))
        data[at : at + int(rng.integers(0, 20))] = rng.bytes(int(rng.integers(0, 20)))
    data[:7] = ulog_frames.MAGIC
    with suppress(ReadError):
        assert len(read(tmp_path, bytes(data)).signals["gyro"].t)
