"""Constant gain observer, the explicit complementary filter with bias correction.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics". Section 6.3, (90), (91).
[Mahony08]  R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special
            orthogonal group", IEEE TAC 53(5), 2008. Theorem 5.1, (32).

Symbols: R (as a quaternion q), beta_hat estimates of attitude and bias; Omega_m gyroscope;
K_P, K_I gains; l = sum W_ij u_j x v_i (measured x predicted) = -s_L.

Departures: with ``weights.k`` l is that of the weights W of [FTS] (12); with ``weights.w`` it is
the papers' sum over vectors, in [Mahony08] with k_i = w_i. The attitude is stepped as in [FTS]
(92); (91) by Euler.
"""

from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.config import Configuration, Section, VectorWeights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.observer import (
    COLUMNS,
    Observer,
    between,
    estimates,
    gain_matrices,
    initial_attitude,
    mean_rate,
    record,
    steps,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
State = tuple[Quaternion, Vector]
"""q, beta_hat."""


class Gains(Section):
    """Gains of [FTS] (90), (91)."""

    theorem = "[Mahony08, Theorem 5.1]"

    k_p: Annotated[float, Field(gt=0)] = 0.24
    """Attitude gain K_P [1/s]. More follows the vectors, less the gyroscope."""
    k_i: Annotated[float, Field(ge=0)] = 0.001
    """Bias gain K_I [1/s²]. Zero freezes the bias."""


class Config(Configuration):
    """Configuration of ``cgo``; the defaults suit flight logs."""

    observer: str = "cgo"
    gains: Gains = Gains()
    weights: VectorWeights = VectorWeights(k=(1.2, 1.0, 30.0))


@kernel
def step(
    state: State, Omega_m: Vector, L: Matrix, h: float, k_p: float, k_i: float
) -> tuple[State, Vector, Matrix]:
    """Advance q and beta_hat by h, all right sides at its beginning; also return s_L and B."""
    q, beta = state
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), L)
    s = wahba.residual(B)  # -l
    Omega_hat = so3.sub(so3.sub(Omega_m, beta), so3.scale(k_p, s))
    after = (
        so3.multiply(q, so3.exp(so3.scale(h, Omega_hat))),  # (90)
        so3.add(beta, so3.scale(h * k_i, s)),  # (91)
    )
    return after, s, B


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    L: Array,
    start: State,
    k_p: float,
    k_i: float,
    out: Array,
) -> None:
    """Fold (90), (91) over the steps; row i of out (n, 12) is the state before step i."""
    state = start
    for i in range(len(h)):
        q, beta = state
        for j in range(substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            state, s, B = step(state, Omega_m, L_j, h[i], k_p, k_i)
            if j == 0:
                Omega_hat = so3.sub(so3.sub(so3.row(gyro, i), beta), so3.scale(k_p, s))
                cost = wahba.cost(L[i, 9], B)
                record(out, i, q, Omega_hat, beta, sqrt(so3.dot(s, s)), cost)


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias; the bias survives a restart, the rest starts anew."""
    gains = config.gains
    out = np.empty((len(samples.t), COLUMNS))
    beta = np.array(config.initial.bias)
    for part in segments(samples):
        q = initial_attitude(samples, part, config.initial)
        start = (so3.as_quaternion(q), so3.as_vector(beta))
        L = gain_matrices(samples, part, config.weights)
        h, substeps = steps(samples, part), samples.substeps[part]
        run(h, substeps, samples.gyro[part], L, start, gains.k_p, gains.k_i, out[part])
        beta = out[part.stop - 1, 7:10]
    return estimates("cgo", samples, out)


def lyapunov(found: Estimates, config: Config, beta_tilde: Array) -> Array | None:
    """Return V = U + beta_tilde.beta_tilde/(2 K_I), [Mahony08] Theorem 5.1, shape (n,)."""
    if config.gains.k_i == 0.0:
        return None
    V: Array = found.cost + 0.5 * np.sum(beta_tilde**2, axis=1) / config.gains.k_i
    return V


OBSERVER = Observer(
    title="Constant gain observer (explicit complementary filter)",
    paper="Mahony, Hamel, Pflimlin 2008: (32); Sanyal, Warier, Hamrah: (90), (91)",
    config=Config,
    estimate=estimate,
    lyapunov=lyapunov,
)
