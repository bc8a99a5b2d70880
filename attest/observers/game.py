"""Geometric approximate minimum-energy filter with gyroscope bias.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics". Section 6.2, (82)-(89).
[Zamani11]  M. Zamani, J. Trumpf, R. Mahony, "Near-optimal deterministic filtering on the rotation
            group", IEEE TAC 56(6).

Symbols: R (as a quaternion q), beta_hat estimates of attitude and bias; P_a, P_c, P_b blocks of the
covariance of (attitude, bias) errors; l residual; S, C, E as in (87)-(89); B = R^T L.

Departures: with weights W_ij in place of the Q_i, l = s_L and E - S = q (Ps(B) - tr(B) I), so that
nothing but L = E W U^T is needed; ``weights.w`` gives the paper's Q_i = w_i I. The factor 2 before
Ps(…) in the scan's (83) is left out: with it the covariance turns twice as fast as the body. The
signs of (84) are those of [Zamani11]. Euler's method makes the Riccati equation diverge at steps
that the filter itself bears: over a step, P' = P (E - S) P is solved exactly and the rest by
turning, as for the MEKF, whose update and prediction these are, with the Hessian E - S in place of
-S. Far from the truth that equation has no solution over a step: -|B| I stands for E - S then, and
that definiteness was lost is told.
"""

from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.claims import Claim
from attest.config import Configuration, Section, VectorWeights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Vector
from attest.observers.mekf import Covariance, State, initial_covariance, predict, update
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
    turn_noise,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
Numbers = tuple[float, float, float, Covariance]
"""q, Q_Omega, Q_b, and the first covariance."""


class Gains(Section):
    """Noise that the filter expects, [FTS] section 6.2."""

    theorem = "[FTS, (82)-(89)]"

    q: Annotated[float, Field(gt=0, le=1e9)] = 22.7
    """Scale of the weights: what the vectors tell, 1/(rad² s). More follows them more."""
    Q_Omega: Annotated[float, Field(gt=0, le=1e9)] = 0.0169
    """Intensity of the gyroscope's noise [rad²/s]. More follows the vectors more."""
    Q_b: Annotated[float, Field(ge=0, le=1e9)] = 5.8e-8
    """Intensity of the bias's change [rad²/s³]."""
    attitude_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    """Standard deviation of the initial principal angle, degrees; P_a(0) is its variance."""
    bias_deg_s: Annotated[float, Field(gt=0, le=1e6)] = 2.0
    """Standard deviation of the initial bias, degrees/s; P_b(0) is its variance."""


class Config(Configuration):
    """Configuration of ``game``; the defaults suit flight logs."""

    observer: str = "game"
    gains: Gains = Gains()
    weights: VectorWeights = VectorWeights(k=(1.2, 1.0, 30.0))


@kernel
def transported(P: Covariance, theta: Vector) -> Covariance:
    """Return the covariance in the body after a turn by theta: half of it for P_a, as in (83)."""
    P_a, P_c, P_b = P
    half = so3.matrix(so3.exp(so3.scale(0.5, theta)))
    whole = so3.matrix(so3.exp(theta))
    P_a = mat3.matmul(mat3.matmul(mat3.transpose(half), P_a), half)
    return P_a, mat3.matmul(mat3.transpose(whole), P_c), P_b


@kernel
def definite(P: Covariance) -> bool:
    """Tell whether [[P_a, P_c], [P_c^T, P_b]] is positive definite, by Schur's complement."""
    P_a, P_c, P_b = P
    if not mat3.positive(P_a):
        return False
    inner = mat3.matmul(mat3.matmul(mat3.transpose(P_c), mat3.inverse(P_a)), P_c)
    return mat3.positive(mat3.symmetric(mat3.plus(P_b, mat3.times(-1.0, inner))))


