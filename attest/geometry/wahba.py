"""Wahba's problem and the algebra that the observers share.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics": (6), (7), (12), (16), (48).
[Black64]  H. D. Black, "A passive system for determining the attitude of a satellite",
           AIAA J. 2(7).
[Davenport68]  P. B. Davenport, "A vector approach to the algebra of rotations", NASA TN D-4696.

Symbols: R estimate of the attitude, body to world; e_i, u_i unit vectors in the world and measured
in the body, E and U the matrices of them; K = diag(k1, k2, k3) weights along the world's axes;
W = E^T (E E^T)^-1 K (E E^T)^-1 E; L = E W U^T; B = R^T L; Omega_hat, Omega_b rates in the body.

With M = (E E^T)^-1 E U^T, the attitude that fits the vectors before it is made orthogonal,
L = K M: W itself, which grows with the number of vectors, is never formed.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import so3
from attest.geometry.jit import kernel
from attest.geometry.so3 import Matrix, Vector

Array = NDArray[np.float64]

MIN_SINE = 0.1
"""Two directions closer than this sine (5.7°) count as one: their cross product is mostly noise."""


@kernel
def _outer_sum(S: Matrix, a: Vector, b: Vector) -> Matrix:
    """Return S + a b^T."""
    return (
        S[0] + a[0] * b[0],
        S[1] + a[0] * b[1],
        S[2] + a[0] * b[2],
        S[3] + a[1] * b[0],
        S[4] + a[1] * b[1],
        S[5] + a[1] * b[2],
        S[6] + a[2] * b[0],
        S[7] + a[2] * b[1],
        S[8] + a[2] * b[2],
    )


@kernel
def _solve(G: Matrix, B: Matrix) -> tuple[float, Matrix]:
    """Return det(G) and G^-1 B of a symmetric G, by its adjugate; B itself where G is singular."""
    a = G[4] * G[8] - G[5] * G[5]
    b = G[2] * G[5] - G[1] * G[8]
    c = G[1] * G[5] - G[2] * G[4]
    d = G[0] * G[8] - G[2] * G[2]
    e = G[1] * G[2] - G[0] * G[5]
    f = G[0] * G[4] - G[1] * G[1]
    det = G[0] * a + G[1] * b + G[2] * c
    if det <= 0.0:
        return 0.0, B
    r = 1.0 / det
    adjugate = (r * a, r * b, r * c, r * b, r * d, r * e, r * c, r * e, r * f)
    return det, so3.matmul(adjugate, B)


@kernel
def _scale_rows(K: Vector, M: Matrix) -> Matrix:
    """Return diag(K) M."""
    return (
        K[0] * M[0],
        K[0] * M[1],
        K[0] * M[2],
        K[1] * M[3],
        K[1] * M[4],
        K[1] * M[5],
        K[2] * M[6],
        K[2] * M[7],
        K[2] * M[8],
    )


@kernel
def gain_matrix(
    E: Array, U: Array, valid: NDArray[np.bool_], K: Vector
) -> tuple[Matrix, float, int]:
    """Return L, the constant part of Wahba's cost, and the rank, from the vectors that are valid.

    L = E W U^T, [FTS] (16), W by (12). Two vectors are joined by their cross product, (6)-(7); so
    are more that lie in one plane. One vector alone (or two closer than `MIN_SINE`) has no such W:
    it gets the scalar weight (tr K + e^T K e)/2, the mean of what K gives to turns that the vector
    can see. None gives zero.

    Parameters
    ----------
    E, U
        Unit vectors in the world and measured in the body, shape (k, 3).
    valid
        Which of them to use, shape (k,).
    K
        Weights (k1, k2, k3) along the world's axes.

    Returns
    -------
    L : Matrix
    constant : float
        (tr K + <M, K M>)/2, so that the cost is ``constant - <R, L>``.
    rank : int
        3 where attitude can be told from the vectors, 1 or 0 where not.
    """
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    G = zero  # E E^T
    B = zero  # E U^T
    e1 = (0.0, 0.0, 0.0)
    u1 = (0.0, 0.0, 0.0)
    ec = (0.0, 0.0, 0.0)
    uc = (0.0, 0.0, 0.0)
    widest = -1.0
    count = 0
    for i in range(len(valid)):
        if not valid[i]:
            continue
        e = so3.row(E, i)
        u = so3.row(U, i)
        if count == 0:
            e1, u1 = e, u
        else:  # of the pairs with the first vector, the one most nearly at a right angle
            e_pair, u_pair = so3.cross(e1, e), so3.cross(u1, u)
            wide = min(so3.dot(e_pair, e_pair), so3.dot(u_pair, u_pair))
            if wide > widest:
                widest, ec, uc = wide, e_pair, u_pair
        G = _outer_sum(G, e, e)
        B = _outer_sum(B, e, u)
        count += 1
    if count == 0:
        return zero, 0.0, 0
    if widest < MIN_SINE * MIN_SINE:  # one direction
        w = 0.5 * (K[0] + K[1] + K[2] + K[0] * e1[0] ** 2 + K[1] * e1[1] ** 2 + K[2] * e1[2] ** 2)
        return _outer_sum(zero, so3.scale(w, e1), u1), w, 1
    det, M = _solve(G, B)
    if count == 2 or det < MIN_SINE**4:  # in one plane
        _, M = _solve(_outer_sum(G, ec, ec), _outer_sum(B, ec, uc))
    L = _scale_rows(K, M)
    constant = K[0] + K[1] + K[2]
    for i in range(9):
        constant += M[i] * L[i]
    return L, 0.5 * constant, 3


@kernel
def residual(B: Matrix) -> Vector:
    """Return s_L = vex(L^T R - R^T L) with B = R^T L, [FTS] after (31)."""
    return so3.vex2(so3.transpose(B))


@kernel
def cost(constant: float, B: Matrix) -> float:
    """Return Wahba's cost U = 1/2 <E - R U, (E - R U) W> = constant - tr(R^T L), [FTS] (11)."""
    return constant - (B[0] + B[4] + B[8])


