"""The papers' scenarios are what the papers say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from papers import exp, hat, vex
from scipy.linalg import expm

from attest import simulation
from attest.geometry import quaternion

TURNING = ("fts-7.1", "fts-7.2-high", "fts-7.2-low", "rel-4", "rel-4-noise")
TORQUED = {"vae-6": (2.56, 3.01, 2.98), "eso-6": (4.0, 4.0, 10.0), "eso-6-noise": (4.0, 4.0, 10.0)}


@pytest.fixture(scope="module")
def flights(simulated):
    return {name: simulated(name, seed=0) for name in (*TURNING, *TORQUED)}


def stack(flight):
    names = [name for name in flight.signals if name.startswith("v")]
    measured = np.stack([flight.signals[name].y for name in names], axis=1)
    return measured, np.array([flight.constants[name] for name in names])


def exact(flight):
    _, E = stack(flight)
    return np.einsum("nji,kj->nki", quaternion.to_matrix(flight.q), E)


def angles_deg(a, b):
    unit = [v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (a, b)]
    return np.degrees(np.arccos(np.clip(np.sum(unit[0] * unit[1], axis=-1), -1.0, 1.0)))


@pytest.mark.parametrize("name", TURNING)
def test_truth_is_the_discrete_kinematics(flights, name):
    flight = flights[name]
    R = quaternion.to_matrix(flight.q)
    for i in range(0, len(R) - 1, 100):
        assert_allclose(R[i + 1], R[i] @ expm(0.01 * hat(flight.omega[i])), atol=1e-13)
    assert_array_equal(flight.t, 10_000_000 * np.arange(3001))


@pytest.mark.parametrize("name", TORQUED)
def test_truth_is_the_rigid_bodys(flights, name):
    flight, J, h = flights[name], np.diag(TORQUED[name]), 0.01
    assert flight.constants["inertia"] == TORQUED[name]
    assert_array_equal(flight.t, 10_000_000 * np.arange(4001))
    tau = flight.signals["torque"].y.copy()
    if "disturbance_torque" in flight.truth:
        tau += flight.truth["disturbance_torque"].y
    Omega = flight.omega
    rate = (Omega[2:] - Omega[:-2]) / (2.0 * h)
    expected = np.linalg.solve(J, (np.cross(Omega @ J, Omega) + tau).T).T[1:-1]
    assert_allclose(rate, expected, atol=2e-4)
    steps = quaternion.multiply(quaternion.conjugate(flight.q[:-1]), flight.q[1:])
    mean = 0.5 * (Omega[1:] + Omega[:-1])
    assert_allclose(quaternion.log(steps) / h, mean, atol=2e-5)


@pytest.mark.parametrize("name", ["fts-7.1", "rel-4", "eso-6"])
def test_without_noise_the_vectors_are_exact(flights, name):
    assert_allclose(stack(flights[name])[0], exact(flights[name]), atol=1e-14)


@pytest.mark.parametrize(
    ("name", "vector_deg", "gyro_deg"), [("fts-7.2-high", 30.0, 25.0), ("fts-7.2-low", 0.95, 2.5)]
)
def test_cases_i_and_ii_have_their_noise(flights, name, vector_deg, gyro_deg):
    flight = flights[name]
    off = flight.signals["gyro"].y - flight.omega - np.array([-0.01, -0.005, 0.02])
    assert_allclose(np.degrees(off).std(axis=0), gyro_deg, rtol=0.03)
    assert np.degrees(np.abs(off)).max() < 2.515 * gyro_deg
    U, true = stack(flight)[0], exact(flight)
    assert_allclose(np.linalg.norm(U, axis=-1), 1.0, atol=1e-12)
    apart = angles_deg(U, true)
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(np.sqrt(2.0) * vector_deg, rel=0.03)
    assert flight.constants["vector_std"] == (np.radians(vector_deg),)
    assert flight.constants["initial_attitude"] == (1.0, 0.0, 0.0, 0.0)
    assert flight.constants["initial_bias"] == (0.0, 0.0, 0.1)


def test_cases_i_and_ii_start_alike_and_by_the_seed(flights):
    high, low = flights["fts-7.2-high"], flights["fts-7.2-low"]
    assert_array_equal(high.q, low.q)
    starts = [simulation.simulate("fts-7.2-low", seed).q[0] for seed in range(40)]
    angles = np.degrees(np.linalg.norm(quaternion.log(np.array(starts)), axis=-1))
    assert np.sqrt(np.mean(angles**2)) == pytest.approx(60.0, rel=0.25)


def test_vae_6_is_as_the_paper_has_it(flights):
    flight = flights["vae-6"]
    assert_allclose(
        quaternion.to_matrix(flight.q[0]), exp(np.pi / 4 * np.array([3, 6, 2]) / 7), atol=1e-14
    )
    start = quaternion.to_matrix(np.array(flight.constants["initial_attitude"]))
    assert_allclose(start, exp(np.pi / 2.5 * np.array([3, 6, 2]) / 7), atol=1e-14)
    assert_allclose(flight.omega[0], np.pi / 60 * np.array([-2.1, 1.2, -1.1]))
    t = flight.t * 1e-9
    zero = np.zeros_like(t)
    torque = np.stack([zero, 0.028 * np.sin(2.7 * t - np.pi / 7), zero], axis=-1)
    assert_allclose(flight.signals["torque"].y, torque, atol=1e-15)
    U, E = stack(flight)
    assert E.shape == (9, 3)
    assert_allclose(np.linalg.norm(E, axis=-1), 1.0, atol=1e-15)
    noise = np.degrees(U - exact(flight))
    assert 1.5 < np.abs(noise).max() < 2.4
    nu = np.degrees(flight.signals["gyro"].y - flight.omega - flight.constants["gyro_bias"])
    assert 0.6 < np.abs(nu).max() < 0.97


def test_rel_4_has_normal_noise(flights):
    L, D = stack(flights["rel-4-noise"])
    assert_allclose(D[3], np.array([1.0, 2.0, 1.0]) * np.sqrt(6) / 6)
    noise = L - exact(flights["rel-4-noise"])
    assert_allclose(noise.std(axis=0), 0.01, rtol=0.05)
    assert_allclose(noise.mean(axis=0), 0.0, atol=1e-3)


def test_eso_6_is_controlled_and_disturbed(flights):
    flight = flights["eso-6"]
    K_c = np.diag([0.1, 0.2, 0.3])
    for R, tau in zip(quaternion.to_matrix(flight.q), flight.signals["torque"].y, strict=True):
        A = K_c @ R - R.T @ K_c
        assert_allclose(tau, -0.5 * vex(A), atol=1e-14)
    t = flight.t * 1e-9
    tau_d = [0.2 * np.sin(0.2 * np.pi * t), 0.1 * np.sin(0.4 * np.pi * t)]
    tau_d.append(0.5 * np.cos(0.1 * np.pi * t))
    assert_allclose(flight.truth["disturbance_torque"].y, np.stack(tau_d, axis=-1), atol=1e-14)
    assert_array_equal(flight.signals["gyro"].y, flight.omega)


def test_eso_6_noise_is_not_of_zero_mean(flights):
    flight = flights["eso-6-noise"]
    for off in (stack(flight)[0] - exact(flight), flight.signals["gyro"].y - flight.omega):
        assert off.min() >= -1e-15
        assert off.max() < 0.05
        assert_allclose(off.mean(axis=0), 0.025, atol=1e-3)
    assert_array_equal(flight.q, flights["eso-6"].q)
