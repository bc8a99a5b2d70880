import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.simulation import trajectory

T = np.linspace(0.0, trajectory.DURATION, 20_001)
times = st.floats(0.0, trajectory.DURATION).map(lambda t: np.array([t]))


@given(times)
def test_velocity_and_acceleration_are_derivatives(t):
    h = 1e-4
    p_before, v_before, _ = trajectory.kinematics(t - h)
    p_after, v_after, _ = trajectory.kinematics(t + h)
    _, v, a = trajectory.kinematics(t)
    assert_allclose((p_after - p_before) / (2 * h), v, atol=1e-6)
    assert_allclose((v_after - v_before) / (2 * h), a, atol=1e-6)


@given(times)
def test_angular_velocity_turns_the_attitude(t):
    h = 1e-5
    R, R_after = (quaternion.to_matrix(trajectory.attitude(at))[0] for at in (t - h, t + h))
    hat = (R.T @ R_after - R_after.T @ R) / (4 * h)
    expected = [hat[2, 1], hat[0, 2], hat[1, 0]]
    joint = np.abs(t[0] - np.round(2.0 * t[0]) / 2.0) < 1e-3  # there the rate has a kink
    assert_allclose(trajectory.angular_velocity(t)[0], expected, atol=2e-4 if joint else 1e-5)


def test_specific_force_is_what_an_accelerometer_feels():
    _, _, a = trajectory.kinematics(T)
    R = quaternion.to_matrix(trajectory.attitude(T))
    felt = np.einsum("nji,nj->ni", R, a - [0.0, 0.0, GRAVITY])
    assert_allclose(trajectory.specific_force(T), felt, atol=1e-12)


def test_rotors_push_along_body_z_and_air_drags():
    _, v, _ = trajectory.kinematics(T)
    to_body = quaternion.conjugate(trajectory.attitude(T))
    push = trajectory.specific_force(T) + 0.2 * quaternion.rotate(to_body, v)
    assert_allclose(push[:, :2], 0.0, atol=1e-12)
    assert np.all(push[:, 2] < -5.0)


def test_it_stands_flies_and_lands_where_it_started():
    place, velocity, _ = trajectory.kinematics(T)
    for still in (T < 4.0, T > 61.0):
        assert_allclose(place[still], 0.0, atol=1e-12)
        assert_allclose(velocity[still], 0.0, atol=1e-12)
        assert_allclose(trajectory.specific_force(T[still])[:, 2], -9.80665, atol=1e-12)
        assert_allclose(trajectory.airborne(T[still]), 0.0, atol=1e-15)
    assert place[:, 2].min() == pytest.approx(-12.0, abs=0.1)
    assert place[:, 2].max() < 1e-3


def test_it_flies_like_a_quadcopter():
    tilt = np.degrees(np.abs(quaternion.to_euler(trajectory.attitude(T))[:, :2])).max(axis=0)
    assert np.all((tilt > 25.0) & (tilt < 45.0))
    rate = np.linalg.norm(trajectory.angular_velocity(T), axis=-1).max()
    assert 0.5 < rate < 3.0
    _, velocity, acceleration = trajectory.kinematics(T)
    assert 5.0 < np.linalg.norm(velocity, axis=-1).max() < 20.0
    assert np.linalg.norm(acceleration, axis=-1).max() < 10.0
