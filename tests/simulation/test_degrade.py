import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from attest import simulation
from attest.errors import ConfigError
from attest.readers import csv
from attest.readers.options import ReadOptions
from attest.recording import Signal
from attest.simulation.degrade import Degradation, add_bias, add_noise, degrade, drop, resample

QUADCOPTER = simulation.simulate("quadcopter")
EXPERIMENT = simulation.simulate("fts-7.1")


def with_signal(t, y):
    signal = Signal(np.asarray(t, np.int64), np.asarray(y, float))
    return dataclasses.replace(EXPERIMENT, signals={"gyro": signal})


def test_nothing_to_do_changes_nothing():
    flight = degrade(QUADCOPTER, Degradation())
    for name, signal in QUADCOPTER.signals.items():
        assert_array_equal(flight.signals[name].t, signal.t)
        assert_array_equal(flight.signals[name].y, signal.y)
    assert flight.outages == QUADCOPTER.outages
    assert flight.constants == QUADCOPTER.constants


@pytest.mark.parametrize("rate", [1.0, 7.3, 20.0, 49.0, 50.0])
def test_a_lower_rate_picks_samples_as_they_are(rate):
    flight = resample(QUADCOPTER, "gyro", rate)
    before, after = QUADCOPTER.signals["gyro"], flight.signals["gyro"]
    at = np.searchsorted(before.t, after.t)
    assert_array_equal(before.t[at], after.t)
    assert_array_equal(before.y[at], after.y)
    assert len(after.t) == pytest.approx(64.0 * rate, rel=0.03)
    assert_array_equal(flight.signals["accel"].t, QUADCOPTER.signals["accel"].t)


def test_a_higher_rate_draws_lines_but_none_across_a_gap():
    t = np.array([0, 10, 20, 30, 130, 140]) * 10**6
    flight = resample(with_signal(t, np.outer(t, [1e-6, 0.0, -2e-6])), "gyro", 200.0)
    signal = flight.signals["gyro"]
    assert_array_equal(signal.t / 1e6, [0, 5, 10, 15, 20, 25, 30, 130, 135, 140])
    assert_allclose(signal.y, np.outer(signal.t, [1e-6, 0.0, -2e-6]), atol=1e-12)


@settings(max_examples=30)
@given(st.floats(0.5, 500.0), st.lists(st.integers(1, 10**9), min_size=1, max_size=30))
def test_any_rate_of_any_clock_is_a_clock(rate, steps):
    t = np.cumsum(steps)
    signal = resample(with_signal(t, np.ones((len(t), 3))), "gyro", rate).signals["gyro"]
    assert len(signal.t) >= 1
    assert signal.t[0] >= t[0]
    assert signal.t[-1] <= t[-1]
    assert_allclose(signal.y, 1.0)


def test_bias_is_added_to_signal_and_truth(simulated):
    flight = add_bias(QUADCOPTER, "gyro", (0.1, 0.0, -0.2))
    assert_allclose(
        flight.signals["gyro"].y - QUADCOPTER.signals["gyro"].y,
        [[0.1, 0.0, -0.2]] * 3199,
        atol=1e-15,
    )
    assert_allclose(
        flight.constants["gyro_bias"], np.add(QUADCOPTER.constants["gyro_bias"], [0.1, 0.0, -0.2])
    )
    assert add_bias(EXPERIMENT, "v1", (1.0, 2.0, 3.0)).constants["v1_bias"] == (1.0, 2.0, 3.0)
    spacecraft = simulated("spacecraft", seed=0)
    drift = add_bias(spacecraft, "gyro", (0.1, 0.0, 0.0)).truth["gyro_bias"].y
    assert_allclose(
        drift - spacecraft.truth["gyro_bias"].y, [[0.1, 0.0, 0.0]] * len(drift), atol=1e-15
    )


def test_noise_has_its_deviation_and_its_own_stream():
    flight = degrade(QUADCOPTER, Degradation(noise={"mag": 2e-7, "gyro": 0.1}))
    for name, std in (("mag", 2e-7), ("gyro", 0.1)):
        added = flight.signals[name].y - QUADCOPTER.signals[name].y
        assert_allclose(added.std(axis=0), std, rtol=0.05)
        alone = add_noise(QUADCOPTER, name, std)
        assert_array_equal(alone.signals[name].y, flight.signals[name].y)
    other = add_noise(dataclasses.replace(QUADCOPTER, seed=1), "gyro", 0.1)
    assert not np.array_equal(other.signals["gyro"].y, flight.signals["gyro"].y)


def test_quantum_comes_after_noise():
    flight = degrade(QUADCOPTER, Degradation(noise={"accel": 1.0}, quantum={"accel": 0.25}))
    counts = flight.signals["accel"].y / 0.25
    assert_array_equal(counts, np.rint(counts))


def test_a_share_is_lost_and_what_has_one_clock_is_lost_together():
    flight = drop(QUADCOPTER, 0.3)
    signals = flight.signals
    for name in ("accel", "mag"):
        assert_array_equal(signals["gyro"].t, signals[name].t)
    assert_array_equal(signals["position"].t, signals["velocity"].t)
    assert len(signals["gyro"].t) == pytest.approx(0.7 * 3199, rel=0.05)
    assert len(drop(QUADCOPTER, 0.999999).signals["position"].t) >= 1
    assert_array_equal(flight.t, QUADCOPTER.t)


