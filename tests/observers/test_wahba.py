from dataclasses import replace

import memoryless
import numpy as np
import observing
import papers
import pytest
from flights import angle_deg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from memoryless import carried, noisy
from numpy.testing import assert_allclose
from observing import IDENTITY
from papers_rigid import biased
from scipy.spatial.transform import Rotation
from strategies import rotations, weights

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.observers import wahba

K = wahba.Config(weights=config.VectorWeights(k=(3.0, 2.0, 1.0)))
positive = st.lists(st.floats(0.1, 20.0), min_size=5, max_size=5)


def weighted(w):
    """Return a configuration with a weight for each vector."""
    named = {f"v{i + 1}": float(w_i) for i, w_i in enumerate(w)}
    return wahba.Config(weights=config.VectorWeights(w=named))


def gap(E, U, w):
    """Return how far the best rotation is from the next one, by Davenport's two largest values."""
    s = np.linalg.svd(E.T @ np.diag(w) @ U, compute_uv=False)
    return (s[1] + s[2] * np.sign(np.linalg.det(E.T @ np.diag(w) @ U))) / s[0]


@given(drawn=noisy(), w=positive)
@settings(max_examples=200)
def test_each_step_is_what_scipy_says(drawn, w):
    made, E = drawn
    w = np.array(w[: len(E)])
    found = wahba.estimate(made, weighted(w))
    for q, U in zip(found.q, made.body, strict=True):
        assume(gap(E, U, w) > 1e-3)
        best, _ = Rotation.align_vectors(E, U, weights=w)
        apart = angle_deg(q, quaternion.from_xyzw(best.as_quat()))
        assert_allclose(np.deg2rad(apart), 0.0, atol=1e-9)


@given(drawn=noisy(), k=weights)
def test_by_weights_along_the_worlds_axes_it_is_the_rotation_nearest_to_the_papers_l(drawn, k):
    made, E = drawn
    chosen = wahba.Config(weights=config.VectorWeights(k=tuple(k.tolist())))
    found = wahba.estimate(made, chosen)
    for q, body in zip(found.q, made.body, strict=True):
        e, u = papers.joined(E.T, body.T)
        P, _, Q = np.linalg.svd(papers.L(e, u, np.diag(k)))
        nearest = P @ np.diag([1.0, 1.0, np.linalg.det(P @ Q)]) @ Q
        assert_allclose(quaternion.to_matrix(q), nearest, atol=1e-7)


@given(drawn=noisy(), k=weights)
def test_diagnostics_are_the_residual_which_is_none_and_wahbas_cost(drawn, k):
    made, E = drawn
    chosen = wahba.Config(weights=config.VectorWeights(k=tuple(k.tolist())))
    found = wahba.estimate(made, chosen)
    assert_allclose(found.s_norm, 0.0, atol=1e-7)
    for q, cost, body in zip(found.q, found.cost, made.body, strict=True):
        e, u = papers.joined(E.T, body.T)
        assert_allclose(cost, papers.cost(quaternion.to_matrix(q), e, u, np.diag(k)), atol=1e-7)
    assert_allclose(found.angular_velocity, made.gyro)
    assert found.gyro_bias is None


def test_the_weight_of_a_vector_that_is_not_named_is_one():
    E = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    rng = np.random.default_rng(1)
    U = E + 0.05 * rng.normal(size=(4, 3, 3))
    made = observing.sampled(np.zeros((4, 3)), U, E)
    partly = wahba.Config(weights=config.VectorWeights(w={"v2": 5.0}))
    found = [wahba.estimate(made, chosen) for chosen in (partly, weighted([1.0, 5.0, 1.0]))]
    assert found[0].q.tobytes() == found[1].q.tobytes()


@given(drawn=noisy(), Q=rotations, w=positive)
def test_a_run_does_not_care_how_the_world_is_turned(drawn, Q, w):
    made, E = drawn
    there = replace(made, inertial=quaternion.rotate(Q, made.inertial))
    chosen = weighted(w[: len(E)])
    assume(min(gap(E, U, w[: len(E)]) for U in made.body) > 1e-3)
    found = [biased(wahba.estimate(each, chosen)) for each in (made, there)]
    observing.assert_turned_world(*found, Q, atol=1e-7)