@kernel
def step(
    state: State, Omega_m: Vector, L: Matrix, h: float, numbers: Numbers
) -> tuple[State, Vector, Matrix, Vector, bool]:
    """Advance the state by h: what the vectors tell, then the turn, (82)-(86).

    Returns
    -------
    state
        After the step.
    residual, B, P_a_l
        The residual l, R^T L and the correction P_a l of the rate before it.
    sound : bool
        Whether the covariance stayed definite.
    """
    q, beta, P = state
    scale, Q_Omega, Q_b, first = numbers
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), L)
    residual = so3.scale(scale, wahba.residual(B))  # l
    P_a_l = mat3.apply(P[0], residual)
    trace = B[0] + B[4] + B[8]
    E_S = mat3.plus(mat3.symmetric(B), mat3.diagonal((-trace, -trace, -trace)))  # (87)-(89)
    told, y = mat3.times(-h * scale, E_S), so3.scale(-h, residual)
    q_told, beta_told, P_told, theta = update(q, beta, P, told, y)
    sound = definite(P_told)
    if not sound:
        size = h * scale * mat3.norm(B)
        told = mat3.diagonal((size, size, size))
        q_told, beta_told, P_told, theta = update(q, beta, P, told, y)
    carried = transported(P_told, theta)
    Omega_b = so3.sub(Omega_m, beta_told)
    q_after, P_after = predict(q_told, carried, Omega_b, h, (Q_Omega, Q_b))
    if not definite(P_after):
        P_after, sound = first, False
    return (q_after, beta_told, P_after), residual, B, P_a_l, sound


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    L: Array,
    start: State,
    numbers: Numbers,
    Q_Omega: Array,
    out: Array,
) -> None:
    """Fold (82)-(86) over the steps; row i of out (n, 16) is the state before step i.

    The last columns are the diagonal of P_a, and how often the covariance lost definiteness.
    """
    state, lost = start, 0
    for i in range(len(h)):
        q, beta, P = state
        for j in range(substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            known = numbers[0], Q_Omega[i], numbers[2], numbers[3]
            state, residual, B, P_a_l, sound = step(state, Omega_m, L_j, h[i], known)
            if j == 0:
                Omega_hat = so3.sub(so3.sub(so3.row(gyro, i), beta), P_a_l)
                s_norm = sqrt(so3.dot(residual, residual)) / numbers[0]
                record(out, i, q, Omega_hat, beta, s_norm, wahba.cost(L[i, 9], B))
                out[i, 12], out[i, 13], out[i, 14] = P[0][0], P[0][4], P[0][8]
                out[i, 15] = lost
            lost += 0 if sound else 1


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias; the bias survives a restart, the rest starts anew."""
    gains = config.gains
    P = initial_covariance(gains.attitude_deg, gains.bias_deg_s)
    numbers = (gains.q, gains.Q_Omega, gains.Q_b, P)
    out = np.empty((len(samples.t), COLUMNS + 4))
    beta = np.array(config.initial.bias)
    for part in segments(samples):
        q = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        start = (q, so3.as_vector(beta), P)
        L = gain_matrices(samples, part, config.weights)
        h, substeps = steps(samples, part), samples.substeps[part]
        Q_Omega = turn_noise(samples, part, gains.Q_Omega)
        run(h, substeps, samples.gyro[part], L, start, numbers, Q_Omega, out[part])
        beta = out[part.stop - 1, 7:10]
    states = {"attitude_std": np.sqrt(out[:, 12:15]), "definiteness_lost": out[:, 15]}
    return estimates("game", samples, out, states=states)


def promises(samples: Samples, found: Estimates, _config: Config) -> tuple[Claim, ...]:
    """Say whether the covariance stayed definite, and if not, how often and when first it did."""
    lost = found.states["definiteness_lost"]
    times = int(sum(lost[part.stop - 1] for part in segments(samples)))
    first = np.flatnonzero(lost > 0.0)
    after = float(samples.t[first[0]] - samples.t[0]) * 1e-9 if len(first) else None
    return (
        Claim(
            statement="the covariance stays positive definite",
            source="FTS, (83)-(85)",
            seen="yes, to the end"
            if after is None
            else f"lost in {times} steps, first after {after:.2f} s; -|B| I stood for E - S there",
            holds=after is None,
            value=after,
        ),
    )


OBSERVER = Observer(
    title="Geometric approximate minimum-energy filter",
    paper="Zamani, Trumpf, Mahony 2011; Sanyal, Warier, Hamrah: (82)-(89)",
    config=Config,
    estimate=estimate,
    promises=promises,
)
