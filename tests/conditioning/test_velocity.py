"""A velocity that cannot be, and none at all for a while, on simulated flights."""

from dataclasses import replace

import numpy as np
import pytest
from flights import Turning, at, recording
from numpy.testing import assert_allclose, assert_array_equal

from attest import simulation
from attest.conditioning import velocity
from attest.conditioning.condition import condition
from attest.geometry import quaternion
from attest.observers import fts, smoother
from attest.recording import Signal
from attest.simulation.degrade import Degradation, degrade

G = np.array([0.0, 0.0, 9.80665])
START, END = 26.0, 36.0
"""Of the faults, s."""
FAULTS = {
    "spike": Degradation(jump={"velocity": ((START, START + 0.15, (30.0, -20.0, 5.0)),)}),
    "jump": Degradation(jump={"velocity": ((START, START + 3.0, (25.0, 0.0, 0.0)),)}),
    "stuck": Degradation(stuck={"velocity": ((START, END),)}),
    "outage": Degradation(silent={"velocity": ((START, START + 5.0),)}),
    "long outage": Degradation(silent={"velocity": ((START, END),)}),
}


@pytest.fixture(scope="module")
def quadcopter():
    return simulation.simulate("quadcopter")


def log_of(flight):
    truth = ("TRUTH", "truth", flight.t, quaternion.continuous(flight.q))
    return recording(dict(flight.signals), references=[truth])


def with_velocity(flight, y, every=1):
    signal = flight.signals["velocity"]
    signal = replace(signal, t=signal.t[::every], y=y[::every])
    return replace(flight, signals={**flight.signals, "velocity": signal})


def tilt_deg(flight, observer=fts):
    """Return the RMS error of the vertical once it has settled, and what was said."""
    log, config = log_of(flight), observer.Config()
    samples, notes = condition(log, config)
    estimates = observer.estimate(samples, config)
    q = quaternion.slerp(flight.t, flight.q, np.clip(estimates.t, flight.t[0], flight.t[-1]), 2**62)
    moved = quaternion.rotate(quaternion.conjugate(q), G / G[2])
    seen = quaternion.rotate(quaternion.conjugate(estimates.q), G / G[2])
    error = np.arccos(np.clip(np.sum(seen * moved, axis=1), -1.0, 1.0))
    settled = (estimates.t - estimates.t[0]) > 10 * 10**9
    return np.rad2deg(np.sqrt(np.mean(error[settled] ** 2))), {n.text: n.count for n in notes}


def test_without_a_velocity_the_error_is_many_times_as_large(quadcopter):
    signals = {name: s for name, s in quadcopter.signals.items() if name != "velocity"}
    assert tilt_deg(replace(quadcopter, signals=signals))[0] > 6.0
    assert tilt_deg(quadcopter)[0] < 1.0


@pytest.mark.parametrize(
    ("fault", "factor", "what"),
    [
        ("spike", 1.1, "velocity that stands alone between gaps or jumps: left out"),
        ("jump", 1.1, "jump of the velocity: no acceleration is taken across it"),
        ("stuck", 4.0, "velocity that stands still while the vehicle does not: left out"),
        ("outage", 1.5, "gap of over 2 s of the velocity: no acceleration is taken across it"),
        ("long outage", 3.0, "gap of over 2 s of the velocity: no acceleration is taken across it"),
    ],
)
def test_a_fault_of_the_velocity_does_not_ruin_the_attitude(quadcopter, fault, factor, what):
    sound, _ = tilt_deg(quadcopter)
    error, notes = tilt_deg(degrade(quadcopter, FAULTS[fault]))
    assert error < factor * sound
    assert what in notes
    assert any("velocity, +0.1" in text and "% of the steps" in text for text in notes)


@pytest.mark.parametrize(
    ("acceleration", "why"),
    [
        (12.0, "whose acceleration the accelerometer contradicts"),
        (20.0, "that stands alone between gaps or jumps"),
    ],
)
def test_a_velocity_that_runs_away_and_comes_back_is_left_out(quadcopter, acceleration, why):
    signal = quadcopter.signals["velocity"]
    s = (signal.t - signal.t[0]) * 1e-9
    away = np.clip(np.minimum(s - START, START + 4.0 - s), 0.0, 1.5) * acceleration
    sound, _ = tilt_deg(quadcopter)
    error, notes = tilt_deg(with_velocity(quadcopter, signal.y + np.outer(away, [1.0, 0.0, 0.0])))
    assert error < 1.5 * sound
    assert notes[f"velocity {why}: left out"] > 20


@pytest.mark.parametrize("share", [0.02, 0.06])
@pytest.mark.parametrize("size", [3.0, 10.0, 30.0])
def test_spikes_here_and_there_tilt_the_vertical_little(quadcopter, share, size):
    y, rng = quadcopter.signals["velocity"].y.copy(), np.random.default_rng(1)
    here = rng.random(len(y)) < share
    y[here] += size * np.array([0.6, 0.8, 0.0])
    assert tilt_deg(with_velocity(quadcopter, y))[0] < 1.5