@given(case=observing.cases(), Q=observing.axis_turns)
def test_weights_along_the_worlds_axes_turn_along_with_it(case, Q):
    there = case.in_a_turned_world(Q)
    weights_there = config.VectorWeights(k=observing.turned_weights(K.weights.k, Q))
    chosen = K.model_copy(update={"weights": weights_there})
    found = wahba.estimate(case.samples(), K), wahba.estimate(there.samples(), chosen)
    observing.assert_turned_world(*map(biased, found), Q, atol=1e-7)


@given(case=observing.cases(), Q=rotations)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q):
    there = case.in_a_turned_body(Q)
    found = [biased(wahba.estimate(each.samples(), K)) for each in (case, there)]
    observing.assert_turned_body(*found, Q, atol=1e-7)


def test_where_no_vector_is_valid_the_gyroscope_carries_the_attitude():
    memoryless.assert_carried_by_the_gyroscope(wahba, K)


def test_where_one_vector_is_valid_it_is_fitted_and_the_gyroscope_carries_the_turn_about_it():
    memoryless.assert_one_vector_is_fitted(wahba, K)


def test_two_vectors_on_one_line_count_as_one():
    made, q = carried(300, [])
    alike = np.array([[0.0, 0.0, 1.0], [0.01, 0.0, 1.0]])
    alike /= np.linalg.norm(alike, axis=1, keepdims=True)
    made = observing.sampled(made.gyro, observing.seen(q, alike), alike)
    found = wahba.estimate(made, observing.starting(K, q[0]))
    assert angle_deg(found.q, q).max() < 1e-6


def test_it_has_no_memory_of_vectors():
    made, _ = carried(50, [])
    late = replace(made, t=made.t[20:], gyro=made.gyro[20:], body=made.body[20:])
    late = replace(late, valid=made.valid[20:], substeps=made.substeps[20:])
    late = replace(late, restart=np.arange(30) == 0)
    found = wahba.estimate(made, K), wahba.estimate(late, observing.starting(K, IDENTITY))
    assert angle_deg(found[0].q[20:], found[1].q).max() < 1e-9


def test_a_known_bias_is_taken_off_the_gyroscope():
    memoryless.assert_takes_off_a_known_bias(wahba, K)


def test_a_restart_forgets_what_was_before():
    made, q = carried(300, [(i, 95, 100) for i in range(3)])
    restart = np.isin(np.arange(300), [0, 100])
    made = replace(made, restart=restart)
    found = wahba.estimate(made, K)
    assert angle_deg(found.q, q).max() < 1e-6


@settings(max_examples=150)
@given(made=observing.any_samples(), by_vector=st.booleans())
def test_no_measurement_makes_a_nan(made, by_vector):
    chosen = weighted([1.0, 2.0, 0.5, 3.0]) if by_vector else wahba.Config()
    observing.assert_sound(biased(wahba.estimate(made, chosen)))


@pytest.mark.parametrize("axis", range(3))
def test_a_half_turn_is_found_at_once(axis):
    memoryless.assert_finds_a_half_turn(wahba, K, axis)


def test_steps_of_a_nanosecond_change_nothing():
    memoryless.assert_steps_need_length(wahba, K)


def test_without_any_vector_in_the_log_it_is_the_gyroscope():
    memoryless.assert_integrates(wahba, K)


def refusal(**weights):
    with pytest.raises(ConfigError) as caught:
        config.validate(wahba.Config, {"observer": "wahba", "weights": weights}, "my.yaml")
    return str(caught.value)


@pytest.mark.parametrize("w", [0.0, -1.0])
def test_a_weight_of_a_vector_that_is_not_positive_is_refused(w):
    assert refusal(w={"accel": 1.0, "mag": w}) == (
        f"my.yaml: 'weights.w.mag' is {w}. It must be: greater than 0."
    )


def test_weights_of_the_axes_that_are_alike_or_below_one_are_refused():
    for k in ([1, 1, 2], [0.5, 1, 2]):
        assert refusal(k=k).endswith(
            "three distinct values of at least 1 are needed [FTS, Lemma 1]."
        )


def test_a_gain_is_refused_for_there_are_none():
    with pytest.raises(ConfigError, match=r"my\.yaml: unknown key 'gains\.k_p'"):
        config.validate(wahba.Config, {"observer": "wahba", "gains": {"k_p": 1}}, "my.yaml")
