"""Normal equations of a chain of states that share some constants, solved exactly.

[Golub13]  G. H. Golub, C. F. Van Loan, "Matrix computations", 4th ed., 4.2, 4.5.

A factor ties a node to the next and to the constants, so that the matrix is block tridiagonal with
a border: node k has H_k, tied to the next by U_k and to the constants by B_k, which have C. By
Cholesky, node after node, time and memory grow with the number of nodes only. The right-hand sides
are the last columns of B and C.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]

TINY = 1e-14
"""Of a pivot to what it was, below which the equations do not tell it; it then stays."""


class Chain(NamedTuple):
    """The equations of N nodes of n unknowns, and of c constants."""

    H: Array
    """(N, n, n)."""
    U: Array
    """(N, n, n); the last is not used."""
    B: Array
    """(N, n, c + 1)."""
    C: Array
    """(c, c + 1)."""


def empty(nodes: int, size: int, constants: int) -> Chain:
    """Return a chain that nothing is known of."""
    return Chain(
        H=np.zeros((nodes, size, size)),
        U=np.zeros((nodes, size, size)),
        B=np.zeros((nodes, size, constants + 1)),
        C=np.zeros((constants, constants + 1)),
    )


@kernel
def cholesky(A: Array) -> None:
    """Replace the lower part of A by L, A = L L^T."""
    for j in range(len(A)):
        s = A[j, j]
        for k in range(j):
            s -= A[j, k] * A[j, k]
        A[j, j] = sqrt(s) if s > TINY * A[j, j] else 1e150  # unknown: no step, no covariance
        for i in range(j + 1, len(A)):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            A[i, j] = s / A[j, j]


@kernel
def forward(L: Array, X: Array) -> None:
    """Replace X (n, m) by L^-1 X."""
    for i in range(len(L)):
        for k in range(i):
            a = L[i, k]
            for c in range(X.shape[1]):
                X[i, c] -= a * X[k, c]
        r = 1.0 / L[i, i]
        for c in range(X.shape[1]):
            X[i, c] *= r


@kernel
def backward(L: Array, X: Array) -> None:
    """Replace X (n, m) by L^-T X."""
    for i in range(len(L) - 1, -1, -1):
        for k in range(i + 1, len(L)):
            a = L[k, i]
            for c in range(X.shape[1]):
                X[i, c] -= a * X[k, c]
        r = 1.0 / L[i, i]
        for c in range(X.shape[1]):
            X[i, c] *= r


@kernel
def less(W: Array, X: Array, Y: Array) -> None:
    """Take W^T X from Y."""
    for k in range(len(W)):
        for i in range(len(Y)):
            a = W[k, i]
            for j in range(Y.shape[1]):
                Y[i, j] -= a * X[k, j]


@kernel
def identity(A: Array) -> None:
    """Fill A with the identity."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j] = 1.0 if i == j else 0.0


@kernel
def solve(chain: Chain, z: Array, z_c: Array, P_c: Array) -> None:
    """Fill z (N, n) and z_c (c,) with the solution and P_c (c, c) with the constants' covariance.

    The chain is replaced by its factors, which `covariances` takes.
    """
    H, U, B, C = chain
    for k in range(len(H)):
        cholesky(H[k])
        forward(H[k], B[k])
        if k + 1 < len(H):
            forward(H[k], U[k])
            less(U[k], U[k], H[k + 1])
            less(U[k], B[k], B[k + 1])
        less(B[k], B[k], C)
    L = C.copy()
    cholesky(L)
    identity(P_c)
    forward(L, P_c)
    backward(L, P_c)
    constants = len(C)
    for i in range(constants):
        z_c[i] = 0.0
        for j in range(constants):
            z_c[i] += P_c[i, j] * C[j, constants]
    _back(chain, z, z_c)


@kernel
def _back(chain: Chain, z: Array, z_c: Array) -> None:
    """Fill z (N, n) from the last node to the first, by the factors."""
    H, U, B, _ = chain
    size, constants = H.shape[1], len(z_c)
    y = np.empty((size, 1))
    for k in range(len(H) - 1, -1, -1):
        for i in range(size):
            y[i, 0] = B[k, i, constants]
            for j in range(constants):
                y[i, 0] -= B[k, i, j] * z_c[j]
            if k + 1 < len(H):
                for j in range(size):
                    y[i, 0] -= U[k, i, j] * z[k + 1, j]
        backward(H[k], y)
        for i in range(size):
            z[k, i] = y[i, 0]


@kernel
def covariances(chain: Chain, P_c: Array, P: Array) -> None:
    """Fill P (N, n, n) with the nodes' covariances, from what `solve` left.

    With G = (W X), W and X the factors of U and B, S the covariance of the next node and the
    constants, a node has L^-T (1 + G S G^T) L^-1, and -L^-T G S with those.
    """
    H, U, B, _ = chain
    size, constants = H.shape[1], len(P_c)
    S, S_c = np.zeros((size, size)), np.zeros((size, constants))
    T, T_c, A = np.empty((size, size)), np.empty((size, constants)), np.empty((size, size))
    for k in range(len(H) - 1, -1, -1):
        last = k + 1 == len(H)
        _carry(U[k], B[k], S, S_c, P_c, last, T, T_c)
        _square(U[k], B[k], T, T_c, last, A)
        backward(H[k], A)
        _transpose(A, S)
        backward(H[k], S)
        backward(H[k], T_c)
        for i in range(size):
            for j in range(size):
                P[k, i, j] = 0.5 * (S[i, j] + S[j, i])
            for j in range(constants):
                S_c[i, j] = -T_c[i, j]


@kernel
def _carry(
    W: Array, X: Array, S: Array, S_c: Array, P_c: Array, last: bool, T: Array, T_c: Array
) -> None:
    """Fill (T T_c) with G S, as in `covariances`."""
    for i in range(len(T)):
        for j in range(T.shape[1]):
            T[i, j] = 0.0
            for c in range(len(P_c)):
                T[i, j] += X[i, c] * S_c[j, c]
            if not last:
                for c in range(len(S)):
                    T[i, j] += W[i, c] * S[c, j]
        for j in range(T_c.shape[1]):
            T_c[i, j] = 0.0
            for c in range(len(P_c)):
                T_c[i, j] += X[i, c] * P_c[c, j]
            if not last:
                for c in range(len(S)):
                    T_c[i, j] += W[i, c] * S_c[c, j]


@kernel
def _square(W: Array, X: Array, T: Array, T_c: Array, last: bool, A: Array) -> None:
    """Fill A with 1 + (T T_c) G^T, as in `covariances`."""
    identity(A)
    for i in range(len(A)):
        for j in range(len(A)):
            for c in range(T_c.shape[1]):
                A[i, j] += T_c[i, c] * X[j, c]
            if not last:
                for c in range(len(A)):
                    A[i, j] += T[i, c] * W[j, c]


@kernel
def _transpose(A: Array, out: Array) -> None:
    """Fill out with A^T."""
    for i in range(len(A)):
        for j in range(len(A)):
            out[i, j] = A[j, i]
