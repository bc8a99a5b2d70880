import numpy as np
import papers
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from strategies import directions, frames, rotations, vectors, weights

from attest.geometry import quaternion, so3, wahba

NONE = np.empty((0, 6))
counts = pytest.mark.parametrize("count", [2, 3, 5])


def square(A):
    return np.array(A).reshape(3, 3)


def as_kernel(K):
    return so3.as_vector(np.asarray(K, float))


def gain_matrix(E, U, K, valid=None):
    """Return L, the cost's constant part and whether attitude can be told, of one step."""
    valid = np.ones(len(E), np.bool_) if valid is None else np.array(valid)
    out = np.full((1, 10), np.nan)
    wahba.gain_matrices(E[np.newaxis], U[np.newaxis], valid[np.newaxis], as_kernel(K), out, NONE)
    L = out[0, :9].reshape(3, 3)
    return L, out[0, 9], np.linalg.matrix_rank(L, tol=1e-9)


def flat(A):
    return tuple(np.asarray(A, float).ravel().tolist())


def measured(data, E, noise=0.05):
    """Draw what the body sees of E at an attitude, a little wrong."""
    R = quaternion.to_matrix(data.draw(rotations))
    off = np.stack([data.draw(vectors(1.0)) for _ in E])
    U = E @ R + noise * off
    return R, U / np.linalg.norm(U, axis=1, keepdims=True)


@counts
@given(data=st.data(), K=weights)
def test_weights_make_e_w_e_transposed_the_k_that_was_asked_for(count, data, K):
    E, _ = papers.joined(data.draw(frames(count)).T, np.eye(3)[:, :count])
    assert_allclose(E @ papers.W(E, np.diag(K)) @ E.T, np.diag(K), atol=1e-9 * max(K))


@counts
@given(data=st.data(), K=weights)
def test_gain_matrix_is_the_papers_e_w_u_transposed(count, data, K):
    E = data.draw(frames(count))
    _, U = measured(data, E)
    L, _, rank = gain_matrix(E, U, K)
    expected = papers.L(*papers.joined(E.T, U.T), np.diag(K))
    assert rank == 3
    assert_allclose(L, expected, atol=1e-9 * max(K))


@counts
@given(data=st.data(), K=weights, Q=rotations)
def test_cost_is_wahbas_up_to_what_no_attitude_can_change(count, data, K, Q):
    E = data.draw(frames(count))
    _, U = measured(data, E)
    R = quaternion.to_matrix(Q)
    L, constant, _ = gain_matrix(E, U, K)
    ours = wahba.cost(constant, flat(R.T @ L)) - wahba.cost(constant, flat(L))
    E, U = papers.joined(E.T, U.T)
    theirs = papers.cost(R, E, U, np.diag(K)) - papers.cost(np.eye(3), E, U, np.diag(K))
    assert_allclose(ours, theirs, atol=1e-8 * max(K))


@given(data=st.data(), K=weights, Q=rotations)
def test_cost_of_three_vectors_is_wahbas(data, K, Q):
    E = data.draw(frames(3))
    _, U = measured(data, E)
    R = quaternion.to_matrix(Q)
    L, constant, _ = gain_matrix(E, U, K)
    ours = wahba.cost(constant, flat(R.T @ L))
    assert_allclose(ours, papers.cost(R, E.T, U.T, np.diag(K)), atol=1e-8 * max(K))


@counts
@given(data=st.data(), K=weights)
def test_cost_is_nothing_at_the_truth_and_never_negative(count, data, K):
    E = data.draw(frames(count))
    R, U = measured(data, E, noise=0.0)
    L, constant, _ = gain_matrix(E, U, K)
    assert_allclose(wahba.cost(constant, flat(R.T @ L)), 0.0, atol=1e-9 * max(K))
    Q = quaternion.to_matrix(data.draw(rotations))
    cost = wahba.cost(constant, flat(Q.T @ L))
    assert cost > -1e-9 * max(K)
    assert_allclose(cost, np.trace(np.diag(K) @ (np.eye(3) - R @ Q.T)), atol=1e-9 * max(K))


@counts
@given(data=st.data(), K=weights, Q=rotations)
def test_residual_is_predicted_cross_measured(count, data, K, Q):
    E = data.draw(frames(count))
    _, U = measured(data, E)
    R = quaternion.to_matrix(Q)
    L, _, _ = gain_matrix(E, U, K)
    s = wahba.residual(flat(R.T @ L))
    assert_allclose(s, papers.s_L(R, L), atol=1e-9 * max(K))
    e, u = papers.joined(E.T, U.T)
    v, W = R.T @ e, papers.W(e, np.diag(K))
    pairs = [
        W[i, j] * np.cross(v[:, i], u[:, j]) for i in range(W.shape[0]) for j in range(W.shape[1])
    ]
    assert_allclose(s, np.sum(pairs, axis=0), atol=1e-8 * max(K))


@given(data=st.data(), K=weights, Q=rotations, Omega_hat=vectors(), Omega_b=vectors())
def test_residual_rate_is_eq_48(data, K, Q, Omega_hat, Omega_b):
    E = data.draw(frames(3))
    _, U = measured(data, E)
    R = quaternion.to_matrix(Q)
    L, _, _ = gain_matrix(E, U, K)
    ours = wahba.residual_rate(flat(R.T @ L), as_kernel(Omega_hat), as_kernel(Omega_b))
    assert_allclose(ours, papers.w_L(R, L, Omega_hat, Omega_b), atol=1e-8 * max(K))


