from dataclasses import replace

import numpy as np
import observing
import papers
import pytest
import weighted
from flights import angle_deg
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import HALF_TURNS, H
from strategies import rotations, weights
from weighted import per_vector, with_gains, with_w

from attest import config
from attest.geometry import quaternion
from attest.observers import cgo

BRISK = cgo.Config(
    gains=cgo.Gains(k_p=1.0, k_i=0.3), weights=config.VectorWeights(k=(3.0, 2.0, 1.0))
)
"""Gains of [Mahony08], section 6."""
BETA = np.array([0.05, -0.1, 0.02])

gains = st.builds(cgo.Gains, k_p=st.floats(0.05, 5.0), k_i=st.floats(0.0, 2.0))


def assert_first_step(case, settings, R_dot, beta_dot):
    """The step turns R as R' = R hat(Omega) does for a constant Omega; beta_hat goes by Euler."""
    found = cgo.estimate(case.samples(), case.start(settings))
    R = quaternion.to_matrix(case.q)
    Omega = papers.vex(R.T @ R_dot)
    assert_allclose(found.angular_velocity[0], Omega, atol=1e-9)
    turned = R @ papers.exp(case.h * Omega)
    assert_allclose(quaternion.to_matrix(found.q[1]), turned, atol=1e-12)
    assert_allclose((found.gyro_bias[1] - case.bias) / case.h, beta_dot, atol=1e-9)


@given(case=observing.cases(n=2), k=weights, g=gains)
def test_a_step_is_eqs_90_and_91(case, k, g):
    e, u = papers.joined(case.E.T, case.U[0].T)
    chosen = cgo.Config(gains=g, weights=config.VectorWeights(k=tuple(k.tolist())))
    args = (quaternion.to_matrix(case.q), case.bias, case.gyro[0], e, u, papers.W(e, np.diag(k)))
    assert_first_step(case, chosen, *papers.cgo(*args, g.k_p, g.k_i))


@given(case=observing.cases(n=2), w=per_vector, g=gains)
def test_with_a_weight_per_vector_a_step_is_mahonys(case, w, g):
    k = w[: len(case.E)]
    args = (quaternion.to_matrix(case.q), case.bias, case.gyro[0], case.E.T, case.U[0].T)
    chosen = with_w(cgo.Config(gains=g), k)
    assert_first_step(case, chosen, *papers.mahony(*args, k, g.k_p, g.k_i))
    assert_first_step(case, chosen, *papers.cgo(*args, np.diag(k), g.k_p, g.k_i))


def test_a_noisy_run_is_mahonys_filter():
    rng, n, k = np.random.default_rng(4), 1001, np.array([1.0, 0.4, 2.5])
    E = quaternion.rotate(quaternion.exp(np.array([0.3, 1.0, -0.5])), np.eye(3))
    E[2] = (E[0] + E[2]) / np.sqrt(2.0)
    Omega = observing.motion(n)
    q = observing.truth(quaternion.exp(np.array([1.0, -2.0, 0.5])), Omega)
    U = observing.seen(q, E) + 0.1 * rng.normal(size=(n, 3, 3))
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    gyro = Omega + BETA + 0.05 * rng.normal(size=(n, 3))
    found = cgo.estimate(observing.sampled(gyro, U, E), observing.starting(with_w(BRISK, k)))
    R, b = np.eye(3), np.zeros(3)
    for i in range(n):
        assert_allclose(quaternion.to_matrix(found.q[i]), R, atol=1e-9)
        assert_allclose(found.gyro_bias[i], b, atol=1e-9)
        R_dot, b_dot = papers.mahony(R, b, gyro[i], E.T, U[i].T, k, 1.0, 0.3)
        R, b = R @ papers.exp(H * papers.vex(R.T @ R_dot)), b + H * b_dot
    assert angle_deg(found.q[-1], q[-1]) < 10.0


@given(case=observing.cases(), w=per_vector)
def test_diagnostics_are_the_residual_and_wahbas_cost(case, w):
    weighted.assert_diagnostics(cgo, case, BRISK, w)


@given(case=observing.cases(), Q=observing.axis_turns, g=gains)
def test_a_run_does_not_care_how_the_world_is_turned_if_its_weights_turn_along(case, Q, g):
    weighted.assert_weights_turn_along(cgo, case, with_gains(BRISK, g), Q)


@given(case=observing.cases(), Q=rotations, g=gains, w=per_vector)
def test_a_run_does_not_care_how_the_world_is_turned_with_weights_of_the_vectors(case, Q, g, w):
    weighted.assert_world_may_turn(cgo, case, with_w(with_gains(BRISK, g), w), Q)


