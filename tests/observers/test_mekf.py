from dataclasses import replace

import numpy as np
import observing
import papers
import pytest
from flights import angle_deg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import HALF_TURNS, IDENTITY, H
from strategies import arrays, rotations, vectors, weights

from attest import config
from attest.geometry import quaternion, so3
from attest.observers import mekf

WIDE = mekf.Config(
    gains=mekf.Gains(
        direction_noise=0.5, gyro_noise=0.22, bias_walk=0.03, attitude_deg=60.0, bias_deg_s=10.0
    ),
    weights=config.VectorWeights(k=(3.0, 2.0, 1.0)),
)
"""Noise for a start from anywhere."""
BETA = np.array([0.05, -0.1, 0.02])

gains = st.builds(
    mekf.Gains,
    direction_noise=st.floats(0.1, 5.0),
    gyro_noise=st.floats(0.01, 1.0),
    bias_walk=st.floats(0.0, 0.1),
    attitude_deg=st.floats(1.0, 180.0),
    bias_deg_s=st.floats(0.1, 20.0),
)
per_vector = st.lists(st.floats(0.1, 5.0), min_size=5, max_size=5)


def with_w(settings, w):
    named = {f"v{i + 1}": w_i for i, w_i in enumerate(w)}
    return settings.model_copy(update={"weights": config.VectorWeights(w=named)})


def with_gains(settings, g):
    return settings.model_copy(update={"gains": g})


def tuples(P):
    return tuple(tuple(b.ravel().tolist()) for b in (P[:3, :3], P[:3, 3:], P[3:, 3:]))


def whole(P):
    P_a, P_c, P_b = (np.array(block).reshape(3, 3) for block in P)
    return np.block([[P_a, P_c], [P_c.T, P_b]])


covariances = arrays(36, 1.0).map(
    lambda a: 0.2 * a.reshape(6, 6) @ a.reshape(6, 6).T + 0.01 * np.eye(6)
)


@settings(max_examples=200)
@given(case=observing.cases(n=1), P=covariances, w=per_vector, told=st.floats(1e-3, 10.0))
def test_an_update_is_kalmans_of_all_vectors_at_once(case, P, w, told):
    R, E, U, k = quaternion.to_matrix(case.q), case.E.T, case.U[0].T, w[: len(case.E)]
    variances = 1.0 / (told * np.array(k))
    after_R, after_beta, after_P = papers.mekf_update(R, case.bias, P, E, U, variances)

    known = E @ np.diag(k) @ E.T
    row = known[np.triu_indices(3)][np.newaxis]
    q = so3.as_quaternion(case.q)
    N = mekf.information(q, row, 0, told)
    y = -told * papers.s_L(R, E @ np.diag(k) @ U.T)
    found = mekf.update(q, so3.as_vector(case.bias), tuples(P), N, so3.as_vector(y))
    assert_allclose(quaternion.to_matrix(np.array(found[0])), after_R, atol=1e-9)
    assert_allclose(found[1], after_beta, atol=1e-9)
    assert_allclose(whole(found[2]), after_P, atol=1e-9)


@given(case=observing.cases(n=1), k=weights)
def test_the_information_of_any_weights_is_that_of_the_gradient(case, k):
    """s_L = -N theta for an error theta, to first order."""
    E, _ = papers.joined(case.E.T, case.U[0].T)
    W, R = papers.W(E, np.diag(k)), quaternion.to_matrix(case.q)
    known = (E @ W @ E.T)[np.triu_indices(3)][np.newaxis]
    N = np.array(mekf.information(so3.as_quaternion(case.q), known, 0, 1.0)).reshape(3, 3)
    for theta in 1e-6 * np.eye(3):
        U = (R @ papers.exp(theta)).T @ E
        assert_allclose(-papers.s_L(R, E @ W @ U.T) / 1e-6, N @ theta / 1e-6, atol=1e-3)


