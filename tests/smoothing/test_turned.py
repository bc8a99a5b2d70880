import numpy as np
import pytest
from flights import FIELD, at, body, rate, stamps, tumbling

from attest.conditioning import frame
from attest.geometry import quaternion
from attest.smoothing.turned import turns

T = stamps(100.0, 60.0)
H = np.concatenate([[0.0], np.diff(T) * 1e-9])
NO = np.arange(len(T)) == 0
NONE = np.empty((0, 3))
D = frame.integrate(T, rate(tumbling, at(T) + 0.005))


def direction(y):
    """Scale to unit length."""
    return y / np.linalg.norm(y, axis=-1, keepdims=True)


def test_a_direction_that_turns_against_the_gyroscope_is_seen_and_one_that_the_body_turns_is_not():
    y = direction(body(tumbling, at(T), FIELD))
    seen = np.ones(len(T), bool)
    assert turns(H, D, (y, NONE), seen, NO, 5.0)[1].max() < 1e-3
    half = np.deg2rad(25.0)
    elsewhere = quaternion.rotate(np.array([np.cos(half), 0.0, 0.0, np.sin(half)]), FIELD)
    y = np.where((at(T) > 30.0)[:, np.newaxis], direction(body(tumbling, at(T), elsewhere)), y)
    ends, angles = turns(H, D, (y, NONE), seen, NO, 5.0)
    expected = np.arccos(direction(elsewhere) @ direction(FIELD))
    assert angles.max() == pytest.approx(expected, abs=0.01)
    assert at(T)[ends[np.argmax(angles)]] == pytest.approx(35.0, abs=0.1)
    assert turns(H, D, (y, NONE), seen & (at(T) < 30.0), NO, 5.0)[1].max() < 1e-3
