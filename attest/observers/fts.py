"""Finite-time stable attitude and gyroscope bias observer.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics". Theorem 1, (46)-(52); discrete (92)-(95).

Symbols: R (as a quaternion q), beta_hat estimates of attitude and bias; omega = Omega_m -
Omega_hat - beta_hat, the error state of the rate; s_L residual, w_L its rate, z_L its
Hölder-continuous power; Psi = omega - kappa z_L; K weights; a = 1 - 1/p.

Departures from the paper: the constant k_b of (50), (53) and (94) is a setting (its Lyapunov
argument holds for every k_b > 0); the powers of s_L and Psi are floored, since 0^-a is not finite
while the terms' limits are.
"""

from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.claims import Claim
from attest.config import Configuration, Section, Weights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import inlined, kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.hoelder import Powers, powers, tabled, turned
from attest.observers.observer import (
    COLUMNS,
    Observer,
    between,
    blocks,
    estimates,
    gain_matrices,
    gyro_noise,
    initial_attitude,
    initial_omega,
    mean_rate,
    record,
    steps,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
Numbers = tuple[float, float, float, float, float, float]
"""k_p, k_v, kappa, mu, a, k_b."""
State = tuple[Quaternion, Vector, Vector]
"""q, omega, beta_hat."""

SIGMAS = 3.0
"""The bound of normal noise, in standard deviations."""
ENOUGH = 100
"""Samples from which a run's noise can be told."""


class Gains(Section):
    """Gains of [FTS] Theorem 1."""

    theorem = "[FTS, Theorem 1]"

    k_p: Annotated[float, Field(gt=0)] = 0.3
    """Attitude gain. More follows the vectors, less the gyroscope."""
    k_v: Annotated[float, Field(gt=0)] = 3.0
    """Damping of the rate's error state omega."""
    kappa: Annotated[float, Field(gt=0)] = 0.35
    """Finite-time coupling of residual into rate [1/s]. More converges sooner, and is noisier."""
    mu: Annotated[float, Field(gt=0, lt=1)] = 0.35
    """Inertia of omega [s]; less follows changes quicker. (0, 1) in Theorem 1."""
    p: Annotated[float, Field(ge=1, lt=2)] = 1.1
    """Hölder exponent, [1, 2) in Theorem 1; 1 is the asymptotically stable limit."""
    k_b: Annotated[float | None, Field(gt=0)] = 100.0
    """Inertia of the bias [s]; more changes the bias slower. null is the paper's 2 - mu, (94)."""


class Config(Configuration):
    """Configuration of ``fts``; the defaults suit flight logs."""

    observer: str = "fts"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))


@inlined
def derivatives(
    s: Vector, w: Vector, omega: Vector, gains: Numbers, table: Powers
) -> tuple[Vector, Vector, Vector]:
    """Return beta_hat', omega' and Psi from the residual s = s_L and its rate w = w_L."""
    k_p, k_v, kappa, mu, a, k_b = gains
    slope = tabled(s, table)
    Psi = so3.sub(omega, so3.scale(kappa * slope, s))  # (46), (47)
    beta_dot = so3.scale(k_p / k_b, s)  # (50)
    pull = so3.sub(so3.scale(k_p, s), so3.scale(k_v * tabled(Psi, table), Psi))
    follow = so3.scale(mu * kappa * slope, turned(s, w, a))  # (52)
    return beta_dot, so3.scale(1.0 / mu, so3.add(pull, follow)), Psi  # (51)


