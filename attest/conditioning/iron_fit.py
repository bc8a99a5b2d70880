"""The least squares of hard and soft iron, from windows in which the field stands still.

Symbols: those of `attest.conditioning.windows`; G basis in which x changes, and the x from which it
does, shape (12, k + 1); Z = X times the basis.
"""

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.rows import middle
from attest.geometry import mat3, so3
from attest.geometry.jit import inlined, kernel
from attest.geometry.so3 import Quaternion, Vector

Array = NDArray[np.float64]
Windows = NDArray[np.intp]

N = 12
"""Unknowns."""
FAINT = 1e-8
"""Mean square of a turn that tells nothing, rad²."""
QUIET = 1e-3
"""Deviation of a magnetometer's samples at the least, as a share of the strength."""
TAIL = 3.0
"""Square of the misfit, in deviations, at which a sample counts half."""


@inlined
def _field(D: Array, c: Array, i: int, x: Array) -> Vector:
    """Return D P c of a sample."""
    m = so3.row4(c, i)
    body = (
        x[0] * m[0] + x[1] * m[1] + x[2] * m[2] + x[3] * m[3],
        x[4] * m[0] + x[5] * m[1] + x[6] * m[2] + x[7] * m[3],
        x[8] * m[0] + x[9] * m[1] + x[10] * m[2] + x[11] * m[3],
    )
    return mat3.apply(mat3.matrix_row(D, i), body)


@kernel
def made(D: Array, c: Array, x: Array, y: Array) -> None:
    """Fill y (n, 3) with the field that x makes of samples."""
    for i in range(len(c)):
        y[i, 0], y[i, 1], y[i, 2] = _field(D, c, i, x)


@kernel
def fit(
    D: Array,
    c: Array,
    spans: Windows,
    G: Array,
    rounds: int,
    weight: Array,
    x: Array,
    inverse: Array,
) -> float:
    """Fill x with what leaves least of the field less its mean over each window.

    Samples of Cauchy's distribution: those of disturbed places count little.

    Parameters
    ----------
    G : shape (12, k + 1)
        Basis in which x changes, and the x from which it does.
    weight : shape (n,)
        What the samples count at first, and then at last.
    inverse : shape (k, k)
        Filled with the covariance in the basis, but for the factor that is returned.
    """
    A, left, sizes, n = np.empty((N, N)), np.empty((len(c), 3)), np.empty(len(c)), 0
    for _ in range(rounds):
        n = _normal(D, c, weight, spans, A)
        _solve(A, G, FAINT * n, inverse, x)
        _left(D, c, weight, spans, x, left, sizes)
        usual = max(TAIL * middle(sizes[:n]), QUIET**2)
        for window in range(len(spans)):
            for i in range(spans[window, 0], spans[window, 1]):
                weight[i] = 1.0 / (1.0 + so3.dot(so3.row(left, i), so3.row(left, i)) / usual)
    # what hardly moves has scores of hardly anything: no less than the samples' own scatter
    between, within = _scatter(D, c, left, weight, spans, G, inverse)
    return float(max(between / len(inverse), within / (3.0 * n), QUIET**2))


@inlined
def _more(total: Quaternion, share: float, c: Quaternion) -> Quaternion:
    """Return a sum of four and a share of c."""
    return (
        total[0] + share * c[0],
        total[1] + share * c[1],
        total[2] + share * c[2],
        total[3] + share * c[3],
    )


@kernel
def _products(
    V: Array, j: int, c: Array, weight: Array, span: Windows, out: Array, at: int
) -> None:
    """Add three columns of V, from j on, times c^T, summed over a window, to rows of out."""
    p = q = r = (0.0, 0.0, 0.0, 0.0)
    for i in range(span[0], span[1]):
        c_i, w = so3.row4(c, i), weight[i]
        p, q = _more(p, w * V[i, j], c_i), _more(q, w * V[i, j + 1], c_i)
        r = _more(r, w * V[i, j + 2], c_i)
    for a in range(4):
        out[at, a] += p[a]
        out[at + 1, a] += q[a]
        out[at + 2, a] += r[a]


