import numpy as np
import pytest
from flights import at, rate, resting, stamps, tumbling
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from strategies import vectors

from attest.evaluation import rates
from attest.geometry import quaternion

SECOND = 1_000_000_000


def offset(attitude, delay, *, rate_hz=50.0, ref_hz=50.0, duration=60.0, noise=0.0, gap=2.0):
    """Return the offset found for a reference whose stamps are late by a delay."""
    t, t_ref = stamps(rate_hz, duration), stamps(ref_hz, duration)
    rng = np.random.default_rng(0)
    speed = np.linalg.norm(rate(attitude, at(t)) + noise * rng.normal(size=(len(t), 3)), axis=1)
    q_ref = quaternion.continuous(attitude(at(t_ref)))
    return rates.time_offset(t, speed, t_ref + round(delay * SECOND), q_ref, gap)


@pytest.mark.parametrize("delay", [-1.3, -0.2, -0.013, 0.0, 0.007, 0.05, 0.45, 1.5])
def test_a_reference_that_is_late_is_found_to_within_five_milliseconds(delay):
    assert offset(tumbling, delay) == pytest.approx(delay, abs=0.005)


@pytest.mark.parametrize(("rate_hz", "ref_hz"), [(200.0, 10.0), (100.0, 4.0), (10.0, 100.0)])
def test_the_offset_is_found_at_other_rates(rate_hz, ref_hz):
    assert offset(tumbling, 0.3, rate_hz=rate_hz, ref_hz=ref_hz) == pytest.approx(0.3, abs=0.01)


def test_the_offset_shows_through_noise():
    assert offset(tumbling, 0.2, noise=0.1) == pytest.approx(0.2, abs=0.02)


def test_at_rest_no_offset_can_be_told():
    assert offset(resting, 0.2) is None
    assert offset(resting, 0.2, noise=0.003) is None
    assert offset(resting, 0.2, noise=1.0) is None


def test_a_short_log_tells_no_offset():
    assert offset(tumbling, 0.2, duration=5.0) is None
    assert offset(tumbling, 0.2, duration=0.1) is None


def test_a_reference_that_shares_no_time_tells_no_offset():
    assert offset(tumbling, 500.0) is None


def test_a_reference_made_of_gaps_tells_no_offset():
    assert offset(tumbling, 0.2, ref_hz=1.0, gap=0.5) is None


@given(vectors(3.0))
def test_rate_between_neighbours_is_the_constant_one(omega):
    t = stamps(100.0, 0.1)
    q = quaternion.exp(at(t)[:, np.newaxis] * omega)
    assert_allclose(rates.angular_velocity(t, q), np.broadcast_to(omega, (9, 3)), atol=1e-9)


@given(vectors(0.5), st.integers(0, 20))
def test_constant_bias_is_what_the_gyroscope_has_over_truth(beta, seed):
    rng = np.random.default_rng(seed)
    t = stamps(50.0, 2.0)
    Omega = rng.normal(size=(100, 3))
    q = [np.array([1.0, 0.0, 0.0, 0.0])]
    for turn in Omega[:-1]:
        q.append(quaternion.multiply(q[-1], quaternion.exp(0.02 * turn)))
    q = np.array(q)
    assert_allclose(rates.constant_bias(t, Omega + beta, q), beta, atol=1e-9)
    q[[3, 40, 41]] = np.nan  # truth may have holes
    assert_allclose(rates.constant_bias(t, Omega + beta, q), beta, atol=1e-9)


def test_truth_without_two_neighbours_tells_no_bias():
    t = stamps(50.0, 0.2)
    q = np.full((10, 4), np.nan)
    assert rates.constant_bias(t, np.zeros((10, 3)), q) is None
    q[::2] = [1.0, 0.0, 0.0, 0.0]
    assert rates.constant_bias(t, np.zeros((10, 3)), q) is None


def test_a_gap_does_not_tell_the_bias():
    """The gyroscope is silent for two seconds of a turn; truth is not."""
    t = np.concatenate([np.arange(0.0, 10.0, 0.02), np.arange(12.0, 20.0, 0.02)])
    stamps = np.round(t * 1e9).astype(np.int64)
    yaw = 2.0 * np.cos(t)
    q = quaternion.from_euler(0.0 * t, 0.0 * t, yaw)
    middle = t + 0.01
    bias = np.array([0.01, 0.02, 0.03])
    gyro = np.stack([0.0 * t, 0.0 * t, -2.0 * np.sin(middle)], axis=1) + bias
    assert_allclose(rates.constant_bias(stamps, gyro, q), bias, atol=1e-4)