@inlined
def step(
    state: State,
    Omega_m: Vector,
    L: Matrix,
    constant: float,
    h: float,
    gains: Numbers,
    table: Powers,
) -> tuple[State, float, float, float]:
    """Advance the state by h, all right sides at its beginning, (92)-(95).

    Returns
    -------
    state
        q, omega and beta_hat after the step.
    s_norm, cost, psi_norm : float
        |s_L|, Wahba's cost and |Psi| before it.
    """
    q, omega, beta = state
    Omega_b = so3.sub(Omega_m, beta)
    Omega_hat = so3.sub(Omega_b, omega)
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), L)
    s, w = wahba.residual(B), wahba.residual_rate(B, Omega_hat, Omega_b)  # (48)
    beta_dot, omega_dot, Psi = derivatives(s, w, omega, gains, table)
    after = (
        so3.multiply(q, so3.exp(so3.scale(h, Omega_hat))),  # (92)
        so3.add(omega, so3.scale(h, omega_dot)),  # (93)
        so3.add(beta, so3.scale(h, beta_dot)),  # (94)
    )
    return after, sqrt(so3.dot(s, s)), wahba.cost(constant, B), sqrt(so3.dot(Psi, Psi))


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    L: Array,
    start: State,
    gains: Numbers,
    out: Array,
) -> State:
    """Fold (92)-(95) over the steps, right sides at each step; rows of out are the state before it.

    Parameters
    ----------
    h, substeps : shape (n,)
        Length of each sub-step, s, and how many of them a step has.
    gyro : shape (n, 3) or (n + 1, 3)
        Measured rate, rad/s; with that of the step to come, if there is one.
    L : shape (n, 10) or (n + 1, 10)
        From `attest.geometry.wahba.gain_matrices`, alike.
    start
        Tuples q, omega and beta_hat.
    gains
        k_p, k_v, kappa, mu, a and k_b.
    out : shape (n, 13)
        q (4), Omega_hat (3), beta_hat (3), |s_L|, U, |Psi|.

    Returns
    -------
    State
        After the last step.
    """
    table = powers(gains[4])
    state = start
    for i in range(len(h)):
        q, omega, beta = state
        Omega_m, L_i = mean_rate(gyro, i, 0, substeps[i]), mat3.matrix_row(L, i)
        state, s_norm, cost, psi_norm = step(state, Omega_m, L_i, L[i, 9], h[i], gains, table)
        Omega_hat = so3.sub(so3.sub(so3.row(gyro, i), beta), omega)
        record(out, i, q, Omega_hat, beta, s_norm, cost)
        out[i, 12] = psi_norm
        for j in range(1, substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            state, _, _, _ = step(state, Omega_m, L_j, 0.0, h[i], gains, table)
    return state


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias; the bias survives a restart, the rest starts anew."""
    gains = config.gains
    k_b = 2.0 - gains.mu if gains.k_b is None else gains.k_b
    numbers = (gains.k_p, gains.k_v, gains.kappa, gains.mu, 1.0 - 1.0 / gains.p, k_b)
    out = np.empty((len(samples.t), COLUMNS + 1))
    beta = np.array(config.initial.bias)
    for part in segments(samples):
        q = initial_attitude(samples, part, config.initial)
        omega = initial_omega(samples.gyro[part], part, config.initial, beta)
        state = (so3.as_quaternion(q), so3.as_vector(omega), so3.as_vector(beta))
        h = steps(samples, part)
        for block in blocks(part):
            ahead = slice(block.start, min(block.stop + 1, part.stop))
            L, gyro = gain_matrices(samples, ahead, config.weights), samples.gyro[ahead]
            length = h[block.start - part.start : block.stop - part.start]
            state = run(length, samples.substeps[block], gyro, L, state, numbers, out[block])
        beta = out[part.stop - 1, 7:10]
    return estimates("fts", samples, out, states={"psi_norm": out[:, 12]})


def lyapunov(found: Estimates, config: Config, beta_tilde: Array) -> Array:
    """Return V = mu/2 Psi.Psi + k_p U + k_b/2 beta_tilde.beta_tilde, (53), shape (n,)."""
    gains = config.gains
    k_b = 2.0 - gains.mu if gains.k_b is None else gains.k_b
    beta_tilde2 = np.sum(beta_tilde**2, axis=1)
    Psi2 = found.states["psi_norm"] ** 2
    V: Array = 0.5 * gains.mu * Psi2 + gains.k_p * found.cost + 0.5 * k_b * beta_tilde2
    return V


def promises(samples: Samples, found: Estimates, config: Config) -> tuple[Claim, ...]:
    """Compare |s_L| with what Corollary 1 says for the log's gyroscope noise.

    From V' <= -k_p kappa S^(2/p) - k_v P^(2/p) + k_p S eps, (74): whatever P is, V falls outside of
    S = (eps/kappa)^(p/(2 - p)). The corollary knows no noise of the vectors.
    """
    gains, K = config.gains, sorted(config.weights.k)
    sigma = gyro_noise(samples)
    level = (SIGMAS * sigma / gains.kappa) ** (gains.p / (2.0 - gains.p))
    angle = np.rad2deg(level / (K[0] + K[1]))
    half = found.s_norm[len(found.s_norm) // 2 :]
    seen = float(np.percentile(half, 95))
    told = samples.valid.any() and len(half) >= ENOUGH and level < K[1] + K[2]
    return (
        Claim(
            statement=f"V falls wherever |s_L| exceeds {level:.3g} ({angle:.2g}° about the weakest "
            f"axis), for gyroscope noise within {SIGMAS:g} x {np.rad2deg(sigma):.3g} °/s",
            source="FTS, Corollary 1",
            seen=f"|s_L| is within {seen:.3g} in 95 % of the second half; noise of the vectors is "
            "not in the corollary",
            holds=seen <= level if told else None,
            value=seen,
            bound=level,
        ),
    )


OBSERVER = Observer(
    title="Finite-time stable attitude and gyroscope bias",
    paper="Sanyal, Warier, Hamrah: Theorem 1, (46)-(52), discrete (92)-(95)",
    config=Config,
    estimate=estimate,
    lyapunov=lyapunov,
    promises=promises,
)
