import numpy as np
import pytest

from attest.conditioning.rest import SHORTEST
from attest.conditioning.rested import rested

RATE = 100.0
RNG = np.random.default_rng(4)
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
    return rested(h, gyro, accel, first)


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
    assert len(rested(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool))) == 0
