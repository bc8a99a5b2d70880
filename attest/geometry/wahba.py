"""Wahba's problem and the algebra that the observers share.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics": (6), (7), (12), (16), (48).

Symbols: R estimate of the attitude, body to world; e_i, u_i unit vectors in the world and measured
in the body, E and U the matrices of them; K = diag(k1, k2, k3) weights along the world's axes;
W = E^T (E E^T)^-1 K (E E^T)^-1 E; L = E W U^T; B = R^T L; Omega_hat, Omega_b rates in the body.

With M = (E E^T)^-1 E U^T, the attitude that fits the vectors before it is made orthogonal,
L = K M: W itself, which grows with the number of vectors, is never formed.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.directions import MIN_SINE, close, widest
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]

ZERO: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def outer_sum(S: Matrix, a: Vector, b: Vector) -> Matrix:
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
def _inverse(G: Matrix) -> tuple[float, Matrix]:
    """Return det(G) and G^-1 of a symmetric G by its adjugate; G itself where it is singular."""
    a = G[4] * G[8] - G[5] * G[5]
    b = G[2] * G[5] - G[1] * G[8]
    c = G[1] * G[5] - G[2] * G[4]
    d = G[0] * G[8] - G[2] * G[2]
    e = G[1] * G[2] - G[0] * G[5]
    f = G[0] * G[4] - G[1] * G[1]
    det = G[0] * a + G[1] * b + G[2] * c
    if det <= 0.0:
        return 0.0, G
    r = 1.0 / det
    return det, (r * a, r * b, r * c, r * b, r * d, r * e, r * c, r * e, r * f)


@kernel
def _weighting(
    E: Array, i: int, valid: NDArray[np.bool_], step: int, K: Vector, A: Array
) -> tuple[int, int, bool]:
    """Fill A (k + 1, 3) with the columns of K (E E^T)^-1 E, [FTS] (12); the last is e1 x e2's.

    Returns
    -------
    first, second : int
        The vectors whose cross product joins; -1 where there is none.
    joined : bool
        Whether it does: for two vectors, and for more that lie in one plane.
    """
    first, second = widest(E, i, valid, step)
    G = ZERO
    count = 0
    for j in range(valid.shape[1]):
        if valid[step, j]:
            G = outer_sum(G, so3.item(E, i, j), so3.item(E, i, j))
            count += 1
    if second < 0:
        return first, second, False
    e3 = so3.cross(so3.item(E, i, first), so3.item(E, i, second))
    det, inverse = _inverse(G)
    joined = count == 2 or det < MIN_SINE**4
    if joined:
        _, inverse = _inverse(outer_sum(G, e3, e3))
    for j in range(valid.shape[1] + 1):
        e = e3 if j == valid.shape[1] else so3.item(E, i, j)
        column = mat3.apply(inverse, e)
        for axis in range(3):
            A[j, axis] = K[axis] * column[axis]
    return first, second, joined


@kernel
def _one_direction(e: Vector, u: Vector, K: Vector) -> tuple[Matrix, float, float]:
    """Return L, the cost's constant part and the weight of one vector, which sees no turn about it.

    There is no W by (12). The scalar weight (tr K + e^T K e)/2 of a unit vector e is the mean of
    what K gives to the turns that the vector does see.
    """
    e2 = so3.dot(e, e)
    weighted = K[0] * e[0] ** 2 + K[1] * e[1] ** 2 + K[2] * e[2] ** 2
    w = 0.5 * (K[0] + K[1] + K[2] + weighted / e2) / e2
    return outer_sum(ZERO, so3.scale(w, e), u), 0.5 * w * (e2 + so3.dot(u, u)), w


@kernel
def gain_matrices(
    E: Array, U: Array, valid: NDArray[np.bool_], K: Vector, out: Array, known: Array
) -> None:
    """Fill out (n, 10) with L = E W U^T by rows, [FTS] (16), and the constant part of U.

    W is that of (12). Two vectors are joined by their cross product, (6)-(7); so are more that lie
    in one plane. One vector (or two within `MIN_SINE` of each other) gets a scalar weight; none
    gives zero. The constant part is (tr K + <M, K M>)/2, so that U = constant - <R, L>, (11).

    Parameters
    ----------
    E
        Unit vectors in the world, shape (n, k, 3), or (1, k, 3) where constant.
    U, valid
        Unit vectors measured in the body, shape (n, k, 3), and which of them to use, (n, k).
    K
        Weights (k1, k2, k3) along the world's axes.
    known
        Filled with E W E^T by (xx, xy, xz, yy, yz, zz), shape (n, 6), unless it has no rows.
    """
    A = np.zeros((valid.shape[1] + 1, 3))
    i = 0
    while i < len(U):
        row = i if len(E) > 1 else 0
        stop = i + 1 if len(E) > 1 else _alike_until(valid, i)
        pair = _weighting(E, row, valid, i, K, A)
        e = so3.item(E, row, pair[0]) if pair[0] >= 0 else (0.0, 0.0, 0.0)
        _fill(A, U, valid, i, stop, pair, e, K, out, known)
        i = stop


@kernel
def diagonal_gain_matrices(
    E: Array, U: Array, valid: NDArray[np.bool_], w: Array, out: Array, known: Array
) -> None:
    """Fill out (n, 10) with L = E W U^T for W = diag(w), and the constant part of U.

    [VAE] (2) and Mahony's filter take any positive w. Arguments as of `gain_matrices`, but for the
    weights w of the vectors, shape (k,); the constant part is sum w_i (|e_i|² + |u_i|²)/2.
    """
    for i in range(len(U)):
        row = i if len(E) > 1 else 0
        L, M, constant = ZERO, ZERO, 0.0
        for j in range(valid.shape[1]):
            if valid[i, j]:
                e, u = so3.item(E, row, j), so3.item(U, i, j)
                L = outer_sum(L, so3.scale(w[j], e), u)
                M = outer_sum(M, so3.scale(w[j], e), e)
                constant += 0.5 * w[j] * (so3.dot(e, e) + so3.dot(u, u))
        for a in range(9):
            out[i, a] = L[a]
        out[i, 9] = constant
        if len(known):
            _fill_symmetric(known, i, M)


@kernel
def _fill_symmetric(known: Array, i: int, M: Matrix) -> None:
    known[i, 0], known[i, 1], known[i, 2] = M[0], M[1], M[2]
    known[i, 3], known[i, 4], known[i, 5] = M[4], M[5], M[8]


@kernel
def _alike_until(valid: NDArray[np.bool_], i: int) -> int:
    """Return the first step behind i that has other vectors."""
    for stop in range(i + 1, len(valid)):
        for j in range(valid.shape[1]):
            if valid[stop, j] != valid[i, j]:
                return stop
    return len(valid)


@kernel
def _fill(
    A: Array,
    U: Array,
    valid: NDArray[np.bool_],
    start: int,
    stop: int,
    pair: tuple[int, int, bool],
    e: Vector,
    K: Vector,
    out: Array,
    known: Array,
) -> None:
    """Fill rows of out with L and the cost's constant part, for steps that share their vectors."""
    first, second, joined = pair
    k = valid.shape[1]
    inverse = (1.0 / K[0], 1.0 / K[1], 1.0 / K[2])
    for i in range(start, stop):
        L, constant = ZERO, 0.0
        lone = first >= 0 and second < 0
        if second >= 0:
            for j in range(k):
                if valid[start, j]:
                    L = outer_sum(L, so3.row(A, j), so3.item(U, i, j))
            if joined:
                u1, u2 = so3.item(U, i, first), so3.item(U, i, second)
                L = outer_sum(L, so3.row(A, k), so3.cross(u1, u2))
                lone = close(u1, u2)
            constant = 0.5 * (K[0] + K[1] + K[2] + _weighted_norm(L, inverse))
        M = mat3.diagonal(K) if second >= 0 else ZERO
        if lone:
            L, constant, w = _one_direction(e, so3.item(U, i, first), K)
            M = outer_sum(ZERO, so3.scale(w, e), e)
        if len(known):
            _fill_symmetric(known, i, M)
        for a in range(9):
            out[i, a] = L[a]
        out[i, 9] = constant


