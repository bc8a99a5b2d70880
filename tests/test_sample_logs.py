"""One flight in six formats: the same signals and the same estimates, as far as each resolves them.

A tolerance is half a unit of what the format stores, with 0.2 % for the arithmetic on the way:

- tlog: RAW_IMU counts mrad/s, mG of standard gravity and mG of field; positions are 1e-7 degrees
  and mm; velocities and the truth's Euler angles are float32, of at most 20 m/s and pi.
- DataFlash: float32 of rates below 4 rad/s and accelerations below 64 m/s², rounded to 1e-7 before;
  the field counts mG; heights of 512 m are float32.
- ULog: float32 as DataFlash's; the field too, of at most 1 gauss, and positions are float64.
- ROS: float64, rounded to 1e-9, the field to 1e-13 T.
- CSV: exact, but that the field goes through µT.
"""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from attest import pipeline, readers, simulation
from attest.geometry import quaternion
from attest.readers.options import ReadOptions

LOGS = {
    "quadcopter.tlog": "SIMSTATE",
    "quadcopter.BIN": "SIM",
    "quadcopter.ulg": "vehicle_attitude_groundtruth",
    "quadcopter.bag": "/ground_truth/pose",
    "quadcopter_ros2": "/ground_truth/pose",
    "quadcopter.csv": "ref",
}
"""The truth of each, by its name there."""
EXACT_BYTES = ("quadcopter.tlog", "quadcopter.BIN", "quadcopter.ulg")
"""Rounded to numbers that every machine makes; the others hold float64 or depend on a library."""
F32 = 2.0**-24
"""Half a unit of a float32 in its last place, relative to the power of two above."""
ROUNDED = 0.5e-7
"""Before a float32, by the writers."""
RESOLUTION = {
    "quadcopter.tlog": {"gyro": 0.5e-3, "accel": 0.5e-3 * 9.80665, "mag": 0.5e-7,
                        "velocity": 32 * F32 + ROUNDED, "position": (0.5e-7, 0.5e-7, 0.5e-3)},
    "quadcopter.BIN": {"gyro": 4 * F32 + ROUNDED, "accel": 64 * F32 + ROUNDED, "mag": 0.5e-7,
                       "velocity": 32 * F32 + ROUNDED, "position": (0.5e-7, 0.5e-7, 1024 * F32)},
    "quadcopter.ulg": {"gyro": 4 * F32 + ROUNDED, "accel": 64 * F32 + ROUNDED,
                       "mag": (F32 + ROUNDED) * 1e-4, "velocity": 32 * F32 + ROUNDED,
                       "position": (ROUNDED, ROUNDED, 1024 * F32)},
    "quadcopter.bag": {"gyro": 5e-10, "accel": 5e-10, "mag": 5e-14, "velocity": 5e-10,
                       "position": 5e-10},
    "quadcopter.csv": {"gyro": 0.0, "accel": 0.0, "mag": 1e-20, "velocity": 0.0, "position": 0.0},
}  # fmt: skip
RESOLUTION["quadcopter_ros2"] = RESOLUTION["quadcopter.bag"]
TRUTH = {"quadcopter.tlog": 1e-6, "quadcopter.BIN": 1e-6, "quadcopter.ulg": 1e-6,
         "quadcopter.bag": 1e-8, "quadcopter_ros2": 1e-8, "quadcopter.csv": 1e-14}  # fmt: skip
"""Of the attitude matrix: float32 angles up to pi, float32 quaternions, 1e-9."""
ESTIMATES = {
    # a count of 1 mG in a field whose horizontal part is 214 mG turns the heading by up to
    # 0.13°, by 0.08° RMS at one sample; the observer averages over seconds
    "quadcopter.tlog": 0.06,
    "quadcopter.BIN": 0.06,
    # float32: 2e-6 m/s² of 9.8 m/s² is 1e-5°
    "quadcopter.ulg": 2e-5,
    # 1e-9 m/s² of 9.8 m/s² is 6e-9°, and the initial attitude rests on one sample
    "quadcopter.bag": 1e-6,
    "quadcopter_ros2": 1e-6,
    "quadcopter.csv": 1e-9,
}
"""Largest difference of the estimated attitude from that of the unrounded flight, degrees."""
GOLDEN = {
    "quadcopter.tlog": 1.3222,
    "quadcopter.BIN": 1.3214,
    "quadcopter.ulg": 1.3198,
    "quadcopter.bag": 1.3198,
    "quadcopter_ros2": 1.3198,
    "quadcopter.csv": 1.3198,
}
"""Total RMSE, degrees, with the defaults."""
BODY = np.diag([1.0, -1.0, -1.0])
WORLD = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def flight():
    return simulation.simulate("quadcopter")


@pytest.fixture(scope="module")
def run(sample_logs):
    """Return a function that runs each sample log once, with assignments."""
    return cache(
        lambda name, *sets: pipeline.run(sample_logs / name, pipeline.configure("fts", sets))
    )


