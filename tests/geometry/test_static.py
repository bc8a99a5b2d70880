import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from strategies import directions, frames, rotations, vectors

from attest.geometry import quaternion, so3, static

counts = pytest.mark.parametrize("count", [2, 3, 5])


def measured(data, E, noise=0.05):
    """Draw what the body sees of E at an attitude, a little wrong."""
    R = quaternion.to_matrix(data.draw(rotations))
    off = np.stack([data.draw(vectors(1.0)) for _ in E])
    U = E @ R + noise * off
    return R, U / np.linalg.norm(U, axis=1, keepdims=True)


def triad(E, U):
    """Return the rotation matrix of two vectors."""
    return np.array(static.triad(*map(so3.as_vector, (E[0], E[1], U[0], U[1])))).reshape(3, 3)


def closest(L, near):
    """Return the quaternion that maximises <R, L>."""
    work = np.empty((2, 4, 4))
    flat = tuple(np.asarray(L, float).ravel().tolist())
    return np.array(static.closest(flat, so3.as_quaternion(near), *work))


@counts
@given(data=st.data())
def test_attitude_is_scipys_align_vectors(count, data):
    E = data.draw(frames(count))
    _, U = measured(data, E)
    w = np.array(data.draw(st.lists(st.floats(0.5, 5.0), min_size=count, max_size=count)))
    ours = quaternion.to_matrix(static.attitude(E, U, w))
    theirs = Rotation.align_vectors(E, U, weights=w)[0].as_matrix()
    assert_allclose(ours, theirs, atol=1e-6)


@counts
@given(data=st.data())
def test_attitude_is_the_truth_without_noise(count, data):
    E = data.draw(frames(count))
    R, U = measured(data, E, noise=0.0)
    assert_allclose(quaternion.to_matrix(static.attitude(E, U)), R, atol=1e-7)


@given(e=directions, u=directions)
def test_attitude_of_one_vector_is_the_shortest_turn_that_fits(e, u):
    assume(np.linalg.norm(e + u) > 1e-3)
    q = static.attitude(np.stack([e]), np.stack([u]))
    assert_allclose(quaternion.rotate(q, u), e, atol=1e-7)
    turn = np.linalg.norm(quaternion.log(q))
    assert_allclose(turn, np.arctan2(np.linalg.norm(np.cross(u, e)), u @ e), atol=1e-6)


@given(e=directions)
def test_attitude_of_one_vector_upside_down_is_a_half_turn_that_fits(e):
    q = static.attitude(np.stack([e]), np.stack([-e]))
    assert_allclose(np.linalg.norm(q), 1.0, atol=1e-12)
    assert_allclose(quaternion.rotate(q, -e), e, atol=1e-7)


def test_attitude_of_no_vector_is_the_identity():
    assert_allclose(static.attitude(np.empty((0, 3)), np.empty((0, 3))), [1.0, 0.0, 0.0, 0.0])


@given(e=directions, Q=rotations)
def test_attitude_of_collinear_vectors_fits_them_all(e, Q):
    E = np.stack([e, -e, e])
    U = E @ quaternion.to_matrix(Q)
    assume(np.linalg.norm(e + U[0]) > 1e-3)
    q = static.attitude(E, U)
    assert_allclose(quaternion.rotate(q, U), E, atol=1e-7)


@given(data=st.data())
def test_triad_fits_the_first_exactly_and_the_second_in_their_plane(data):
    E = data.draw(frames(2))
    R_true, U = measured(data, E, noise=0.1)
    assume(np.linalg.norm(np.cross(U[0], U[1])) > 1e-2)
    R = triad(E, U)
    assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)
    assert_allclose(R @ U[0], E[0], atol=1e-12)
    assert_allclose(np.cross(E[0], E[1]) @ R @ U[1], 0.0, atol=1e-12)
    assert_allclose(triad(E, E @ R_true), R_true, atol=1e-7)


@given(near=rotations)
def test_closest_of_no_vector_is_what_it_is_near(near):
    q = closest(np.zeros((3, 3)), near)
    assert_allclose(quaternion.to_matrix(q), quaternion.to_matrix(near), atol=1e-12)


@given(e=directions, near=rotations, Q=rotations)
def test_closest_of_one_vector_turns_the_least_from_what_it_is_near(e, near, Q):
    u = quaternion.rotate(quaternion.conjugate(Q), e)
    predicted = quaternion.rotate(near, u)
    assume(np.linalg.norm(predicted + e) > 1e-3)
    q = closest(np.outer(e, u), near)
    assert_allclose(quaternion.rotate(q, u), e, atol=1e-7)
    turn = np.linalg.norm(quaternion.log(quaternion.multiply(q, quaternion.conjugate(near))))
    least = np.arctan2(np.linalg.norm(np.cross(predicted, e)), predicted @ e)
    assert_allclose(turn, least, atol=1e-6)


@given(q=rotations)
def test_closest_finds_a_rotation_again_to_rounding(q):
    R = quaternion.to_matrix(q)
    found = closest(np.diag([3.0, 2.0, 1.0]) @ R, np.array([1.0, 0.0, 0.0, 0.0]))
    assert_allclose(quaternion.to_matrix(found), R, atol=1e-13)


@given(q=rotations)
def test_a_matrix_gives_its_quaternion_back(q):
    flat = tuple(quaternion.to_matrix(q).ravel().tolist())
    found = np.array(so3.from_matrix(flat))
    assert_allclose(quaternion.to_matrix(found), quaternion.to_matrix(q), atol=1e-13)
