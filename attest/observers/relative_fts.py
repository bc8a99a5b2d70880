"""Finite-time stable observer of relative attitude, from feature points or other vectors alone.

[REL]  N. Wang, R. Hamrah, A. K. Sanyal, "A finite-time stable observer for relative attitude
       estimation". Theorem 3.1, (9)-(12), (23), (40)-(42).
[Newmark59]  N. M. Newmark, "A method of computation for structural dynamics", J. Eng. Mech. 85(3).

Symbols: R (as a quaternion q) estimate, observer's frame S to object's; D, L columns d = p_l - p_m
of the model and l = a_l - a_m as measured in S; L_f, L_f' filtered columns and their rates; Omega_f
rate by them; Gamma = D W L_f^T; s its residual; mu, w_n damping and natural frequency.

Departures: points come with no gyroscope, and none is used. Where ``points`` is null the log's unit
vectors stand for D and L. A column that comes back after having been hidden starts at rest in the
object's frame, l' = l x Omega_f. The paper's G has full column rank, not row rank; where it has
not (one direction), the rate about it is the last one.
"""

from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.config import PointsConfiguration, Section, Weights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.hoelder import FLOOR, power
from attest.observers.observer import (
    COLUMNS,
    Observer,
    between,
    estimates,
    initial_attitude,
    known_vectors,
    mean_rate,
    record,
    steps,
    whole_steps,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST = 1e-6
"""Determinant of the rate's normal matrix, in units of its trace cubed, that is not zero."""


class Gains(Section):
    """Gains of [REL] Theorem 3.1 and section 4."""

    theorem = "[REL, Theorem 3.1]"

    k_p: Annotated[float, Field(gt=0)] = 3.0
    """Attitude gain [1/s]. More follows the vectors more."""
    p: Annotated[float, Field(gt=1, lt=2)] = 1.1
    """Hölder exponent, (1, 2)."""
    mu: Annotated[float, Field(gt=0)] = 0.414
    """Damping ratio of the filter; 0.707 is Butterworth's."""
    w_n: Annotated[float, Field(gt=0)] = 251.3
    """Natural frequency of the filter [rad/s]. Less smooths more, and lags more."""


class Config(PointsConfiguration):
    """Configuration of ``relative_fts``; its gains are the paper's."""

    observer: str = "relative_fts"
    gains: Gains = Gains()


@kernel
def newmark(
    state: tuple[float, float, float], measured: float, h: float, mu: float, w_n: float
) -> tuple[float, float, float]:
    """Advance x, x', x'' of x'' + 2 mu w_n x' + w_n² x = w_n² x_m by h; gamma 1/2, beta 1/4."""
    x, v, a = state
    x_p, v_p = x + h * v + 0.25 * h * h * a, v + 0.5 * h * a
    rest = 1.0 + mu * w_n * h + 0.25 * w_n * w_n * h * h
    a = (w_n * w_n * (measured - x_p) - 2.0 * mu * w_n * v_p) / rest
    return x_p + 0.25 * h * h * a, v_p + 0.5 * h * a, a


@kernel
def rate(l_f: Array, l_dot: Array, valid: Flags, i: int, last: Vector) -> Vector:
    """Return Omega_f, the least-squares solution of l' = hat(l) Omega, (9)-(12).

    l_f is (n, k, 3), l_dot (k, 3). What the columns leave open is as in the last rate.
    """
    N, right, widest = wahba.ZERO, so3.ZERO, -1
    for j in range(valid.shape[1]):
        if valid[i, j]:
            a = so3.item(l_f, i, j)
            size = so3.dot(a, a)
            N = wahba.outer_sum(N, so3.scale(-1.0, a), a)
            N = mat3.plus(N, mat3.diagonal((size, size, size)))
            right = so3.add(right, so3.cross(so3.row(l_dot, j), a))
            widest = j
    if widest < 0:
        return last
    trace = (N[0] + N[4] + N[8]) / 3.0
    if mat3.determinant(N) > LEAST * trace**3:
        return mat3.apply(mat3.inverse(N), right)
    a = so3.item(l_f, i, widest)
    size = max(so3.dot(a, a), FLOOR)
    across = so3.scale(1.0 / size, so3.cross(so3.row(l_dot, widest), a))
    return so3.add(across, so3.scale(so3.dot(last, a) / size, a))


@kernel
def prefilter(
    h: Array, L: Array, valid: Flags, mu: float, w_n: float, l_f: Array, Omega_f: Array
) -> None:
    """Fill l_f (n, k, 3) and Omega_f (n, 3) from the measured columns L (n, k, 3).

    h (n,) is the time to the next step; a column is filtered from where it is seen on.
    """
    k = valid.shape[1]
    filters = np.zeros((k, 3, 3))  # x, x', x'' by axis
    l_dot = np.zeros((k, 3))
    last = so3.ZERO
    for i in range(len(h)):
        for j in range(k):
            if not valid[i, j]:
                continue
            known = i > 0 and valid[i - 1, j]
            moved = so3.cross(so3.item(L, i, j), last)
            for axis in range(3):
                x = filters[j, axis]
                if known:
                    before = (x[0], x[1], x[2])
                    x[0], x[1], x[2] = newmark(before, L[i, j, axis], h[i - 1], mu, w_n)
                else:
                    x[0], x[1], x[2] = L[i, j, axis], moved[axis], 0.0
                l_f[i, j, axis], l_dot[j, axis] = x[0], x[1]
        last = rate(l_f, l_dot, valid, i, last)
        Omega_f[i, 0], Omega_f[i, 1], Omega_f[i, 2] = last


@kernel
def step(
    q: Quaternion, Omega_f: Vector, Gamma: Matrix, h: float, k_p: float, p: float
) -> tuple[Quaternion, Vector, Vector, Matrix]:
    """Advance q by h, (40)-(42); also return Omega_hat, s and R^T Gamma at the beginning."""
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), Gamma)
    s = wahba.residual(B)
    slope = power(s, 1.0 - 1.0 / p)
    Omega_hat = so3.sub(Omega_f, so3.scale(k_p * slope, s))  # (40), (41)
    return so3.multiply(q, so3.exp(so3.scale(h, Omega_hat))), Omega_hat, s, B  # (42)


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    Omega_f: Array,
    Gamma: Array,
    start: Quaternion,
    k_p: float,
    p: float,
    out: Array,
) -> None:
    """Fold (40)-(42) over the steps; row i of out (n, 12) is the state before step i."""
    q = start
    for i in range(len(h)):
        now = q
        for j in range(substeps[i]):
            rate_j, G = mean_rate(Omega_f, i, j, substeps[i]), between(Gamma, i, j, substeps[i])
            q, Omega_hat, s, B = step(q, rate_j, G, h[i], k_p, p)
            if j == 0:
                cost = wahba.cost(Gamma[i, 9], B)
                record(out, i, now, Omega_hat, so3.ZERO, sqrt(so3.dot(s, s)), cost)


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate the relative attitude and rate; each stretch starts anew."""
    gains = config.gains
    n = len(samples.t)
    out, Omega_f = np.empty((n, COLUMNS)), np.empty((n, 3))
    for part in segments(samples):
        L, valid = samples.body[part], samples.valid[part]
        l_f = np.zeros_like(L)
        prefilter(whole_steps(samples, part), L, valid, gains.mu, gains.w_n, l_f, Omega_f[part])
        Gamma = _gain_matrices(samples, part, l_f, config.weights)
        q = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        h, substeps = steps(samples, part), samples.substeps[part]
        run(h, substeps, Omega_f[part], Gamma, q, gains.k_p, gains.p, out[part])
    frames = None if config.points is None else ("object", "observer")
    states = {"filtered_rate": Omega_f}
    return estimates("relative_fts", samples, out, bias=False, states=states, frames=frames)


def _gain_matrices(samples: Samples, part: slice, l_f: Array, weights: Weights) -> Array:
    """Return Gamma = D W L_f^T and the cost's constant part, shape (n, 10); W is (23)."""
    Gamma = np.empty((len(l_f), 10))
    D = known_vectors(samples, part)
    wahba.gain_matrices(D, l_f, samples.valid[part], weights.k, Gamma, np.empty((0, 6)))
    return Gamma


OBSERVER = Observer(
    title="Finite-time stable relative attitude, from feature points",
    paper="Wang, Hamrah, Sanyal: Theorem 3.1, (9)-(12), (40)-(42)",
    config=Config,
    estimate=estimate,
)
