import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation, Slerp
from strategies import NEAR, directions, rotations, vectors

from attest.geometry import quaternion

angles = st.floats(-3.0, 3.0)
SECOND = 1_000_000_000
UTC = 1_700_000_000 * SECOND


def scipy_of(q):
    return Rotation.from_quat(quaternion.to_xyzw(q))


def assert_same_rotation(a, b, atol=1e-12):
    sign = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    assert_allclose(a, sign * b, atol=atol)


@given(rotations, rotations)
def test_product_is_scipys(a, b):
    ours = quaternion.to_matrix(quaternion.multiply(a, b))
    assert_allclose(ours, (scipy_of(a) * scipy_of(b)).as_matrix(), atol=1e-14)


@given(rotations, vectors())
def test_turned_vector_is_scipys(q, v):
    assert_allclose(quaternion.rotate(q, v), scipy_of(q).apply(v), atol=1e-13)


@given(rotations)
def test_matrix_is_scipys(q):
    assert_allclose(quaternion.to_matrix(q), scipy_of(q).as_matrix(), atol=1e-14)


@given(vectors(20.0))
def test_exponential_is_scipys(phi):
    q = quaternion.exp(phi)
    assert_same_rotation(q, quaternion.from_xyzw(Rotation.from_rotvec(phi).as_quat()))


@given(rotations)
def test_logarithm_is_scipys(q):
    ours, theirs = quaternion.log(q), scipy_of(q).as_rotvec()
    if np.linalg.norm(theirs) > np.pi - 1e-9:  # a half turn has two
        theirs *= np.sign(ours @ theirs)
    assert_allclose(ours, theirs, atol=1e-12)


@given(angles, angles, angles)
def test_euler_angles_are_yaw_then_pitch_then_roll_as_scipys(roll, pitch, yaw):
    q = quaternion.from_euler(np.array(roll), np.array(pitch), np.array(yaw))
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    assert_same_rotation(q, quaternion.from_xyzw(expected))


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_come_back(roll, pitch, yaw):
    q = quaternion.from_euler(np.array(roll), np.array(pitch), np.array(yaw))
    assert_allclose(quaternion.to_euler(q), [roll, pitch, yaw], atol=1e-8)


@given(rotations)
def test_euler_angles_are_in_their_ranges(q):
    roll, pitch, yaw = quaternion.to_euler(q)
    assert abs(roll) <= np.pi
    assert abs(pitch) <= np.pi / 2
    assert abs(yaw) <= np.pi


@given(angles, angles, st.sampled_from([-1.0, 1.0]), st.sampled_from([0.0, 1e-9, 1e-8, 1e-6]))
def test_euler_angles_make_up_the_attitude_when_the_nose_points_straight_up(roll, yaw, up, short):
    pitch = np.array(up * (np.pi / 2 - short))
    q = quaternion.from_euler(np.array(roll), pitch, np.array(yaw))
    assert_same_rotation(quaternion.from_euler(*quaternion.to_euler(q)), q, atol=1e-9)


@given(rotations)
def test_euler_angles_make_up_any_attitude(q):
    assert_same_rotation(quaternion.from_euler(*quaternion.to_euler(q)), q, atol=1e-9)


@given(rotations, rotations, rotations)
def test_product_is_associative(a, b, c):
    left = quaternion.multiply(quaternion.multiply(a, b), c)
    assert_allclose(left, quaternion.multiply(a, quaternion.multiply(b, c)), atol=1e-14)


@given(rotations)
def test_conjugate_is_the_inverse(q):
    identity = [1.0, 0.0, 0.0, 0.0]
    assert_allclose(quaternion.multiply(q, quaternion.conjugate(q)), identity, atol=1e-14)
    assert_allclose(quaternion.multiply(quaternion.conjugate(q), q), identity, atol=1e-14)


@given(rotations, rotations, vectors())
def test_turning_twice_is_turning_by_the_product(a, b, v):
    twice = quaternion.rotate(a, quaternion.rotate(b, v))
    assert_allclose(quaternion.rotate(quaternion.multiply(a, b), v), twice, atol=1e-12)


@given(rotations, vectors(), vectors())
def test_turning_keeps_lengths_angles_and_handedness(q, a, b):
    turned = quaternion.rotate(q, a), quaternion.rotate(q, b)
    assert_allclose(turned[0] @ turned[1], a @ b, atol=1e-11)
    assert_allclose(np.cross(*turned), quaternion.rotate(q, np.cross(a, b)), atol=1e-11)


@given(rotations)
def test_logarithm_undoes_the_exponential(q):
    assert_same_rotation(quaternion.exp(quaternion.log(q)), q, atol=1e-14)
    assert np.linalg.norm(quaternion.log(q)) <= np.pi + 1e-15


@given(rotations)
def test_logarithm_takes_the_shorter_way_for_either_sign(q):
    assert np.linalg.norm(quaternion.log(-q)) <= np.pi + 1e-15
    assert_same_rotation(quaternion.exp(quaternion.log(-q)), q, atol=1e-14)


@given(directions, st.sampled_from([0.0, 1e-200, 1e-20, 1e-12, NEAR, 1e-3]))
def test_small_turns_keep_all_their_digits(axis, angle):
    assert_allclose(quaternion.log(quaternion.exp(angle * axis)), angle * axis, rtol=1e-12, atol=0)