@given(case=observing.cases(), Q=rotations, g=gains, w=st.none() | per_vector)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q, g, w):
    weighted.assert_body_may_turn(cgo, case, with_w(with_gains(BRISK, g), w), Q)


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    found = cgo.estimate(observing.million_steps(), BRISK)
    assert np.abs(np.linalg.norm(found.q, axis=1) - 1.0).max() < 1e-10


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_and_finds_the_bias():
    errors, biases = observing.ends(cgo, BRISK, 8001, BETA)
    assert errors.max() < 1e-3
    assert biases.max() < 1e-5


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    weighted.assert_leaves_a_half_turn(cgo, BRISK, half_turn, 4000, 1e-2)


def test_a_perfect_estimate_at_rest_stays_where_it_is():
    weighted.assert_stays_at_rest(cgo, BRISK)


@given(case=observing.cases())
def test_a_step_without_length_changes_nothing(case):
    made = replace(case.samples(), t=np.zeros(len(case.gyro), np.int64))
    found = cgo.estimate(made, case.start(BRISK))
    assert angle_deg(found.q, case.q).max() < 1e-9
    assert_allclose(found.gyro_bias, np.broadcast_to(case.bias, (len(case.gyro), 3)))
    short = cgo.estimate(replace(case, h=1e-9).samples(), case.start(BRISK))
    assert angle_deg(short.q, case.q).max() < 1e-4
    assert_allclose(short.gyro_bias, found.gyro_bias, atol=1e-6)


@given(made=observing.any_samples(), shipped=st.booleans(), w=st.none() | per_vector)
def test_no_measurement_makes_a_nan(made, shipped, w):
    chosen = cgo.Config() if shipped else BRISK
    observing.assert_sound_run(cgo, made, with_w(chosen, w))


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    weighted.assert_integrates(cgo)


def test_with_one_vector_it_is_followed_and_the_turn_about_it_is_the_gyroscopes():
    made, q = weighted.one_vector(3001)
    for chosen in (BRISK, with_w(BRISK, [2.0])):
        frozen = chosen.model_copy(update={"gains": cgo.Gains(k_p=1.0, k_i=0.0)})
        found = cgo.estimate(made, observing.starting(frozen))
        seen = quaternion.rotate(found.q[-1], made.body[-1, 0])
        assert_allclose(seen, weighted.DOWN[0], atol=1e-6)
        about = quaternion.rotate(quaternion.conjugate(q), weighted.DOWN[0])
        turned = np.sum(about * (found.angular_velocity - made.gyro), axis=1)
        assert_allclose(turned, 0.0, atol=1e-12)


def test_lyapunov_function_falls_as_its_derivative_says():
    """V' = -k_P |s_L|², [Mahony08] Theorem 5.1."""
    rng, h = np.random.default_rng(5), 1e-6
    for _ in range(20):
        q = quaternion.normalize(rng.normal(size=(2, 4)))
        Omega, beta, beta_hat = rng.normal(size=(3, 3))
        U = observing.seen(observing.truth(q[0], np.tile(Omega, (2, 1)), h), np.eye(3))
        made = observing.sampled(np.tile(Omega + beta, (2, 1)), U, np.eye(3), h)
        for chosen in (BRISK, with_w(BRISK, [1.0, 2.0, 0.5])):
            found = cgo.estimate(made, observing.starting(chosen, q[1], beta_hat))
            V = cgo.lyapunov(found, chosen, found.gyro_bias - beta)
            expected = -chosen.gains.k_p * found.s_norm[0] ** 2
            assert_allclose((V[1] - V[0]) / h, expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("w", [None, [1.0, 2.0, 0.5]])
def test_lyapunov_function_never_grows_without_noise(w):
    Omega = observing.motion(3001)
    q = observing.truth(quaternion.exp(np.array([2.0, -1.0, 1.5])), Omega)
    made = observing.sampled(Omega + BETA, observing.seen(q, np.eye(3)), np.eye(3))
    chosen = with_w(BRISK, w)
    found = cgo.estimate(made, observing.starting(chosen))
    V = cgo.lyapunov(found, chosen, found.gyro_bias - BETA)
    assert np.diff(V).max() < 1e-6 * V[0]
    assert V[-1] < 1e-6 * V[0]


def test_a_restart_starts_the_attitude_anew_and_keeps_the_bias():
    made, q = observing.restarted(BETA)
    found = cgo.estimate(made, BRISK)
    assert angle_deg(found.q[2000], q[2000]) < 1e-5
    assert_allclose(found.gyro_bias[2000], found.gyro_bias[1999], atol=1e-6)
    assert_allclose(found.gyro_bias[1999], BETA, atol=1e-3)
    assert angle_deg(found.q[2000:], q[2000:]).max() < 0.1


def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer():
    observing.assert_sub_steps(cgo, BRISK)


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("k_p", 0.0, "greater than 0"),
        ("k_p", -1.0, "greater than 0"),
        ("k_i", -1e-9, "greater than or equal to 0"),
    ],
)
def test_gains_outside_the_theorem_are_refused_by_its_name(key, value, must):
    said = f"my.yaml: 'gains.{key}' is {value}. It must be: {must} [Mahony08, Theorem 5.1]."
    assert observing.refusal(cgo, key, value) == said