def test_nothing_is_received_in_a_gap(tmp_path):
    flight = degrade(QUADCOPTER, Degradation(gaps=((10.0, 15.0), (20.0, 20.5))))
    simulation.write(tmp_path / "f.csv", flight)
    recording = csv.read(tmp_path / "f.csv", ReadOptions(world="ned"))
    first = min(signal.t[0] for signal in QUADCOPTER.signals.values()) + QUADCOPTER.utc_offset
    for signal in recording.signals.values():
        s = (signal.t - first) * 1e-9
        assert not np.any((s >= 10.0) & (s < 15.0) | (s >= 20.0) & (s < 20.5))
        assert np.any((s > 15.0) & (s < 16.0))
    assert len(recording.references["ref"].t) == len(QUADCOPTER.t)


def test_a_signal_jumps_sticks_and_falls_silent_for_a_while():
    how = Degradation(
        jump={"velocity": ((10.0, 11.0, (30.0, 0.0, -2.0)),)},
        stuck={"velocity": ((20.0, 22.0),)},
        silent={"velocity": ((30.0, 35.0), (40.0, 41.0))},
    )
    before, after = QUADCOPTER.signals["velocity"], degrade(QUADCOPTER, how).signals["velocity"]
    first = min(signal.t[0] for signal in QUADCOPTER.signals.values())
    s, was = (after.t - first) * 1e-9, before.y[np.isin(before.t, after.t)]
    off = (after.y - was)[(s < 20.0) | (s >= 22.0)]
    during = ((s >= 10.0) & (s < 11.0))[(s < 20.0) | (s >= 22.0)]
    assert_allclose(off, np.outer(during, [30.0, 0.0, -2.0]), atol=1e-9)
    held = after.y[(s >= 20.0) & (s < 22.0)]
    assert_array_equal(held, np.broadcast_to(after.y[s < 20.0][-1], held.shape))
    assert len(held) > 5
    assert not np.any((s >= 30.0) & (s < 35.0) | (s >= 40.0) & (s < 41.0))
    assert np.isin(after.t, before.t).all()


def test_a_tlog_takes_what_keeps_its_messages_whole(tmp_path):
    whole = Degradation(
        rate=dict.fromkeys(("gyro", "accel", "mag"), 20.0), drop=0.1, gaps=((5, 6),)
    )
    simulation.write(tmp_path / "f.tlog", degrade(QUADCOPTER, whole))
    assert (tmp_path / "f.tlog").stat().st_size < 500_000
    torn = degrade(QUADCOPTER, Degradation(rate={"gyro": 20.0}))
    with pytest.raises(ConfigError, match=r"f2\.tlog: gyro and accel have not the same times"):
        simulation.write(tmp_path / "f2.tlog", torn)


@pytest.mark.parametrize("scenario", simulation.NAMES)
def test_every_scenario_can_be_degraded_and_is_the_same_again(scenario, simulated, tmp_path):
    flight = simulated(scenario, seed=0)
    name = next(iter(flight.signals))
    how = Degradation(
        rate={name: 9.0},
        bias={name: (0.1, 0.2, 0.3)},
        noise={name: 0.01},
        quantum={name: 1e-3},
        drop=0.05,
        gaps=((1.0, 2.0),),
    )
    for path in (tmp_path / "a.csv", tmp_path / "b.csv"):
        simulation.write(path, degrade(flight, how))
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


@pytest.mark.parametrize(
    ("how", "message"),
    [
        (
            {"rate": {"magg": 5.0}},
            r"rate magg: fts-7\.1 has no such signal\. It has: gyro, v1, v2, v3\.",
        ),
        ({"rate": {"gyro": 0.0}}, r"rate gyro=0: out of range\. Give Hz above 0, up to 10000\."),
        ({"rate": {"gyro": float("nan")}}, r"rate gyro=nan: out of range"),
        ({"rate": {"gyro": 1e9}}, r"rate gyro=1e\+09: out of range"),
        ({"noise": {"gyro": -1.0}}, r"noise gyro=-1: out of range\. Give 1e-12 to 1e12\."),
        ({"quantum": {"gyro": float("inf")}}, r"quantum gyro=inf: out of range"),
        ({"bias": {"gyro": (1.0,)}}, r"bias gyro=1: not usable\. Give 3 numbers up to 1e12\."),
        ({"bias": {"v1": (1.0, float("nan"), 0.0)}}, r"bias v1=1,nan,0: not usable"),
        ({"jump": {"v1": ((5.0, 4.0, (0, 0, 0)),)}}, r"jump v1=5:4: not a span"),
        ({"jump": {"v1": ((4.0, 5.0, (1,)),)}}, r"jump v1=1: not usable\. Give 3 numbers"),
        ({"stuck": {"v1": ((-1.0, 4.0),)}}, r"stuck v1=-1:4: not a span"),
        ({"silent": {"v9": ((1.0, 4.0),)}}, r"silent v9: fts-7\.1 has no such signal"),
        ({"drop": 1.0}, r"drop 1: out of range\. Give a share from 0 to below 1\."),
        ({"drop": float("nan")}, r"drop nan: out of range"),
        ({"gaps": ((5.0, 4.0),)}, r"gap 5:4: not a span\. Give seconds, the lower first\."),
        ({"gaps": ((0.0, float("inf")),)}, r"gap 0:inf: not a span"),
    ],
)
def test_what_cannot_be_done_is_one_line(how, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        degrade(EXPERIMENT, Degradation(**how))