@pytest.mark.parametrize("times", [2, 5, 8, 10])
def test_a_velocity_that_is_held_between_its_values_is_as_good_as_those(quadcopter, times):
    y = quadcopter.signals["velocity"].y
    held, notes = tilt_deg(with_velocity(quadcopter, y[np.arange(len(y)) // times * times]))
    assert held < 1.0
    assert not [text for text in notes if "contradicts" in text or "alone" in text]


def test_an_accelerometer_that_is_there_while_no_gyroscope_is_is_doubted(quadcopter):
    accel = quadcopter.signals["accel"]
    early = accel.t < accel.t[0] + 5 * 10**9
    signals = {**quadcopter.signals, "accel": replace(accel, t=accel.t[early], y=accel.y[early])}
    log, config = log_of(replace(quadcopter, signals=signals)), fts.Config(input={"start_s": 20.0})
    _, notes = condition(log, config)
    assert "it has no two samples while the gyroscope has" in " ".join(n.text for n in notes)


@pytest.mark.parametrize("every", [1, 2, 5])
@pytest.mark.parametrize("kind", ["step", "spike"])
@pytest.mark.parametrize("size", [2.0, 3.0, 5.0, 8.0, 20.0])
def test_no_jump_of_metres_per_second_tilts_the_vertical(quadcopter, every, kind, size):
    signal = quadcopter.signals["velocity"]
    sound, _ = tilt_deg(with_velocity(quadcopter, signal.y, every))
    s = (signal.t - signal.t[0]) * 1e-9
    here = int(np.searchsorted(s, START)) // every * every
    y = signal.y.copy()
    y[here : None if kind == "step" else here + 1] += np.array([0.6, 0.8, 0.0]) * size
    error, notes = tilt_deg(with_velocity(quadcopter, y, every))
    assert error < 1.1 * sound
    assert any("jump" in text for text in notes)


@pytest.mark.parametrize("fault", ["jump", "outage"])
def test_the_smoother_bears_the_same_faults(quadcopter, fault):
    sound, _ = tilt_deg(quadcopter, smoother)
    error, _ = tilt_deg(degrade(quadcopter, FAULTS[fault]), smoother)
    assert error < 1.2 * sound


def test_a_velocity_of_zero_in_turns_is_left_out():
    log = Turning(period=20.0).log(60.0)
    y, s = log.signals["velocity"].y.copy(), at(log.signals["velocity"].t)
    y[(s > 20.0) & (s < 28.0)] = 0.0
    signal = replace(log.signals["velocity"], y=y)
    samples, notes = condition(
        replace(log, signals={**log.signals, "velocity": signal}), fts.Config()
    )
    told = {note.text: note.count for note in notes}
    assert told["velocity that stands still while the vehicle does not: left out"] > 30
    leaning = np.abs(samples.inertial[:, 0, :2]).max(axis=1) > 1e-9
    felt = quaternion.rotate(log.references["TRUTH"].q, samples.body[:, 0])
    assert_allclose(felt[leaning], samples.inertial[leaning, 0], atol=0.03)
    gap = (at(samples.t) > 21.0) & (at(samples.t) < 27.0)
    assert not leaning[gap].any()


def test_at_rest_a_velocity_of_zero_stays():
    t = np.arange(0, 20 * 10**9, 10**8)
    pair = paired(t, np.zeros((200, 3)))
    signal, notes = velocity.unstuck(Signal(t, np.zeros((200, 3)), "GPS"), pair)
    assert len(signal.t) == 200
    assert notes == []


def paired(t, v, turn=(1.0, 0.0, 0.0, 0.0)):
    """Return a velocity beside an accelerometer that feels just that, in another frame."""
    falling = v - np.outer(t * 1e-9, G)
    return velocity.Compared(t, falling, quaternion.rotate(np.array(turn), falling))


def test_what_both_feel_is_the_same_for_lines_at_any_stamps():
    rng = np.random.default_rng(3)
    t = np.sort(rng.choice(np.arange(20_000), 150, replace=False)) * 10**6
    v = rng.normal(size=(150, 3)).cumsum(axis=0)
    pair = paired(t, v, quaternion.from_euler(0.3, -0.2, 2.0))
    when = np.arange(0, 20 * 10**9, 10**7)
    a, f = velocity.slopes(when, pair, np.zeros(149, np.bool_), 0.5)
    known = np.isfinite(a).all(axis=1)
    turned = quaternion.rotate(quaternion.from_euler(0.3, -0.2, 2.0), a[known])
    assert known.mean() > 0.9
    assert_allclose(f[known], turned, atol=1e-8)


def test_nothing_is_differenced_across_a_break_and_it_ends_soon_behind_one():
    t = np.concatenate([np.arange(0, 50), np.arange(100, 150)]) * 10**8
    v = np.where(t[:, np.newaxis] < 8 * 10**9, [1.0, 0.0, 0.0], [60.0, 0.0, 0.0])
    pair = paired(t, v)
    gaps, jumps = velocity.breaks(pair)
    assert_array_equal(np.flatnonzero(gaps), [49])
    assert not jumps.any()
    when = np.arange(0, 15 * 10**9, 10**7)
    a, _ = velocity.slopes(when, pair, gaps, 0.5)
    known = np.isfinite(a).all(axis=1)
    assert_allclose(a[known], np.broadcast_to(-G, (known.sum(), 3)), atol=1e-9)
    s = when * 1e-9
    assert not known[(s > 5.5) & (s < 9.4)].any()
    assert known[(s < 5.3) | (s > 9.6)].all()


def test_without_a_sample_there_is_no_slope():
    none = velocity.Compared(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    pair, broken, notes = velocity.sound(none, 0.5)
    a, f = velocity.slopes(np.arange(5), pair, broken, 0.5)
    assert np.isnan(a).all()
    assert np.isnan(f).all()
    assert notes == []
