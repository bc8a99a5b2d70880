import numpy as np
import papers
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from strategies import NEAR, directions, rotations, vectors

from attest.geometry import mat3, quaternion, so3

matrices = vectors().flatmap(
    lambda a: vectors().flatmap(lambda b: vectors().map(lambda c: (a, b, c)))
)


def flat(A):
    return tuple(np.asarray(A, float).ravel().tolist())


def square(A):
    return np.array(A).reshape(3, 3)


@given(vectors(), vectors())
def test_vector_kernels_are_numpys(a, b):
    x, y = so3.as_vector(a), so3.as_vector(b)
    assert_allclose(so3.dot(x, y), a @ b, atol=1e-12)
    assert_allclose(so3.cross(x, y), np.cross(a, b), atol=1e-12)
    assert_allclose(so3.cross(x, y), papers.hat(a) @ b, atol=1e-12)
    assert_allclose(so3.add(x, y), a + b)
    assert_allclose(so3.sub(x, y), a - b)
    assert_allclose(so3.scale(-2.5, x), -2.5 * a)
    assert_allclose(so3.row(np.stack([a, b]), 1), b)


@given(matrices, matrices, vectors())
def test_matrix_kernels_are_numpys(A, B, v):
    A, B = np.array(A), np.array(B)
    assert_allclose(square(mat3.matmul(flat(A), flat(B))), A @ B, atol=1e-11)
    assert_allclose(square(mat3.transpose(flat(A))), A.T)
    assert_allclose(mat3.apply(flat(A), so3.as_vector(v)), A @ v, atol=1e-11)
    assert_allclose(mat3.vex2(flat(A)), papers.vex(A - A.T))


def test_identity_changes_nothing():
    assert mat3.matmul(mat3.IDENTITY, mat3.IDENTITY) == mat3.IDENTITY
    assert so3.matrix((1.0, 0.0, 0.0, 0.0)) == mat3.IDENTITY


@given(rotations, rotations)
def test_quaternion_kernels_are_those_by_array(a, b):
    x, y = so3.as_quaternion(a), so3.as_quaternion(b)
    assert_allclose(so3.multiply(x, y), quaternion.multiply(a, b), atol=1e-15)
    assert_allclose(so3.conjugate(x), quaternion.conjugate(a))
    assert_allclose(square(so3.matrix(x)), quaternion.to_matrix(a), atol=1e-15)
    assert_allclose(so3.normalize(so3.as_quaternion(3.0 * a)), a, atol=1e-15)


@given(vectors())
def test_exponential_is_that_of_the_matrix(phi):
    ours = square(so3.matrix(so3.exp(so3.as_vector(phi))))
    assert_allclose(ours, expm(papers.hat(phi)), atol=1e-12)


@given(directions)
def test_exponential_has_no_seam_where_the_series_takes_over(axis):
    for angle in (0.0, 1e-300, NEAR, 0.9999e-4, 1.0001e-4, np.pi, 2 * np.pi):
        phi = angle * axis
        assert_allclose(so3.exp(so3.as_vector(phi)), quaternion.exp(phi), rtol=1e-14, atol=1e-15)


@given(rotations, vectors(0.0625), st.floats(0.0, 1.0))
def test_between_is_the_way_at_a_constant_rate(q, phi, share):
    a, b = so3.as_quaternion(q), so3.multiply(so3.as_quaternion(q), so3.exp(so3.as_vector(phi)))
    exact = so3.multiply(a, so3.exp(so3.scale(share, so3.as_vector(phi))))
    assert_allclose(so3.between(a, b, share), exact, atol=2e-6)


@given(rotations, vectors(2.0), st.floats(0.0, 1.0))
def test_between_is_the_shorter_way_however_far(q, phi, share):
    a, b = so3.as_quaternion(q), so3.multiply(so3.as_quaternion(q), so3.exp(so3.as_vector(phi)))
    exact = so3.multiply(a, so3.exp(so3.scale(share, so3.as_vector(phi))))
    found = np.array(so3.between(a, b, share))
    assert_allclose(found * np.sign(found @ np.array(exact)), exact, atol=2e-6)
