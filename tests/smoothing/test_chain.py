import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import cho_factor, cho_solve

from attest.smoothing import chain

SIZE, CONSTANTS = 3, 2


def dense(nodes, seed):
    """Return a matrix of that shape, made of factors between neighbours, and a right side."""
    rng = np.random.default_rng(seed)
    total = nodes * SIZE + CONSTANTS
    J = rng.normal(size=(nodes, 8, total))
    for k in range(nodes):
        far = np.ones(total, np.bool_)
        far[k * SIZE : min(k + 2, nodes) * SIZE] = far[nodes * SIZE :] = False
        J[k][:, far] = 0.0
    return sum(j.T @ j for j in J), rng.normal(size=total)


def as_chain(A, b, nodes):
    """Return the same as blocks."""
    made, border = chain.empty(nodes, SIZE, CONSTANTS), slice(nodes * SIZE, None)
    for k in range(nodes):
        here, following = slice(k * SIZE, (k + 1) * SIZE), slice((k + 1) * SIZE, (k + 2) * SIZE)
        made.H[k], made.B[k, :, :-1], made.B[k, :, -1] = A[here, here], A[here, border], b[here]
        if k + 1 < nodes:
            made.U[k] = A[here, following]
    made.C[:, :-1], made.C[:, -1] = A[border, border], b[border]
    return made


def solved(made, nodes):
    z, z_c = np.empty((nodes, SIZE)), np.empty(CONSTANTS)
    P_c, P = np.empty((CONSTANTS, CONSTANTS)), np.empty((nodes, SIZE, SIZE))
    chain.solve(made, z, z_c, P_c)
    chain.covariances(made, P_c, P)
    return z, z_c, P_c, P


@given(nodes=st.integers(1, 8), seed=st.integers(0, 1000))
def test_it_solves_what_a_dense_solver_solves_and_knows_the_same_covariances(nodes, seed):
    A, b = dense(nodes, seed)
    z, z_c, P_c, P = solved(as_chain(A, b, nodes), nodes)
    factor = cho_factor(A)
    x, inverse = cho_solve(factor, b), cho_solve(factor, np.eye(len(b)))
    scale = np.abs(inverse).max()
    assert_allclose(np.append(z, z_c), x, atol=1e-9 * np.abs(x).max())
    assert_allclose(P_c, inverse[-CONSTANTS:, -CONSTANTS:], atol=1e-9 * scale)
    for k in range(nodes):
        here = slice(k * SIZE, (k + 1) * SIZE)
        assert_allclose(P[k], inverse[here, here], atol=1e-9 * scale)


def test_what_nothing_tells_stays_where_it_is():
    made = chain.empty(3, SIZE, CONSTANTS)
    for k in range(3):
        made.H[k, 0, 0], made.B[k, 0, -1] = 2.0, 4.0
    made.C[0, 0], made.C[0, -1] = 1.0, 3.0
    z, z_c, _, _ = solved(made, 3)
    assert_allclose(z, [[2.0, 0.0, 0.0]] * 3)
    assert_allclose(z_c, [3.0, 0.0])


@pytest.mark.parametrize("nodes", [1, 100])
def test_memory_is_that_of_the_nodes(nodes):
    assert sum(block.size for block in chain.empty(nodes, 3, 2)[:3]) == nodes * (9 + 9 + 9)