@kernel
def _weighted_norm(L: Matrix, inverse: Vector) -> float:
    """Return <M, K M> with L = K M, given the inverse of K."""
    return (
        (L[0] ** 2 + L[1] ** 2 + L[2] ** 2) * inverse[0]
        + (L[3] ** 2 + L[4] ** 2 + L[5] ** 2) * inverse[1]
        + (L[6] ** 2 + L[7] ** 2 + L[8] ** 2) * inverse[2]
    )


@kernel
def residual(B: Matrix) -> Vector:
    """Return s_L = vex(L^T R - R^T L) with B = R^T L, [FTS] after (31)."""
    return mat3.vex2(mat3.transpose(B))


@kernel
def cost(constant: float, B: Matrix) -> float:
    """Return Wahba's cost U = 1/2 <E - R U, (E - R U) W> = constant - tr(R^T L), [FTS] (11)."""
    return constant - (B[0] + B[4] + B[8])


@kernel
def _vex_turned(A: Matrix, x: Vector) -> Vector:
    """Return vex(A^T hat(x) + hat(x) A) = (tr(A) I - A) x."""
    trace = A[0] + A[4] + A[8]
    return so3.sub(so3.scale(trace, x), mat3.apply(A, x))


@kernel
def residual_rate(B: Matrix, Omega_hat: Vector, Omega_b: Vector) -> Vector:
    """Return w_L = d s_L/dt for constant vectors in the world, [FTS] (48), [ESO] (27).

    vex(L^T R hat(Omega_hat) + hat(Omega_hat) R^T L) - vex(R^T L hat(Omega_b) + hat(Omega_b) L^T R).
    """
    return so3.sub(_vex_turned(B, Omega_hat), _vex_turned(mat3.transpose(B), Omega_b))
