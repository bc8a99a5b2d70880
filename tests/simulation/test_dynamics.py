import numpy as np
from hypothesis import given, settings
from numpy.testing import assert_allclose
from papers import hat
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from strategies import rotations, vectors

from attest.geometry import quaternion
from attest.simulation import dynamics

J = np.array([[2.0, 0.1, -0.2], [0.1, 3.0, 0.3], [-0.2, 0.3, 4.0]])
T = 0.02 * np.arange(251.0)
Q_0 = np.array([0.5, -0.5, 0.5, 0.5])
OMEGA_0 = np.array([1.0, -0.6, 0.8])


def tau(t, R, Omega):  # noqa: ARG001 - a Torque
    return np.array([0.3 * np.sin(t), -0.2, 0.1]) - 0.2 * Omega


def tau_d(t, R, Omega):  # noqa: ARG001 - a Torque
    return R.T @ np.array([0.1, 0.0, 0.2 * np.cos(2.0 * t)])


def test_it_is_the_equations_of_motion():
    def derivative(t, state):
        R, Omega = state[:9].reshape(3, 3), state[9:]
        torque = np.cross(J @ Omega, Omega) + tau(t, R, Omega) + tau_d(t, R, Omega)
        return np.concatenate([(R @ hat(Omega)).ravel(), np.linalg.solve(J, torque)])

    start = np.concatenate([quaternion.to_matrix(Q_0).ravel(), OMEGA_0])
    naive = solve_ivp(derivative, (0.0, T[-1]), start, "DOP853", T, rtol=1e-12, atol=1e-12).y.T
    q, Omega = dynamics.integrate(dynamics.Body(J, tau, tau_d), Q_0, OMEGA_0, T)
    assert_allclose(quaternion.to_matrix(q).reshape(-1, 9), naive[:, :9], atol=1e-9)
    assert_allclose(Omega, naive[:, 9:], atol=1e-9)


@settings(max_examples=5)
@given(rotations, vectors(2.0))
def test_free_of_torque_energy_and_momentum_stay(q_0, Omega_0):
    q, Omega = dynamics.integrate(dynamics.Body(J), q_0, Omega_0, T)
    energy = 0.5 * np.einsum("ni,ij,nj->n", Omega, J, Omega)
    momentum = quaternion.rotate(q, Omega @ J)
    assert_allclose(energy, energy[0], atol=1e-8)
    assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-8)
    assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-15)


def test_it_is_of_fourth_order():
    def end(longest):
        q, Omega = dynamics.integrate(
            dynamics.Body(J, tau, tau_d), Q_0, OMEGA_0, np.array([0.0, 2.0]), longest
        )
        return np.concatenate([q[-1], Omega[-1]])

    exact = end(0.0025)
    errors = [np.linalg.norm(end(h) - exact) for h in (0.2, 0.1, 0.05)]
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4.0, atol=0.5)


def test_steps_need_not_be_even():
    t = np.array([0.0, 0.013, 0.02, 0.5, 0.5001, 1.0])
    even = np.linspace(0.0, 1.0, 1001)
    body = dynamics.Body(J, tau, tau_d)
    q, Omega = dynamics.integrate(body, Q_0, OMEGA_0, t)
    q_even, Omega_even = dynamics.integrate(body, Q_0, OMEGA_0, even)
    assert_allclose(q[-1], q_even[-1], atol=1e-9)
    assert_allclose(Omega[-1], Omega_even[-1], atol=1e-9)


def test_a_steady_spin_is_exact():
    spin = np.array([0.0, 0.0, 3.0])
    q, Omega = dynamics.integrate(dynamics.Body(np.diag([1.0, 2.0, 3.0])), Q_0, spin, T)
    assert_allclose(Omega, np.broadcast_to(spin, Omega.shape), atol=1e-14)
    R = quaternion.to_matrix(Q_0) @ expm(hat(spin) * T[-1])
    assert_allclose(quaternion.to_matrix(q[-1]), R, atol=1e-12)


def test_torques_are_those_along_the_motion():
    q, Omega = dynamics.integrate(dynamics.Body(J), Q_0, OMEGA_0, T[:5])
    given = dynamics.torques(tau_d, T[:5], q, Omega)
    for i in range(5):
        assert_allclose(given[i], tau_d(T[i], quaternion.to_matrix(q[i]), Omega[i]))