@given(
    q=rotations,
    P=covariances,
    Omega=vectors(5.0),
    noise=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
)
def test_a_prediction_carries_the_errors_as_they_move(q, P, Omega, noise):
    """What the bias does to the attitude is held over a step: right to second order in h."""
    intensity = np.repeat(noise, 3)
    R, apart = quaternion.to_matrix(q), []
    for h in (4e-3, 2e-3):
        after_R, after_P = papers.mekf_predict(
            R, P, Omega, h, papers.mekf_transition(Omega, h), intensity
        )
        found = mekf.predict(so3.as_quaternion(q), tuples(P), so3.as_vector(Omega), h, noise)
        assert_allclose(quaternion.to_matrix(np.array(found[0])), after_R, atol=1e-12)
        apart.append(np.abs(whole(found[1]) - after_P).max())
    assert apart[0] <= 100.0 * 4e-3**2
    assert apart[1] <= 0.3 * apart[0] + 1e-12


def held_transition(Omega, h):
    """Carry the bias's error into the attitude's at the beginning of the step."""
    A = papers.exp(h * Omega)
    return np.block([[A.T, -h * A.T], [np.zeros((3, 3)), np.eye(3)]])


def noisy(n, rng):
    E = quaternion.rotate(quaternion.exp(np.array([0.3, 1.0, -0.5])), np.eye(3))
    E[2] = (E[0] + E[2]) / np.sqrt(2.0)
    Omega = observing.motion(n)
    q = observing.truth(quaternion.exp(np.array([0.3, -0.6, 0.5])), Omega)
    U = observing.seen(q, E) + 0.1 * rng.normal(size=(n, 3, 3))
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    return q, Omega + BETA + 0.05 * rng.normal(size=(n, 3)), U, E


@pytest.mark.parametrize(
    ("transition", "attitude", "bias"),
    [(held_transition, 1e-9, 1e-9), (papers.mekf_transition, 2e-3, 2e-3)],
    ids=["held", "exact"],
)
def test_a_noisy_run_is_kalmans_6x6_filter(transition, attitude, bias):
    n, k, g = 301, np.array([1.0, 0.4, 2.5]), WIDE.gains
    q, gyro, U, E = noisy(n, np.random.default_rng(4))
    found = mekf.estimate(observing.sampled(gyro, U, E), observing.starting(with_w(WIDE, k)))
    R, b = np.eye(3), np.zeros(3)
    P = np.diag([np.deg2rad(g.attitude_deg) ** 2] * 3 + [np.deg2rad(g.bias_deg_s) ** 2] * 3)
    variances = g.direction_noise**2 / (H * k)
    intensity = [g.gyro_noise**2] * 3 + [g.bias_walk**2] * 3
    for i in range(n):
        assert_allclose(quaternion.to_matrix(found.q[i]), R, atol=attitude)
        assert_allclose(found.gyro_bias[i], b, atol=bias)
        assert_allclose(found.angular_velocity[i], gyro[i] - found.gyro_bias[i], atol=1e-12)
        assert_allclose(found.states["attitude_std"][i], np.sqrt(np.diag(P)[:3]), atol=attitude)
        R, b, P = papers.mekf_update(R, b, P, E.T, U[i].T, variances)
        R, P = papers.mekf_predict(R, P, gyro[i] - b, H, transition(gyro[i] - b, H), intensity)
    assert angle_deg(found.q[-1], q[-1]) < 10.0


@given(case=observing.cases(n=1), w=per_vector)
def test_diagnostics_are_the_residual_and_wahbas_cost(case, w):
    three, U3 = papers.joined(case.E.T, case.U[0].T)
    of_vectors = np.diag(w[: len(case.E)])
    for chosen, e, u, W in (
        (WIDE, three, U3, papers.W(three, np.diag(WIDE.weights.k))),
        (with_w(WIDE, w), case.E.T, case.U[0].T, of_vectors),
    ):
        found = mekf.estimate(case.samples(), case.start(chosen))
        R = quaternion.to_matrix(case.q)
        left, s = e - R @ u, papers.s_L(R, e @ W @ u.T)
        assert_allclose(found.s_norm[0], np.linalg.norm(s), atol=1e-8)
        assert_allclose(found.cost[0], 0.5 * np.trace(left.T @ left @ W), atol=1e-8)


