import numpy as np
import pytest

from attest.conditioning.rest import SHORTEST
from attest.conditioning.rested import rested
from attest.geometry import quaternion

RATE = 100.0
RNG = np.random.default_rng(4)
NONE = np.empty((0, 3))
FIELD = np.array([20e-6, 2e-6, 40e-6])
UP = np.array([0.0, 0.0, 9.8])


def still(seconds, gyro=(0.0, 0.0, 0.0), accel=UP, noise=(2e-3, 0.05)):
    n = round(seconds * RATE)
    return (
        np.array(gyro) + noise[0] * RNG.normal(size=(n, 3)),
        np.array(accel) + noise[1] * RNG.normal(size=(n, 3)),
    )


def moving(seconds):
    t = np.arange(round(seconds * RATE)) / RATE
    wave = np.sin(2.0 * np.pi * np.outer(t, [0.7, 1.1, 0.4]))
    return 0.8 * wave, UP + 3.0 * wave[:, ::-1]


def found(*parts, restart=()):
    gyro, accel = (np.concatenate(values) for values in zip(*parts, strict=True))
    first = np.zeros(len(gyro), bool)
    first[[0, *restart]] = True
    h = np.where(first, 0.0, 1.0 / RATE)
    return rested(h, gyro, accel, first, NONE)


def test_rest_is_known_once_it_has_lasted():
    marks = found(moving(5.0), still(5.0), moving(5.0))
    begins = np.flatnonzero(marks)[0] / RATE
    assert 5.0 + 1e-9 * SHORTEST < begins < 6.5 + 1e-9 * SHORTEST
    assert marks[900:1000].all()
    assert not marks[1010:].any()


def test_what_comes_later_changes_nothing():
    parts = (moving(2.0), still(4.0), moving(3.0), still(3.0))
    whole = found(*parts)
    assert (whole[:600] == found(*parts[:2])).all()


def test_a_bias_is_no_motion_and_a_steady_turn_is():
    assert found(still(5.0, gyro=(0.02, -0.02, 0.01)))[-100:].all()
    assert not found(still(5.0, gyro=(0.0, 0.0, 0.2))).any()


@pytest.mark.parametrize("rate", [0.5, 3.0])
def test_a_swing_is_no_rest(rate):
    t = np.arange(1000) / RATE
    swing = np.outer(np.sin(2.0 * np.pi * rate * t), [0.1, 0.0, 0.0])
    assert not found((swing, np.tile(UP, (1000, 1)))).any()


def test_a_restart_begins_anew():
    marks = found(still(6.0), restart=[300])
    assert marks[299]
    assert not marks[300:440].any()
    assert marks[-1]


def test_what_is_no_number_is_no_rest_and_is_forgotten():
    gyro, accel = still(8.0)
    gyro[300] = np.nan
    marks = found((gyro, accel))
    assert marks[299]
    assert not marks[300:440].any()
    assert marks[-1]


def test_an_empty_log_has_no_rest():
    assert len(rested(np.zeros(0), NONE, NONE, np.zeros(0, bool), NONE)) == 0


def turning(rate, turned, noise=2e-7, seconds=8.0):
    """Return whether rest is found of a gyroscope that says a rate, where the body turns or not."""
    n = round(seconds * RATE)
    gyro, _ = still(seconds, gyro=rate)
    angle = np.outer(np.arange(n) / RATE, rate) if turned else np.zeros((n, 3))
    back = quaternion.conjugate(quaternion.exp(angle))
    accel, mag = (quaternion.rotate(back, np.tile(v, (n, 1))) for v in (UP, FIELD))
    accel, mag = accel + 0.05 * RNG.normal(size=(n, 3)), mag + noise * RNG.normal(size=(n, 3))
    h = np.where(np.arange(n) == 0, 0.0, 1.0 / RATE)
    return rested(h, gyro, accel, h == 0.0, mag)


@pytest.mark.parametrize("rate", [(0.0873, 0.0, 0.0), (0.0, 0.0, 0.0873), (0.2, -0.1, 0.2)])
def test_a_large_bias_is_told_by_directions_that_stay(rate):
    assert turning(rate, turned=False)[-300:].all()
    assert not turning(rate, turned=True).any()


def test_a_magnetometer_that_is_stuck_tells_no_rest():
    assert not turning((0.0, 0.0, 0.0873), turned=False, noise=0.0).any()


def test_a_turn_that_no_sensor_has_is_no_bias():
    assert not turning((0.0, 0.0, 0.5), turned=False).any()
