"""What the tests of the observers that solve each step anew share."""

from dataclasses import replace

import numpy as np
import observing
from flights import angle_deg, samples
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import IDENTITY
from strategies import frames, rotations

from attest import config
from attest.geometry import quaternion

HIDDEN = [(vector, 100, 200) for vector in range(3)]
"""All vectors of `carried`, for a while."""


@st.composite
def noisy(draw, least=2, most=5, n=3):
    """Draw n steps of some vectors, each of another attitude and with noise of some degrees."""
    E = draw(frames(draw(st.integers(least, most))))
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    U = observing.seen(np.array([draw(rotations) for _ in range(n)]), E)
    U += 0.05 * rng.normal(size=U.shape)
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    return observing.sampled(rng.normal(size=(n, 3)), U, E), E


def carried(n, hidden):
    """Return samples of a constant turn, some vectors hidden between two steps, and the truth."""
    gyro = np.tile([0.3, -0.2, 0.5], (n, 1))  # a mean over a step is exact
    q = observing.truth(quaternion.exp(np.array([0.5, -0.2, 0.8])), gyro)
    valid = np.ones((n, 3), np.bool_)
    for vector, first, last in hidden:
        valid[first:last, vector] = False
    return observing.sampled(gyro, observing.seen(q, np.eye(3)), np.eye(3), valid=valid), q


def assert_carried_by_the_gyroscope(observer, settings):
    """Where no vector is valid the gyroscope is all there is."""
    made, q = carried(300, HIDDEN)
    assert angle_deg(observer.estimate(made, settings).q, q).max() < 1e-6
    bent = made.gyro.copy()
    bent[100:200] = [0.0, 1.0, 0.0]
    found = observer.estimate(replace(made, gyro=bent), settings)
    expected = quaternion.multiply(found.q[101], quaternion.exp(np.array([0.0, 0.98, 0.0])))
    assert angle_deg(found.q[199], expected) < 1e-6
    assert angle_deg(found.q[200:], q[200:]).max() < 1e-6


def assert_one_vector_is_fitted(observer, settings):
    """Where one vector is valid it is fitted, and the gyroscope carries the turn about it."""
    made, q = carried(300, HIDDEN[:2])
    assert angle_deg(observer.estimate(made, settings).q, q).max() < 1e-6
    off = made.gyro.copy()
    off[100:200] += [0.0, 0.0, 0.4]
    off[100:200] += 0.3 * made.body[100:200, 2]
    found = observer.estimate(replace(made, gyro=off), settings)
    third = quaternion.rotate(found.q, made.body[:, 2])
    assert_allclose(third, np.broadcast_to([0.0, 0.0, 1.0], (300, 3)), atol=1e-9)
    assert angle_deg(found.q[199], q[199]) > 5.0


def assert_takes_off_a_known_bias(observer, settings):
    """A known bias is taken off the gyroscope."""
    made, q = carried(300, HIDDEN)
    beta = (0.1, -0.2, 0.05)
    chosen = settings.model_copy(update={"initial": config.Initial(bias=beta)})
    found = observer.estimate(replace(made, gyro=made.gyro + beta), chosen)
    assert angle_deg(found.q, q).max() < 1e-6
    assert_allclose(found.angular_velocity, made.gyro, atol=1e-12)


def assert_finds_a_half_turn(observer, settings, axis):
    """A half turn about an axis is found at once."""
    q = quaternion.exp(np.pi * np.eye(3)[axis])
    U = observing.seen(np.tile(q, (3, 1)), np.eye(3))
    made = observing.sampled(np.zeros((3, 3)), U, np.eye(3))
    found = observer.estimate(made, observing.starting(settings, IDENTITY))
    assert angle_deg(found.q, q).max() < 1e-9


def assert_steps_need_length(observer, settings):
    """Steps of a nanosecond change nothing."""
    made, q = carried(3, [(i, 1, 3) for i in range(3)])
    found = observer.estimate(replace(made, t=np.arange(3)), settings)
    assert angle_deg(found.q, q[0]).max() < 1e-6


def assert_integrates(observer, settings):
    """Without any vector in the log it is the gyroscope."""
    made, q = carried(100, [])
    empty = samples(made.t, made.gyro, np.empty((100, 0, 3)), np.empty((1, 0, 3)))
    found = observer.estimate(empty, observing.starting(settings, q[0]))
    assert angle_deg(found.q, q).max() < 1e-6