def signal_in_ned(recording, name):
    y = recording.signals[name].y
    if recording.world == "ned" or name == "position":
        return y
    return y @ (WORLD if name == "velocity" else BODY).T


def matrices_in_ned(recording, q):
    R = quaternion.to_matrix(q)
    return R if recording.world == "ned" else WORLD @ R @ BODY


def angles(R, S):
    """Return the angle between rotations, degrees."""
    chord = np.linalg.norm(R - S, axis=(1, 2)) / np.sqrt(8.0)
    return np.degrees(2.0 * np.arcsin(np.minimum(chord, 1.0)))


def utc(recording, t):
    return t + (recording.clock.utc_offset or 0)


@pytest.mark.parametrize("name", LOGS)
def test_signals_are_the_flights_within_the_formats_resolution(name, flight, sample_logs):
    recording = readers.read(sample_logs / name, ReadOptions())
    assert recording.signals.keys() == flight.signals.keys()
    for signal_name, signal in flight.signals.items():
        t = utc(recording, recording.signals[signal_name].t)
        kept = flight.received(signal.t)
        if (name, signal_name) == ("quadcopter.tlog", "position"):
            kept &= np.arange(len(kept)) % 2 == 0  # GLOBAL_POSITION_INT comes at half the rate
        assert_array_equal(t, signal.t[kept] + flight.utc_offset)
        error = np.abs(signal_in_ned(recording, signal_name) - signal.y[kept])
        allowed = np.array(RESOLUTION[name][signal_name]) * 1.002 + 1e-15 * np.abs(signal.y[kept])
        assert np.all(error <= allowed), (signal_name, error.max(axis=0))


@pytest.mark.parametrize("name", LOGS)
def test_the_truth_is_the_flights(name, flight, sample_logs):
    recording = readers.read(sample_logs / name)
    truth = recording.references[LOGS[name]]
    assert next(iter(recording.references)) == LOGS[name]
    assert truth.kind == "truth"
    t = utc(recording, truth.t) - flight.utc_offset
    rows = np.searchsorted(flight.t, t)
    assert_array_equal(flight.t[rows], t)
    assert len(t) >= flight.received(flight.t).sum()
    expected = quaternion.to_matrix(flight.q[rows])
    assert_allclose(matrices_in_ned(recording, truth.q), expected, rtol=0, atol=TRUTH[name])


@pytest.mark.parametrize("name", LOGS)
def test_estimates_are_the_same_within_the_formats_resolution(name, run):
    exact, other = run("quadcopter.csv"), run(name)
    assert_array_equal(utc(exact.recording, exact.estimates.t),
                       utc(other.recording, other.estimates.t))  # fmt: skip
    R, S = (matrices_in_ned(one.recording, one.estimates.q) for one in (exact, other))
    assert angles(R, S).max() < ESTIMATES[name]


@pytest.mark.parametrize("name", LOGS)
def test_golden_error_of_each_sample(name, run):
    metrics = run(name).metrics
    assert (metrics.reference, metrics.kind) == (LOGS[name], "truth")
    assert metrics.total.rmse == pytest.approx(GOLDEN[name], abs=0.002)


def test_the_readmes_tell_this_error(sample_logs):
    for name in LOGS:
        told = f"a total error of {GOLDEN[name]:.2f}° RMSE in each"
        assert told in (sample_logs / "README.md").read_text(encoding="utf-8")
    shown = f"  RMSE                {GOLDEN['quadcopter.tlog']:.2f}°"
    assert shown in (sample_logs.parent / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", LOGS)
def test_each_sample_is_what_simulate_makes(name, flight, sample_logs, tmp_path):
    simulation.write(tmp_path / name, flight)
    if name in EXACT_BYTES:
        assert (tmp_path / name).read_bytes() == (sample_logs / name).read_bytes()
        return
    made, shipped = (readers.read(folder / name) for folder in (tmp_path, sample_logs))
    assert made.details == shipped.details
    assert made.notes == shipped.notes
    for kind in ("signals", "references"):
        ours, theirs = getattr(made, kind), getattr(shipped, kind)
        assert ours.keys() == theirs.keys()
        for key, one in ours.items():
            values = [x.y if kind == "signals" else x.q for x in (one, theirs[key])]
            assert_array_equal(one.t, theirs[key].t)
            # another machine's last bit may fall to the other side when it is rounded
            assert_allclose(*values, rtol=1e-12, atol=1.1e-13 if key == "mag" else 1.1e-9)


@pytest.mark.parametrize("name", [*LOGS, "quadcopter_truth.csv"])
def test_each_sample_is_below_a_megabyte(name, sample_logs):
    path = sample_logs / name
    files = [path] if path.is_file() else [*path.iterdir()]
    assert sum(file.stat().st_size for file in files) < 1_000_000


def test_the_readme_names_every_sample(sample_logs):
    text = (sample_logs / "README.md").read_text()
    assert {path.name for path in sample_logs.iterdir()} == {
        *LOGS, "README.md", "quadcopter_truth.csv"
    }  # fmt: skip
    assert all(f"`{name}`" in text for name in [*LOGS, "quadcopter_truth.csv"])