@kernel
def _vex_turned(A: Matrix, x: Vector) -> Vector:
    """Return vex(A^T hat(x) + hat(x) A) = (tr(A) I - A) x."""
    trace = A[0] + A[4] + A[8]
    return so3.sub(so3.scale(trace, x), so3.apply(A, x))


@kernel
def residual_rate(B: Matrix, Omega_hat: Vector, Omega_b: Vector) -> Vector:
    """Return w_L = d s_L/dt for constant vectors in the world, [FTS] (48), [ESO] (27).

    vex(L^T R hat(Omega_hat) + hat(Omega_hat) R^T L) - vex(R^T L hat(Omega_b) + hat(Omega_b) L^T R).
    """
    return so3.sub(_vex_turned(B, Omega_hat), _vex_turned(so3.transpose(B), Omega_b))


def attitude(E: Array, U: Array, weights: Array | None = None) -> Array:
    """Solve Wahba's problem by Davenport's q method [Davenport68].

    Parameters
    ----------
    E, U
        Unit vectors in the world and in the body, shape (k, 3).
    weights
        One non-negative weight per vector, shape (k,); ones by default.

    Returns
    -------
    q : shape (4,)
        The rotation, body to world, that minimises sum w_i |e_i - R u_i|². With one direction only,
        the shortest one that fits; with none, the identity.
    """
    w = np.ones(len(E)) if weights is None else weights
    C = (w[:, np.newaxis] * E).T @ U
    N = np.empty((4, 4))
    N[0, 0] = np.trace(C)
    N[0, 1:] = N[1:, 0] = [C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]]
    N[1:, 1:] = C + C.T - np.trace(C) * np.eye(3)
    values, vectors = np.linalg.eigh(N)
    # eigenvectors of (nearly) the largest value span what the vectors cannot tell apart
    best = vectors[:, values > values[-1] - 1e-9]
    q: Array = best @ best[0]  # the rotation in that span nearest to the identity
    length = float(np.sqrt(q @ q))
    if length < 1e-9:  # a half turn: no scalar part to be near to
        return np.asarray(vectors[:, -1])
    return q / length


def triad(e1: Array, e2: Array, u1: Array, u2: Array) -> Array:
    """Return the rotation (3, 3), body to world, that fits u1 exactly and u2 as well as it can.

    [Black64]. All are unit vectors, shape (3,); e1, e2 in the world, u1, u2 in the body.
    """
    e3, u3 = np.cross(e1, e2), np.cross(u1, u2)
    e3, u3 = e3 / sqrt(e3 @ e3), u3 / sqrt(u3 @ u3)
    world = np.stack([e1, e3, np.cross(e1, e3)], axis=1)
    body = np.stack([u1, u3, np.cross(u1, u3)], axis=1)
    fitted: Array = world @ body.T
    return fitted