def test_its_standard_deviation_is_that_of_its_errors():
    """With noise as it expects, errors squared over variances are 3 in the mean, 95 % below 7.8."""
    rng, n = np.random.default_rng(11), 201
    g = mekf.Gains(
        direction_noise=0.02, gyro_noise=0.02, bias_walk=0.005, attitude_deg=5.0, bias_deg_s=2.0
    )
    Omega, nees = observing.motion(n), []
    for _ in range(60):
        off, drift = np.deg2rad(5.0) * rng.normal(size=3), np.deg2rad(2.0) * rng.normal(size=3)
        q = observing.truth(quaternion.exp(off), Omega)
        U = observing.seen(q, np.eye(3)) + 0.02 / np.sqrt(H) * rng.normal(size=(n, 3, 3))
        walk = drift + 0.005 * np.sqrt(H) * np.cumsum(rng.normal(size=(n, 3)), axis=0)
        gyro = Omega + walk + 0.02 / np.sqrt(H) * rng.normal(size=(n, 3))
        chosen = with_w(with_gains(WIDE, g), [1.0, 1.0, 1.0])
        found = mekf.estimate(observing.sampled(gyro, U, np.eye(3)), observing.starting(chosen))
        error = quaternion.log(quaternion.multiply(quaternion.conjugate(found.q[-1]), q[-1]))
        nees.append(np.sum((error / found.states["attitude_std"][-1]) ** 2))
    assert 2.2 < np.mean(nees) < 4.0
    assert np.mean(np.array(nees) < 7.8) > 0.85


@given(case=observing.cases(), Q=observing.axis_turns, g=gains)
def test_a_run_does_not_care_how_the_world_is_turned_if_its_weights_turn_along(case, Q, g):
    chosen = with_gains(WIDE, g)
    k = observing.turned_weights(chosen.weights.k, Q)
    along = chosen.model_copy(update={"weights": config.VectorWeights(k=k)})
    there = case.in_a_turned_world(Q)
    observing.assert_turned_world(
        mekf.estimate(case.samples(), case.start(chosen)),
        mekf.estimate(there.samples(), there.start(along)),
        Q,
    )


@given(case=observing.cases(), Q=rotations, g=gains, w=per_vector)
def test_a_run_does_not_care_how_the_world_is_turned_with_weights_of_the_vectors(case, Q, g, w):
    chosen = with_w(with_gains(WIDE, g), w)
    there = case.in_a_turned_world(Q)
    observing.assert_turned_world(
        mekf.estimate(case.samples(), case.start(chosen)),
        mekf.estimate(there.samples(), there.start(chosen)),
        Q,
    )


@given(case=observing.cases(), Q=rotations, g=gains, w=st.none() | per_vector)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q, g, w):
    chosen = with_gains(WIDE, g)
    chosen = chosen if w is None else with_w(chosen, w)
    there = case.in_a_turned_body(Q)
    observing.assert_turned_body(
        mekf.estimate(case.samples(), case.start(chosen)),
        mekf.estimate(there.samples(), there.start(chosen)),
        Q,
    )


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    found = mekf.estimate(observing.million_steps(), mekf.Config())
    observing.assert_sound(found)
    assert np.abs(np.linalg.norm(found.q, axis=1) - 1.0).max() < 1e-10
    assert (found.states["attitude_std"] > 0.0).all()


@pytest.mark.slow
def test_every_start_but_the_unstable_ones_converges_and_finds_the_bias():
    errors, biases = observing.ends(mekf, WIDE, 12001, BETA)
    assert errors.max() < 1e-3
    assert biases.max() < 1e-4


@pytest.mark.parametrize("half_turn", HALF_TURNS)
def test_a_half_turn_off_is_an_equilibrium_that_any_push_leaves(half_turn):
    made, q = observing.at_rest(5000), quaternion.exp(half_turn)
    stuck = mekf.estimate(made, observing.starting(WIDE, q))
    observing.assert_sound(stuck)
    assert stuck.s_norm[0] < 1e-14
    pushed = quaternion.multiply(quaternion.exp(np.full(3, 1e-6)), q)
    left = mekf.estimate(made, observing.starting(WIDE, pushed))
    assert angle_deg(left.q[-1], IDENTITY) < 1.0


def test_a_perfect_estimate_at_rest_stays_where_it_is():
    found = mekf.estimate(observing.at_rest(50), observing.starting(WIDE))
    assert_allclose(found.q, np.broadcast_to(IDENTITY, (50, 4)))
    for still in (found.s_norm, found.gyro_bias, found.angular_velocity):
        assert not still.any()


