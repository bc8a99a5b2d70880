import numpy as np
from flights import SECOND, START, angle_deg, at, body, rate, resting, stamps, tumbling
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from strategies import vectors

from attest.conditioning import frame
from attest.geometry import quaternion

DOWN = np.array([0.0, 0.6, 0.8])
T = stamps(100.0, 10.0)
D = frame.integrate(T, frame.mean_of_ends(rate(tumbling, at(T))))


def test_frame_turns_as_the_body_does():
    turned = quaternion.multiply(quaternion.conjugate(tumbling(at(T[:1]))), tumbling(at(T)))
    assert angle_deg(D, turned).max() < 0.01
    assert_allclose(D[0], [1.0, 0.0, 0.0, 0.0])
    assert_allclose(np.linalg.norm(D, axis=1), 1.0, atol=1e-14)


@given(vectors(5.0))
def test_frame_is_exact_for_a_constant_rate(omega):
    t = START + np.cumsum([0, 1, 7, 30, 200]) * 10_000_000
    ours = frame.integrate(t, np.broadcast_to(omega, (5, 3)).copy())
    exact = quaternion.exp(((t - START) * 1e-9)[:, np.newaxis] * omega)
    assert angle_deg(ours, exact).max() < 1e-6


def test_frame_is_held_outside_its_stamps():
    held = frame.at(T, D, np.array([T[0] - SECOND, T[-1] + SECOND]))
    assert_allclose(held, D[[0, -1]], atol=1e-15)


def test_nearest_samples_are_those_on_both_sides():
    stamps_, at_ = np.array([10, 20, 30]), np.array([5, 10, 15, 20, 29, 30, 40])
    left, right = frame.nearest(stamps_, at_)
    assert left.tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert right.tolist() == [0, 0, 1, 1, 2, 2, 2]


def test_vectors_on_the_gyroscopes_stamps_pass_as_they_are():
    y = np.random.default_rng(0).normal(size=(len(T), 3))
    carried, valid, age = frame.carry(T, D, T.copy(), y, max_age=0)
    assert_array_equal(carried, y)
    assert valid.all()
    assert not age.any()


def test_a_constant_direction_is_carried_exactly_between_sparse_samples():
    sparse = T[::50]  # every half second, while the body turns by up to 40°
    seen = body(tumbling, at(sparse), DOWN)
    carried, valid, _ = frame.carry(T, D, sparse, seen, max_age=SECOND)
    truth = body(tumbling, at(T), DOWN)
    assert valid.all()
    assert np.abs(carried - truth).max() < 1e-3
    straight = np.stack([np.interp(T, sparse, seen[:, i]) for i in range(3)], axis=1)
    assert np.abs(straight - truth).max() > 0.02


def test_a_vector_that_changes_in_the_world_is_linear_between_its_samples():
    still = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(T), 4))
    ends = T[[0, 500]]
    y = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    carried, _, _ = frame.carry(T, still, ends, y, max_age=SECOND)
    assert_allclose(carried[125], [0.75, 0.5, 0.0], atol=1e-12)
    assert_allclose(carried[-1], [0.0, 2.0, 0.0], atol=1e-12)


def test_a_sample_on_the_stamp_is_taken_as_it_is():
    sparse = T[::7]
    seen = np.random.default_rng(1).normal(size=(len(sparse), 3))
    carried, _, age = frame.carry(T, D, sparse, seen, max_age=SECOND)
    assert_allclose(carried[::7], seen, atol=1e-13)
    assert not age[::7].any()


@given(st.integers(0, 60))
def test_a_vector_is_valid_up_to_its_greatest_age_and_no_further(hundredths):
    max_age = hundredths * 10_000_000
    sparse = T[[200, 300]]
    seen = body(tumbling, at(sparse), DOWN)
    carried, valid, age = frame.carry(T, D, sparse, seen, max_age)
    apart = np.minimum(np.abs(T - sparse[0]), np.abs(T - sparse[1]))
    assert_array_equal(age, apart)
    assert_array_equal(valid, apart <= max_age)
    assert np.isfinite(carried).all()


def test_a_single_sample_is_carried_both_ways():
    one = T[500:501]
    carried, _, _ = frame.carry(T, D, one, body(tumbling, at(one), DOWN), max_age=SECOND)
    assert np.abs(carried - body(tumbling, at(T), DOWN)).max() < 1e-3


def test_at_rest_nothing_turns():
    still = frame.integrate(T, frame.mean_of_ends(rate(resting, at(T))))
    assert angle_deg(still, still[:1]).max() < 1e-9


def test_a_turning_axis_is_integrated_from_mean_rates():
    fine, each = 1e-4, 100  # 10 ms
    at = np.arange(50_000) * fine
    rate = np.column_stack([np.sin(7.0 * at), np.cos(7.0 * at), 0.2 * np.sin(3.0 * at)]) * 5.0
    D = frame.integrate(np.arange(50_001) * 100_000, np.concatenate([rate, rate[-1:]]))[::each]
    mean = np.concatenate([np.zeros((1, 3)), rate.reshape(-1, each, 3).mean(axis=1)])
    h = np.full(len(mean), fine * each)
    over = np.concatenate([mean[1:], mean[-1:]])
    coned = over.copy()
    frame.cone(h, mean, np.zeros(len(h), np.bool_), coned)
    t = np.arange(len(h)) * 10_000_000
    plain = angle_deg(frame.integrate(t, over), D).max()
    better = angle_deg(frame.integrate(t, coned), D).max()
    assert plain > 0.3
    assert better < 0.05 * plain


def test_a_divided_step_is_not_coned():
    over = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    at, h = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), np.array([0.0, 0.1, 0.1])
    coned = over.copy()
    frame.cone(h, at, np.array([False, False, True]), coned)
    assert_allclose(coned[0], over[0], atol=0)  # nothing before it is known
    assert_allclose(coned[1], over[1] + 0.1 / 12.0 * np.cross(at[1], at[2]), atol=1e-15)
    coned = over.copy()
    frame.cone(h, at, np.array([False, True, True]), coned)
    assert_allclose(coned, over, atol=0)
