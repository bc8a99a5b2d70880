import numpy as np
import pytest
from numpy.testing import assert_array_equal

from attest.conditioning.rest import rest, unturned
from attest.geometry import quaternion

SECOND = 1_000_000_000
G = np.array([0.0, 0.0, -9.81])


def log(rate=100.0, duration=20.0, seed=0):
    """Return stamps, gyroscope and accelerometer of a noisy sensor on a table."""
    rng = np.random.default_rng(seed)
    n = round(rate * duration)
    t = np.round(np.arange(n) / rate * SECOND).astype(np.int64)
    return t, 0.005 + rng.normal(0.0, 0.003, (n, 3)), G + rng.normal(0.0, 0.03, (n, 3))


@pytest.mark.parametrize("rate", [2.0, 25.0, 1000.0])
def test_a_sensor_on_a_table_is_at_rest_at_any_rate(rate):
    assert rest(*log(rate)).all()


def test_motion_ends_rest_with_a_margin_before_and_after():
    t, gyro, accel = log()
    gyro[1000:1200, 1] += np.sin(np.arange(200) / 20.0)
    found = rest(t, gyro, accel)
    assert found[:900].all()
    assert found[1300:].all()
    assert not found[980:1220].any()


def test_a_push_without_a_turn_is_no_rest():
    t, gyro, accel = log()
    accel[1000:1200, 0] += 3.0 * np.sin(np.arange(200) / 20.0)
    assert not rest(t, gyro, accel)[980:1220].any()


def test_a_turn_that_is_faster_than_any_bias_is_no_rest():
    t, gyro, accel = log()
    gyro[:, 2] += 0.1
    assert not rest(t, gyro, accel).any()


def test_a_short_pause_is_no_rest():
    t, gyro, accel = log()
    gyro[:, 2] += np.sin(2.0 * np.pi * np.arange(len(t)) / 200.0)
    gyro[1000:1120] = 0.005
    assert not rest(t, gyro, accel).any()


def test_a_gap_and_values_that_are_not_finite_end_a_rest():
    t, gyro, accel = log()
    t[1000:] += 60 * SECOND
    accel[500] = np.nan
    found = rest(t, gyro, accel)
    assert not found[[480, 500, 520, 990, 1010]].any()
    assert found[[0, 250, 750, 1500, -1]].all()


def test_it_does_not_care_how_the_sensors_sit_in_the_body():
    t, gyro, accel = log()
    gyro[1000:1200] += 1.0
    assert_array_equal(rest(t, gyro[:, [2, 0, 1]], accel[:, [2, 0, 1]]), rest(t, gyro, accel))


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_a_log_of_no_length_has_no_rest(n):
    assert_array_equal(rest(*(y[:n] for y in log())), np.zeros(n, np.bool_))


def test_nothing_but_values_that_are_not_finite_is_no_rest():
    t, gyro, accel = log()
    assert not rest(t, gyro * np.nan, accel).any()


@pytest.mark.parametrize(("turn", "still"), [(0.0, True), (0.01, False), (0.04, False)])
def test_a_slow_steady_turn_is_no_rest_to_a_magnetometer(turn, still):
    t, gyro, accel = log(duration=60.0)
    gyro += [-0.005, -0.005, turn - 0.005 + 0.008 * still]  # or a bias of the same size
    rested = rest(t, gyro, accel)
    assert rested.all()
    rng = np.random.default_rng(1)
    q = quaternion.exp(np.array([0.0, 0.0, -turn]) * (t * 1e-9)[:, np.newaxis])
    field = quaternion.rotate(q, np.array([0.4, 0.0, 0.9])) + rng.normal(0.0, 0.01, (len(t), 3))
    seen = np.stack([accel / 9.81, field], axis=1)
    valid = np.ones((len(t), 2), np.bool_)
    found = unturned(t, rested, gyro, seen, valid)
    assert found.all() if still else not found.any()
    assert unturned(t, rested, gyro, seen, valid & [True, False]).mean() > 0.3