@given(case=observing.cases())
def test_a_step_without_length_changes_nothing(case):
    made = replace(case.samples(), t=np.zeros(len(case.gyro), np.int64))
    found = mekf.estimate(made, case.start(WIDE))
    assert angle_deg(found.q, case.q).max() < 1e-9
    assert_allclose(found.gyro_bias, np.broadcast_to(case.bias, (len(case.gyro), 3)))
    assert_allclose(found.states["attitude_std"], np.deg2rad(60.0))
    short = mekf.estimate(replace(case, h=1e-9).samples(), case.start(WIDE))
    assert angle_deg(short.q, case.q).max() < 1e-4
    assert_allclose(short.states["attitude_std"], found.states["attitude_std"], atol=1e-6)


@given(made=observing.any_samples(), shipped=st.booleans(), w=st.none() | per_vector)
def test_no_measurement_makes_a_nan(made, shipped, w):
    chosen = mekf.Config() if shipped else WIDE
    observing.assert_sound_run(mekf, made, chosen if w is None else with_w(chosen, w))


@pytest.mark.parametrize("noise", [1e-6, 1e6])
def test_vectors_that_are_exact_or_worthless_make_no_nan(noise):
    made, q = observing.restarted(BETA, n=300, i=200)
    g = mekf.Gains(direction_noise=noise, gyro_noise=1.0)
    found = mekf.estimate(made, observing.starting(with_gains(WIDE, g), q[0]))
    observing.assert_sound(found)
    if noise < 1.0:
        assert angle_deg(found.q[2:200], q[2:200]).max() < 0.5


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    Omega = observing.motion(500)
    found = mekf.estimate(observing.sampled(Omega, np.empty((500, 0, 3)), []), mekf.Config())
    assert angle_deg(found.q, observing.truth(IDENTITY, Omega)).max() < 1e-6
    assert not found.gyro_bias.any()
    assert (np.diff(found.states["attitude_std"], axis=0) > 0.0).all()  # and knows less and less


@pytest.mark.parametrize("w", [None, [2.0]])
def test_with_one_vector_it_is_followed_and_the_turn_about_it_is_known_less_and_less(w):
    down, rate = np.array([[0.0, 0.0, -1.0]]), np.array([0.0, 0.0, 0.02])
    q = observing.truth(quaternion.exp(np.array([0.4, -0.3, 0.0])), np.tile(rate, (3001, 1)))
    made = observing.sampled(np.tile(rate, (3001, 1)), observing.seen(q, down), down)
    found = mekf.estimate(made, observing.starting(WIDE if w is None else with_w(WIDE, w)))
    assert_allclose(quaternion.rotate(found.q[-1], made.body[-1, 0]), down[0], atol=1e-3)
    assert found.states["attitude_std"][-1].max() > np.deg2rad(60.0)
    assert found.states["attitude_std"][-1].min() < np.deg2rad(60.0)


def test_a_restart_starts_attitude_and_covariance_anew_and_keeps_the_bias():
    made, q = observing.restarted(BETA)
    found = mekf.estimate(made, WIDE)
    assert angle_deg(found.q[2000], q[2000]) < 1e-5
    assert_allclose(found.states["attitude_std"][2000], np.deg2rad(60.0))
    assert_allclose(found.gyro_bias[2000], found.gyro_bias[1999], atol=1e-4)
    assert_allclose(found.gyro_bias[1999], BETA, atol=0.01)
    assert angle_deg(found.q[2000:], q[2000:]).max() < 0.5


def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer():
    observing.assert_sub_steps(mekf, WIDE)


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("direction_noise", 0.0, "greater than 0"),
        ("gyro_noise", 0.0, "greater than 0"),
        ("bias_walk", -1.0, "greater than or equal to 0"),
        ("attitude_deg", 0.0, "greater than 0"),
        ("attitude_deg", 180.5, "less than or equal to 180"),
        ("bias_deg_s", 0.0, "greater than 0"),
    ],
)
def test_gains_outside_the_theory_are_refused_by_its_name(key, value, must):
    said = f"my.yaml: 'gains.{key}' is {value}. It must be: {must} [Lefferts82]."
    assert observing.refusal(mekf, key, value) == said
