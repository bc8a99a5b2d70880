import dataclasses
import hashlib
import struct
import subprocess
import sys
from collections import Counter
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pymavlink import mavutil

from attest import simulation
from attest.errors import ConfigError, WriteError
from attest.geometry import quaternion
from attest.readers import csv
from attest.readers.options import ReadOptions
from attest.recording import Signal

TRUTH = "quadcopter_truth.csv"


@pytest.fixture(scope="module")
def flight():
    return simulation.simulate("quadcopter")


@pytest.fixture(scope="module")
def tlog(flight, tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "quadcopter.tlog"
    simulation.write(path, flight)
    return path


@pytest.fixture(scope="module")
def messages(tlog):
    with closing(mavutil.mavlogfile(str(tlog))) as log:
        return [*iter(log.recv_match, None)]


def of(messages, kind):
    return [message for message in messages if message.get_type() == kind]


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_pymavlink_reads_every_message(messages):
    counts = Counter((message.get_type(), message.get_srcSystem()) for message in messages)
    assert counts == {
        ("RAW_IMU", 1): 3123,
        ("ATTITUDE", 1): 1561,
        ("SIMSTATE", 1): 1561,
        ("LOCAL_POSITION_NED", 1): 624,
        ("GLOBAL_POSITION_INT", 1): 312,
        ("GPS_RAW_INT", 1): 125,
        ("SYSTEM_TIME", 1): 63,
        ("HEARTBEAT", 1): 63,
        ("HEARTBEAT", 255): 64,
    }


def test_every_frame_is_mavlink_2_behind_a_stamp(tlog):
    data, at, stamps = tlog.read_bytes(), 0, []
    while at < len(data):
        stamps.append(struct.unpack_from(">Q", data, at)[0])
        assert data[at + 8] == 0xFD
        at += 8 + 12 + data[at + 9]
    assert at == len(data)
    assert np.all(np.diff(stamps) >= 0)


def test_simstate_is_the_truth_at_the_attitude_before_it(messages, flight):
    ours = [m for m in messages if m.get_srcSystem() == 1]
    pairs = [(a, b) for a, b in pairwise(ours) if b.get_type() == "SIMSTATE"]
    assert {a.get_type() for a, _ in pairs} == {"ATTITUDE"}
    t = np.array([a.time_boot_ms for a, _ in pairs]) * 10**6
    kept = flight.received(flight.t)
    assert_array_equal(t, flight.t[kept])
    euler = np.array([(b.roll, b.pitch, b.yaw) for _, b in pairs])
    dots = np.sum(quaternion.from_euler(*euler.T) * flight.q[kept], axis=-1)
    assert_allclose(np.abs(dots), 1.0, atol=1e-13)


def test_raw_imu_is_the_signals_within_half_a_count(messages, flight):
    raw = of(messages, "RAW_IMU")
    for name, prefix, unit in (
        ("gyro", "gyro", 1e-3),
        ("accel", "acc", 9.80665e-3),
        ("mag", "mag", 1e-7),
    ):
        signal = flight.signals[name]
        kept = flight.received(signal.t)
        counts = [[getattr(m, axis + prefix) for axis in "xyz"] for m in raw]
        assert_allclose(np.array(counts) * unit, signal.y[kept], rtol=0, atol=0.5001 * unit)
        assert_array_equal(np.array([m.time_usec for m in raw]) * 1000, signal.t[kept])


def test_the_receiver_is_late_and_gets_bursts(messages, flight):
    raw = of(messages, "RAW_IMU")
    sent = np.array([m.time_usec for m in raw]) * 1e-6 + flight.utc_offset * 1e-9
    late = np.array([m._timestamp for m in raw]) - sent
    assert 0.004 < late.min() < 0.01
    assert 0.25 < late.max() < 0.4
    assert np.median(late) < 0.05
    assert np.sum(np.diff(sent) > 1.0) == 1  # the link was lost once
    assert np.diff(sent).max() == pytest.approx(1.5, abs=0.05)


def test_utc_follows_from_system_time(messages, flight):
    for message in of(messages, "SYSTEM_TIME"):
        utc = message.time_boot_ms * 10**6 + flight.utc_offset
        assert message.time_unix_usec * 1000 == utc


# rounding keeps another machine's last bit of sin and cos out of the files, all but certainly
def test_the_same_bytes_again_and_as_shipped(tlog, flight, tmp_path, sample_logs):
    again = tmp_path / "again.tlog"
    simulation.write(again, simulation.simulate("quadcopter", seed=0))
    assert sha256(again) == sha256(tlog) == sha256(sample_logs / "quadcopter.tlog")
    simulation.write_truth(tmp_path / TRUTH, flight)
    assert sha256(tmp_path / TRUTH) == sha256(sample_logs / TRUTH)
    assert {path.name for path in tmp_path.iterdir()} == {"again.tlog", TRUTH}  # nothing partial


def test_the_samples_are_small(sample_logs):
    assert (sample_logs / "quadcopter.tlog").stat().st_size < 1_000_000
    assert (sample_logs / TRUTH).stat().st_size < 1_000_000


WITHOUT_GYRO = {"docking", "rel-4", "rel-4-noise"}


@pytest.mark.parametrize("scenario", simulation.NAMES)
def test_csv_reads_back_as_it_was(scenario, simulated, tmp_path):
    flight = simulated(scenario, seed=0)
    assert ("gyro" in flight.signals) == (scenario not in WITHOUT_GYRO)
    path = tmp_path / "flight.csv"
    simulation.write(path, flight)
    recording = csv.read(path, ReadOptions(world="ned"))
    offset = flight.utc_offset or 0
    known = {**flight.signals, **flight.truth}
    assert recording.signals.keys() == known.keys()
    for name, signal in known.items():
        kept = flight.received(signal.t)
        assert_array_equal(recording.signals[name].t, signal.t[kept] + offset)
        assert_allclose(recording.signals[name].y, signal.y[kept], rtol=1e-15, atol=0)
    assert_array_equal(recording.references["ref"].t, flight.t + offset)
    assert_allclose(recording.references["ref"].q, flight.q, rtol=0, atol=1e-15)


def test_truth_reads_back_to_its_digits(flight, sample_logs):
    recording = csv.read(sample_logs / TRUTH, ReadOptions(world="ned"))
    assert_array_equal(recording.references["ref"].t, flight.t + flight.utc_offset)
    assert_allclose(recording.references["ref"].q, flight.q, rtol=0, atol=2e-9)
    assert_allclose(recording.signals["gyro"].y, flight.omega, rtol=0, atol=1e-9)


def test_what_cannot_be_made_is_one_line(tmp_path, flight):
    with pytest.raises(ConfigError, match=r"^x: unknown scenario\. Choose one of: quadcopter, fix"):
        simulation.simulate("x")
    with pytest.raises(ConfigError, match=r"a\.xyz: unknown format\. Name it with one of: \.tlog"):
        simulation.write(tmp_path / "a.xyz", flight)
    with pytest.raises(ConfigError, match=r"a\.tlog: fts-7\.1 has no accel, mag, position, veloc"):
        simulation.write(tmp_path / "a.tlog", simulation.simulate("fts-7.1"))
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(WriteError, match=r"a\.csv: cannot write: .*Choose another folder"):
        simulation.write(tmp_path / "file" / "a.csv", flight)


@pytest.mark.parametrize("scenario", sorted(WITHOUT_GYRO))
def test_a_flight_without_gyroscope_has_no_gyroscope_columns(scenario, simulated, tmp_path):
    flight = simulated(scenario, seed=0)
    simulation.write(tmp_path / "flight.csv", flight)
    header, *rows = (tmp_path / "flight.csv").read_text().splitlines()
    axes = [f"{name}_{axis}" for name in flight.signals for axis in "xyz"]
    assert header.split(",") == ["time_s", *axes, "ref_qw", "ref_qx", "ref_qy", "ref_qz"]
    assert len(rows) == len(flight.t)


def test_the_truth_has_what_else_is_known(simulated, tmp_path):
    flight = simulated("spacecraft", seed=0)
    simulation.write_truth(tmp_path / "truth.csv", flight)
    recording = csv.read(tmp_path / "truth.csv", ReadOptions(world="ned"))
    assert recording.signals.keys() == {"gyro", "disturbance_torque", "gyro_bias"}
    for name, signal in flight.truth.items():
        assert_array_equal(recording.signals[name].t, signal.t)
        assert_allclose(recording.signals[name].y, signal.y, rtol=0, atol=1e-9)


def test_every_kind_of_column_reads_back(tmp_path):
    t = np.arange(1, 9, dtype=np.int64) * 10**9
    names = ("gyro", "accel", "mag", "velocity", "torque", "point1", "point2", "sun", "my_sensor")
    rng = np.random.default_rng(0)
    signals = {
        name: Signal(t[k % 3 :: 2], rng.normal(size=(len(t[k % 3 :: 2]), 3)))
        for k, name in enumerate(names)
    }
    signals["position"] = Signal(t[3:5], np.array([[47.4, 8.55, 500.0], [-90.0, -180.0, -1.0]]))
    flight = dataclasses.replace(simulation.simulate("fts-7.1"), signals=signals)
    simulation.write(tmp_path / "all.csv", flight)
    recording = csv.read(tmp_path / "all.csv", ReadOptions(world="ned"))
    assert recording.signals.keys() == signals.keys()
    assert recording.references.keys() == {"ref"}
    for name, signal in signals.items():
        assert_array_equal(recording.signals[name].t, signal.t)
        assert_allclose(recording.signals[name].y, signal.y, rtol=1e-15, atol=0)


@pytest.mark.parametrize("scenario", simulation.NAMES)
def test_the_same_seed_makes_the_same_bytes(scenario, simulated, tmp_path):
    simulation.write(tmp_path / "a.csv", simulated(scenario, seed=0))
    simulation.write(tmp_path / "b.csv", simulation.simulate(scenario, seed=0))
    assert sha256(tmp_path / "a.csv") == sha256(tmp_path / "b.csv")


def test_naming_the_scenarios_imports_nothing_heavy():
    code = "import sys, attest.simulation as s; s.NAMES; sys.exit('numpy' in sys.modules)"
    root = Path(simulation.__file__).parents[2]
    subprocess.run([sys.executable, "-c", code], check=True, cwd=root)
