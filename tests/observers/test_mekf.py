import kalman
import numpy as np
import observing
import papers
import pytest
import weighted
from flights import angle_deg
from hypothesis import given, settings
from hypothesis import strategies as st
from kalman import split, tuples, whole
from numpy.testing import assert_allclose
from observing import HALF_TURNS, H
from strategies import rotations, vectors, weights
from weighted import per_vector, with_gains, with_w

from attest import config
from attest.geometry import quaternion, so3
from attest.observers import mekf
from attest.observers.observer import turn_noise

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


@settings(max_examples=200)
@given(
    case=observing.cases(n=1), P=kalman.covariances(0.01), w=per_vector, told=st.floats(1e-3, 10.0)
)
def test_an_update_is_kalmans_of_all_vectors_at_once(case, P, w, told):
    R, E, U, k = quaternion.to_matrix(case.q), case.E.T, case.U[0].T, w[: len(case.E)]
    variances = 1.0 / (told * np.array(k))
    after_R, after_beta, after_P = papers.mekf_update(R, case.bias, P, E, U, variances)

    known = E @ np.diag(k) @ E.T
    row = known[np.triu_indices(3)][np.newaxis]
    q = so3.as_quaternion(case.q)
    N = mekf.information(q, row, 0, told)
    y = -told * papers.s_L(R, E @ np.diag(k) @ U.T)
    found = mekf.update(q, so3.as_vector(case.bias), tuples(split(P)), N, so3.as_vector(y))
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
    P=kalman.covariances(0.01),
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
        found = mekf.predict(so3.as_quaternion(q), tuples(split(P)), so3.as_vector(Omega), h, noise)
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
    weighted.assert_diagnostics(mekf, case, WIDE, w)


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
    weighted.assert_weights_turn_along(mekf, case, with_gains(WIDE, g), Q)


@given(case=observing.cases(), Q=rotations, g=gains, w=per_vector)
def test_a_run_does_not_care_how_the_world_is_turned_with_weights_of_the_vectors(case, Q, g, w):
    weighted.assert_world_may_turn(mekf, case, with_w(with_gains(WIDE, g), w), Q)


@given(case=observing.cases(), Q=rotations, g=gains, w=st.none() | per_vector)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q, g, w):
    weighted.assert_body_may_turn(mekf, case, with_w(with_gains(WIDE, g), w), Q)


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
    weighted.assert_leaves_a_half_turn(mekf, WIDE, half_turn, 5000, 1.0)


def test_a_perfect_estimate_at_rest_stays_where_it_is():
    weighted.assert_stays_at_rest(mekf, WIDE)


@given(case=observing.cases())
def test_a_step_without_length_changes_nothing(case):
    kalman.assert_steps_need_length(mekf, case, WIDE)


@given(made=observing.any_samples(), shipped=st.booleans(), w=st.none() | per_vector)
def test_no_measurement_makes_a_nan(made, shipped, w):
    chosen = mekf.Config() if shipped else WIDE
    observing.assert_sound_run(mekf, made, with_w(chosen, w))


@pytest.mark.parametrize("noise", [1e-6, 1e6])
def test_vectors_that_are_exact_or_worthless_make_no_nan(noise):
    made, q = observing.restarted(BETA, n=300, i=200)
    g = mekf.Gains(direction_noise=noise, gyro_noise=1.0)
    found = mekf.estimate(made, observing.starting(with_gains(WIDE, g), q[0]))
    observing.assert_sound(found)
    if noise < 1.0:
        assert angle_deg(found.q[2:200], q[2:200]).max() < 0.5


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    found = weighted.assert_integrates(mekf)
    assert (np.diff(found.states["attitude_std"], axis=0) > 0.0).all()  # and knows less and less


@pytest.mark.parametrize("w", [None, [2.0]])
def test_with_one_vector_it_is_followed_and_the_turn_about_it_is_known_less_and_less(w):
    found = weighted.assert_follows_one_vector(mekf, with_w(WIDE, w), 3001)
    assert found.states["attitude_std"][-1].max() > np.deg2rad(60.0)
    assert found.states["attitude_std"][-1].min() < np.deg2rad(60.0)


def test_a_restart_starts_attitude_and_covariance_anew_and_keeps_the_bias():
    kalman.assert_starts_anew(mekf, WIDE, BETA)


def test_a_gyroscope_too_slow_for_its_motion_is_believed_less_where_it_bends():
    rng = np.random.default_rng(5)
    gyro = np.where(np.arange(200)[:, np.newaxis] < 150, 0.01, 1.0) * rng.normal(size=(200, 3))
    U = np.broadcast_to(np.eye(3), (200, 3, 3))
    slow = observing.sampled(gyro, U, np.eye(3), 0.25, substeps=np.full(200, 25))
    noise = turn_noise(slow, slice(0, 200), 0.005)
    assert_allclose(noise[:130], 0.005)
    assert noise[165:190].min() > 0.05
    quick = observing.sampled(gyro, U, np.eye(3), 0.01)
    assert_allclose(turn_noise(quick, slice(0, 200), 0.005), 0.005)


def test_sub_steps_are_the_run_of_a_log_sampled_that_much_finer():
    observing.assert_sub_steps(mekf, WIDE, straight=True)


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