def test_order_is_w_x_y_z():
    quarter_about_z = quaternion.exp(np.array([0.0, 0.0, np.pi / 2]))
    assert_allclose(quarter_about_z, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-15)
    assert_allclose(
        quaternion.rotate(quarter_about_z, np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-15
    )


def test_foreign_order_is_turned_row_by_row():
    q = np.arange(8.0).reshape(2, 4)
    assert_array_equal(quaternion.to_xyzw(q), [[1, 2, 3, 0], [5, 6, 7, 4]])
    assert_array_equal(quaternion.from_xyzw(quaternion.to_xyzw(q)), q)


def test_normalize_gives_unit_length_and_nan_for_zero():
    q = quaternion.normalize(np.array([[0.0, 3.0, 0.0, -4.0], [0.0, 0.0, 0.0, 0.0]]))
    assert_allclose(q[0], [0.0, 0.6, 0.0, -0.8])
    assert np.isnan(q[1]).all()


@given(st.lists(rotations, max_size=8), st.data())
def test_continuous_signs_never_jump_and_never_turn(q, data):
    q = np.array(q).reshape(-1, 4)
    signs = data.draw(st.lists(st.sampled_from([-1.0, 1.0]), min_size=len(q), max_size=len(q)))
    smooth = quaternion.continuous(q * np.array(signs).reshape(-1, 1))
    assert (np.sum(smooth[1:] * smooth[:-1], axis=1) >= 0.0).all()
    assert_array_equal(np.abs(smooth), np.abs(q))


def test_continuous_follows_a_body_through_many_turns():
    q = quaternion.exp(np.linspace(0.0, 40.0, 500)[:, np.newaxis] * np.array([0.6, 0.0, 0.8]))
    assert_allclose(quaternion.continuous(np.where(q[:, :1] < 0, -q, q)), q, atol=1e-15)


def test_functions_broadcast_one_over_many():
    q = quaternion.exp(np.random.default_rng(1).normal(size=(5, 1, 3)))
    v = np.random.default_rng(2).normal(size=(4, 3))
    turned = quaternion.rotate(q, v)
    assert turned.shape == (5, 4, 3)
    assert_allclose(turned[2, 3], quaternion.rotate(q[2, 0], v[3]), atol=1e-15)
    assert quaternion.multiply(q, q[0]).shape == (5, 1, 4)
    assert quaternion.to_matrix(q).shape == (5, 1, 3, 3)
    assert quaternion.to_euler(q).shape == (5, 1, 3)


@given(st.lists(rotations, min_size=2, max_size=6), st.data())
def test_slerp_is_scipys(q, data):
    q = np.array(q)
    apart = np.abs(np.sum(q[1:] * q[:-1], axis=1))
    q[1:][apart < 1e-3] = q[:-1][apart < 1e-3]  # of a half turn, either way is right
    steps = data.draw(st.lists(st.integers(1, SECOND), min_size=len(q), max_size=len(q)))
    t = UTC + np.cumsum(steps)
    at = np.sort(data.draw(st.lists(st.integers(int(t[0]), int(t[-1])), min_size=1, max_size=9)))
    ours = quaternion.slerp(t, q, at, longest_gap=SECOND)
    near = np.array([abs(a @ b) for a, b in zip(q[1:], q[:-1], strict=True)])
    if (near < 1e-3).any():
        return
    theirs = Slerp((t - t[0]) * 1e-9, scipy_of(q))((at - t[0]) * 1e-9)
    assert_same_rotation(ours, quaternion.from_xyzw(theirs.as_quat()), atol=1e-7)


QUARTERS = quaternion.exp(np.pi / 2 * np.arange(4.0)[:, np.newaxis] * np.array([0.0, 0.0, 1.0]))
TIMES = UTC + np.array([0, 1, 2, 6]) * SECOND


@pytest.mark.parametrize("longest_gap", [0, SECOND, 10 * SECOND])
def test_slerp_takes_a_stamps_own_rotation_as_it_is(longest_gap):
    assert_allclose(quaternion.slerp(TIMES, QUARTERS, TIMES, longest_gap), QUARTERS, atol=1e-15)


def test_slerp_never_crosses_a_gap():
    at = UTC + np.array([1_500_000_000, 4 * SECOND])
    inside, across = quaternion.slerp(TIMES, QUARTERS, at, longest_gap=2 * SECOND)
    assert_allclose(quaternion.log(inside), [0.0, 0.0, 0.75 * np.pi], atol=1e-9)
    assert np.isnan(across).all()
    bridged = quaternion.slerp(TIMES, QUARTERS, at, longest_gap=4 * SECOND)
    assert np.isfinite(bridged).all()


def test_slerp_knows_nothing_outside():
    at = np.array([TIMES[0] - 1, TIMES[-1] + 1, 0])
    assert np.isnan(quaternion.slerp(TIMES, QUARTERS, at, longest_gap=10 * SECOND)).all()
    assert np.isnan(quaternion.slerp(TIMES[:0], QUARTERS[:0], at, longest_gap=SECOND)).all()


def test_slerp_of_one_rotation_holds_at_its_stamp_only():
    at = TIMES[0] + np.array([-1, 0, 1])
    alone = quaternion.slerp(TIMES[:1], QUARTERS[:1], at, longest_gap=SECOND)
    assert np.isfinite(alone).all(axis=1).tolist() == [False, True, False]


def test_slerp_is_exact_to_the_nanosecond_in_this_century():
    t = UTC + np.array([0, 1000])
    q = quaternion.exp(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    at = UTC + np.arange(0, 1001, 50)
    turned = quaternion.log(quaternion.slerp(t, q, at, longest_gap=SECOND))
    assert_allclose(turned[:, 0], np.arange(0, 1001, 50) / 1000.0, atol=1e-14)