@counts
@given(data=st.data(), K=weights, Omega_hat=vectors(), Omega_b=vectors())
def test_residual_rate_is_how_the_residual_changes(count, data, K, Omega_hat, Omega_b):
    E = data.draw(frames(count))
    _, U = measured(data, E)
    R = quaternion.to_matrix(data.draw(rotations))

    def residual(h):
        R_h, U_h = R @ papers.exp(h * Omega_hat), U @ papers.exp(h * Omega_b)
        L, _, _ = gain_matrix(E, U_h, K)
        return np.array(wahba.residual(flat(R_h.T @ L)))

    L, _, _ = gain_matrix(E, U, K)
    rate = wahba.residual_rate(flat(R.T @ L), as_kernel(Omega_hat), as_kernel(Omega_b))
    h = 1e-5
    difference = (residual(h) - residual(-h)) / (2 * h)
    assert_allclose(rate, difference, atol=1e-4 * max(K))


@counts
@given(data=st.data(), K=weights, Omega=vectors(), Omega_hat=vectors())
def test_cost_falls_along_the_residual(count, data, K, Omega, Omega_hat):
    E = data.draw(frames(count))
    R_true, _ = measured(data, E, noise=0.0)
    R = quaternion.to_matrix(data.draw(rotations))

    def cost(h):
        U = E @ R_true @ papers.exp(h * Omega)
        L, constant, _ = gain_matrix(E, U, K)
        return wahba.cost(constant, flat((R @ papers.exp(h * Omega_hat)).T @ L))

    L, _, _ = gain_matrix(E, E @ R_true, K)
    s, h = np.array(wahba.residual(flat(R.T @ L))), 1e-5
    assert_allclose((cost(h) - cost(-h)) / (2 * h), -s @ (Omega - Omega_hat), atol=1e-4 * max(K))


@given(data=st.data(), K=weights)
def test_vectors_that_are_not_valid_do_not_count(data, K):
    E = data.draw(frames(5))
    _, U = measured(data, E)
    valid = np.array([True, False, True, True, False])
    some = gain_matrix(E[valid], U[valid], K)
    U[~valid] = np.nan
    masked = gain_matrix(E, U, K, valid)
    assert_allclose(masked[0], some[0])
    assert masked[1:] == some[1:]


@given(e=directions, u=directions, K=weights)
def test_one_vector_has_the_mean_weight_of_the_turns_that_it_sees(e, u, K):
    L, constant, rank = gain_matrix(np.stack([e]), np.stack([u]), K)
    weight = 0.5 * (np.sum(K) + e @ np.diag(K) @ e)
    assert rank == 1
    assert_allclose(L, weight * np.outer(e, u), atol=1e-12)
    assert_allclose(wahba.cost(constant, flat(L)), weight * (1.0 - e @ u), atol=1e-12)
    # K gives a turn about x the stiffness (tr K) I - K: its mean over the plane across e
    stiffness = np.trace(np.diag(K)) * np.eye(3) - np.diag(K)
    across = np.eye(3) - np.outer(e, e)
    assert_allclose(weight, 0.5 * np.trace(across @ stiffness), rtol=1e-12)


def test_no_vector_pulls_nowhere():
    for E in (np.empty((0, 3)), np.eye(3)):
        valid = np.zeros(len(E), np.bool_)
        L, constant, rank = gain_matrix(E, E, (3.0, 2.0, 1.0), valid)
        assert (constant, rank) == (0.0, 0)
        assert not L.any()


@given(e=directions, u=directions, K=weights)
def test_vectors_along_one_line_count_as_one(e, u, K):
    both = gain_matrix(np.stack([e, e]), np.stack([u, u]), K)
    one = gain_matrix(np.stack([e]), np.stack([u]), K)
    assert both[2] == 1
    assert_allclose(both[0], one[0], atol=1e-12)


@given(data=st.data(), K=weights)
def test_three_vectors_in_a_plane_are_joined_by_their_cross_product(data, K):
    a, b = data.draw(frames(2))
    middle = (a + b) / np.linalg.norm(a + b)
    E = np.stack([a, b, middle])
    R, U = measured(data, E, noise=0.0)
    L, constant, rank = gain_matrix(E, U, K)
    assert rank == 3
    assert_allclose(L, np.diag(K) @ R, atol=1e-8 * max(K))
    assert_allclose(constant, np.sum(K), rtol=1e-8)


@given(data=st.data(), K=weights)
def test_a_measurement_without_length_never_gives_nan(data, K):
    E = data.draw(frames(data.draw(st.integers(2, 5))))
    U = np.stack([data.draw(directions | st.just(np.zeros(3))) for _ in E])
    L, constant, _ = gain_matrix(E, U, K)
    assert np.isfinite(L).all()
    assert np.isfinite(constant)


@given(data=st.data(), K=weights)
def test_many_steps_are_each_step_alone(data, K):
    """Weights of constant vectors are kept while the same ones are valid; nobody can tell."""
    k = data.draw(st.integers(1, 4))
    E = np.stack([data.draw(directions) for _ in range(k)])
    U = np.array([[data.draw(directions) for _ in range(k)] for _ in range(6)])
    valid = np.array([data.draw(st.lists(st.booleans(), min_size=k, max_size=k)) for _ in range(6)])
    still, moving = np.empty((6, 10)), np.empty((6, 10))
    wahba.gain_matrices(E[np.newaxis], U, valid, as_kernel(K), still, NONE)
    wahba.gain_matrices(np.stack([E] * 6), U, valid, as_kernel(K), moving, NONE)
    alone = [gain_matrix(E, U[i], K, valid[i]) for i in range(6)]
    assert_allclose(still, moving, atol=1e-12)
    assert_allclose(still[:, :9], [L.ravel() for L, _, _ in alone], atol=1e-12)
    assert_allclose(still[:, 9], [constant for _, constant, _ in alone], atol=1e-12)