@kernel
def _normal(D: Array, c: Array, weight: Array, spans: Windows, A: Array) -> int:
    """Fill A (12, 12) with X^T X less its weighted means over windows; return of how many samples.

    X is D (x) c^T, so that X^T X is I (x) c c^T.
    """
    n, squares, X = 0, np.zeros((4, 4)), np.empty((9, 4))
    A[:] = 0.0
    for span in spans:
        X[:] = 0.0
        for j in range(0, 9, 3):
            _products(D, j, c, weight, span, X, j)
        _products(c, 1, c, weight, span, squares, 1)
        total = weight[span[0] : span[1]].sum()
        squares[0, 0] += total
        n += span[1] - span[0]
        for row in X.reshape(3, N):
            for a in range(N):
                share = row[a] / total
                for b in range(N):
                    A[a, b] -= share * row[b]
    squares[0, 1:] = squares[1:, 0]
    for k in range(0, N, 4):
        A[k : k + 4, k : k + 4] += squares
    return n


@kernel
def _solve(A: Array, G: Array, faint: float, inverse: Array, x: Array) -> None:
    """Fill x with that of the least x^T A x, and the inverse of A in the basis."""
    k = len(inverse)
    A_G, of_G = np.zeros((N, k + 1)), np.zeros((k, k + 1))
    for i in range(N):
        for b in range(k + 1):
            for j in range(N):
                A_G[i, b] += A[i, j] * G[j, b]
            for a in range(k):
                of_G[a, b] += G[i, a] * A_G[i, b]
    for a in range(k):
        of_G[a, a] += faint
    inverse[:], x[:] = of_G[:, :k], G[:, k]
    invert(inverse)
    for a in range(k):
        z = 0.0
        for b in range(k):
            z -= inverse[a, b] * of_G[b, k]
        for i in range(N):
            x[i] += G[i, a] * z


@kernel
def invert(A: Array) -> None:
    """Invert a symmetric positive definite matrix in place, by Gauss and Jordan."""
    for p in range(len(A)):
        r, A[p, p] = 1.0 / A[p, p], 1.0
        for b in range(len(A)):
            A[p, b] *= r
        for a in range(len(A)):
            if a != p:
                c, A[a, p] = A[a, p], 0.0
                for b in range(len(A)):
                    A[a, b] -= c * A[p, b]


@kernel
def _left(
    D: Array, c: Array, weight: Array, spans: Windows, x: Array, out: Array, sizes: Array
) -> None:
    """Fill out (n, 3) with the field less its weighted mean over each window.

    And sizes, from the first on, with the squares.
    """
    count = 0
    for window in range(len(spans)):
        mean, total = so3.ZERO, 0.0
        for i in range(spans[window, 0], spans[window, 1]):
            field = _field(D, c, i, x)
            out[i, 0], out[i, 1], out[i, 2] = field
            mean = so3.add(mean, so3.scale(weight[i], field))
            total += weight[i]
        mean = so3.scale(1.0 / total, mean)
        for i in range(spans[window, 0], spans[window, 1]):
            left = so3.sub(so3.row(out, i), mean)
            out[i, 0], out[i, 1], out[i, 2] = left
            sizes[count] = so3.dot(left, left)
            count += 1


@kernel
def _scatter(
    D: Array, c: Array, left: Array, weight: Array, spans: Windows, G: Array, inverse: Array
) -> tuple[float, float]:
    """Return the sums of s^T inverse s, s of each window Z^T left, and of left^T left; weighted."""
    s, between, within = np.empty(len(inverse)), 0.0, 0.0
    for window in range(len(spans)):
        p = q = r = (0.0, 0.0, 0.0, 0.0)
        for i in range(spans[window, 0], spans[window, 1]):
            v, c_i = so3.row(left, i), so3.row4(c, i)
            within += weight[i] * so3.dot(v, v)
            body = mat3.apply(mat3.transpose(mat3.matrix_row(D, i)), so3.scale(weight[i], v))
            p, q, r = _more(p, body[0], c_i), _more(q, body[1], c_i), _more(r, body[2], c_i)
        for a in range(len(s)):
            s[a] = 0.0
            for j in range(4):
                s[a] += G[j, a] * p[j] + G[4 + j, a] * q[j] + G[8 + j, a] * r[j]
        for a in range(len(s)):
            for b in range(len(s)):
                between += s[a] * inverse[a, b] * s[b]
    return between, within
