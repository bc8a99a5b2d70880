from dataclasses import replace

import memoryless
import numpy as np
import observing
import papers
import papers_rigid
import pytest
from flights import angle_deg, samples
from hypothesis import given, settings
from hypothesis import strategies as st
from memoryless import HIDDEN, carried, noisy
from numpy.testing import assert_allclose
from papers_rigid import biased
from strategies import rotations

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.observers import triad, wahba

CONFIG = triad.Config()


@given(drawn=noisy(most=2))
@settings(max_examples=200)
def test_each_step_is_the_textbooks_formula(drawn):
    made, E = drawn
    found = triad.estimate(made, CONFIG)
    for q, U in zip(found.q, made.body, strict=True):
        assert_allclose(quaternion.to_matrix(q), papers_rigid.triad(E.T, U.T), atol=1e-9)
    assert_allclose(quaternion.rotate(found.q, made.body[:, 0]), np.tile(E[0], (3, 1)), atol=1e-9)


@given(drawn=noisy(most=2), heavy=st.sampled_from([1e5, 1e6]))
def test_it_is_wahbas_solution_where_the_first_vector_outweighs_the_second(drawn, heavy):
    made, _ = drawn
    chosen = wahba.Config(weights=config.VectorWeights(w={"v1": heavy, "v2": 1.0}))
    apart = angle_deg(triad.estimate(made, CONFIG).q, wahba.estimate(made, chosen).q)
    assert np.deg2rad(apart).max() < 2.0 / heavy


@given(drawn=noisy(4, 4))
def test_of_more_vectors_the_first_goes_with_the_one_most_at_a_right_angle_to_it(drawn):
    made, E = drawn
    second = 1 + int(np.argmax(np.linalg.norm(np.cross(E[0], E[1:]), axis=1)))
    found = triad.estimate(made, CONFIG)
    for q, U in zip(found.q, made.body, strict=True):
        pair = [0, second]
        expected = papers_rigid.triad(E[pair].T, U[pair].T)
        assert_allclose(quaternion.to_matrix(q), expected, atol=1e-9)


def test_vectors_that_are_not_valid_are_left_out():
    rng = np.random.default_rng(1)
    E, U = np.eye(3), np.eye(3) + 0.1 * rng.normal(size=(4, 3, 3))
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    valid = np.array([[True] * 3, [False, True, True], [True, False, True], [True, True, False]])
    found = triad.estimate(observing.sampled(np.zeros((4, 3)), U, E, valid=valid), CONFIG)
    for i, pair in ((1, [1, 2]), (2, [0, 2]), (3, [0, 1])):
        expected = papers_rigid.triad(E[pair].T, U[i, pair].T)
        assert_allclose(quaternion.to_matrix(found.q[i]), expected, atol=1e-9)


def test_known_vectors_may_move():
    rng = np.random.default_rng(2)
    E, U = rng.normal(size=(2, 5, 2, 3))
    E /= np.linalg.norm(E, axis=2, keepdims=True)
    U /= np.linalg.norm(U, axis=2, keepdims=True)
    made = samples(np.arange(5) * 10_000_000, np.zeros((5, 3)), U, E)
    found = triad.estimate(made, CONFIG)
    for q, e, u in zip(found.q, E, U, strict=True):
        assert_allclose(quaternion.to_matrix(q), papers_rigid.triad(e.T, u.T), atol=1e-9)


@given(drawn=noisy(most=2))
def test_diagnostics_are_the_residual_and_wahbas_cost_by_the_weights(drawn):
    made, E = drawn
    k = np.diag(CONFIG.weights.k)
    found = triad.estimate(made, CONFIG)
    for i, U in enumerate(made.body):
        e, u = papers.joined(E.T, U.T)
        R = quaternion.to_matrix(found.q[i])
        s = papers.s_L(R, papers.L(e, u, k))
        assert_allclose(found.s_norm[i], np.linalg.norm(s), atol=1e-7)
        assert_allclose(found.cost[i], papers.cost(R, e, u, k), atol=1e-7)
    assert_allclose(found.angular_velocity, made.gyro)
    assert found.gyro_bias is None


@given(drawn=noisy(3, 3), Q=rotations)
def test_a_run_does_not_care_how_the_world_is_turned(drawn, Q):
    made, _ = drawn
    there = replace(made, inertial=quaternion.rotate(Q, made.inertial))
    found = [triad.estimate(each, CONFIG).q for each in (made, there)]
    assert angle_deg(quaternion.multiply(Q, found[0]), found[1]).max() < 1e-6


@given(case=observing.cases(), Q=rotations)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q):
    there = case.in_a_turned_body(Q)
    found = [biased(triad.estimate(each.samples(), CONFIG)) for each in (case, there)]
    observing.assert_turned_body(*found, Q, atol=1e-7)


def test_where_no_vector_is_valid_the_gyroscope_carries_the_attitude():
    memoryless.assert_carried_by_the_gyroscope(triad, CONFIG)


def test_where_one_vector_is_valid_it_is_fitted_and_the_gyroscope_carries_the_turn_about_it():
    memoryless.assert_one_vector_is_fitted(triad, CONFIG)


@pytest.mark.parametrize("alike_in", ["world", "body"])
def test_two_vectors_on_one_line_in_world_or_body_count_as_one(alike_in):
    made, q = carried(100, [])
    line = np.array([[0.0, 0.0, 1.0], [0.01, 0.0, 1.0]])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    wide = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    E, seen = (line, wide) if alike_in == "world" else (wide, line)
    made = observing.sampled(made.gyro, observing.seen(q, seen), E)
    found = triad.estimate(made, observing.starting(CONFIG, q[0]))
    observing.assert_sound(biased(found))
    third = quaternion.rotate(found.q, made.body[:, 0])
    assert_allclose(third, np.broadcast_to(E[0], (100, 3)), atol=1e-6)
    assert angle_deg(found.q, q).max() < 1e-6


def test_a_known_bias_is_taken_off_the_gyroscope():
    memoryless.assert_takes_off_a_known_bias(triad, CONFIG)


def test_a_restart_forgets_what_was_before():
    made, q = carried(300, HIDDEN)
    made = replace(made, restart=np.isin(np.arange(300), [0, 150]))
    found = triad.estimate(made, CONFIG)
    assert angle_deg(found.q, q).max() < 1e-6  # led back from the first vectors


@settings(max_examples=150)
@given(made=observing.any_samples())
def test_no_measurement_makes_a_nan(made):
    observing.assert_sound(biased(triad.estimate(made, CONFIG)))


@pytest.mark.parametrize("axis", range(3))
def test_a_half_turn_is_found_at_once(axis):
    memoryless.assert_finds_a_half_turn(triad, CONFIG, axis)


def test_steps_of_a_nanosecond_change_nothing():
    memoryless.assert_steps_need_length(triad, CONFIG)


def test_without_any_vector_in_the_log_it_is_the_gyroscope():
    memoryless.assert_integrates(triad, CONFIG)


def test_weights_of_vectors_and_gains_are_refused_for_there_are_none():
    for section, key in (("weights", "w"), ("gains", "k_p")):
        document = {"observer": "triad", section: {key: {"accel": 1.0}}}
        with pytest.raises(ConfigError, match=rf"my\.yaml: unknown key '{section}\.{key}'"):
            config.validate(triad.Config, document, "my.yaml")
