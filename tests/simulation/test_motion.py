import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from attest.geometry import quaternion
from attest.simulation import fts, motion


def hat(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@given(st.floats(0.0, 100.0))
def test_omega_is_eq_96(t):
    eq_96 = [
        np.sin(2 * np.pi * t / 15),
        np.sin(2 * np.pi * t / 18 + np.pi / 20),
        np.cos(2 * np.pi * t / 17),
    ]
    assert_allclose(motion.Omega(np.array([t]))[0], eq_96, atol=1e-15)


def test_attitudes_are_the_discrete_kinematics():
    h, q_0 = 0.01, quaternion.exp(np.array([0.3, -2.0, 1.0]))
    rates = motion.Omega(h * np.arange(50.0))
    R = quaternion.to_matrix(q_0)
    for q, rate in zip(motion.attitudes(q_0, rates, h), rates, strict=True):
        assert_allclose(quaternion.to_matrix(q), R, atol=1e-13)
        R = R @ expm(h * hat(rate))


def test_experiment_7_1_is_as_the_paper_has_it():
    flight = fts.noise_free(seed=0)
    assert_allclose(np.diff(flight.t), 10_000_000)
    assert (flight.t[0], flight.t[-1]) == (0, 30 * 10**9)
    assert_allclose(quaternion.to_matrix(flight.q[0]), np.diag([1, -1, -1]), atol=1e-15)
    R = quaternion.to_matrix(flight.q)
    for k, e_k in enumerate(np.eye(3)):
        assert_allclose(flight.signals[f"v{k + 1}"].y, R.transpose(0, 2, 1) @ e_k, atol=1e-14)
    beta = flight.signals["gyro"].y - flight.omega
    assert_allclose(beta, np.broadcast_to([-0.1, -1.0, 0.2], beta.shape), atol=1e-15)
    assert flight.constants["gyro_bias"] == (-0.1, -1.0, 0.2)
    assert flight.constants["fts_kappa"] == (0.1,)
