"""Extended state observer: attitude, angular velocity and disturbance torque of a rigid body.

[ESO]  N. Wang, A. K. Sanyal, "A Hölder-continuous extended state observer for rigid body attitude
       dynamics", IFAC-PapersOnLine 55-22, 2022. Theorems 1, 2, Proposition 3, (26)-(32).

Symbols: R (as a quaternion q), Omega_hat, sigma_hat estimates of attitude, angular velocity and
disturbance sigma = J^-1 tau_d; J inertia; tau control torque; s_L residual, w_L its rate, z_L its
Hölder-continuous power; Omega_tilde = Omega_m - Omega_hat; Psi = Omega_tilde - kappa z_L.

Departures: the paper knows no gyroscope bias; ``initial.bias`` is subtracted, and held. Steps are
explicit and geometric, as in [FTS] (92)-(95); the powers of s_L and Psi are floored. (31) reads
Omega_tilde in its first line, as (32).
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.claims import Claim
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.eso_settings import Config, inertia_matrix
from attest.observers.hoelder import power, turned
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
State = tuple[Quaternion, Vector, Vector]
"""q, Omega_hat, sigma_hat."""
Numbers = tuple[float, float, float, float, float]
"""alpha, (1 - alpha)/gamma, kappa, k_sigma, k_Psi."""

SECOND = 1_000_000_000


@kernel
def derivatives(
    s: Vector, w: Vector, Omega_tilde: Vector, gains: Numbers
) -> tuple[Vector, Vector, Vector]:
    """Return Omega_hat' less J^-1 (J Omega_m x Omega_m + tau) + sigma_hat, sigma_hat', and Psi."""
    alpha, a, kappa, k_sigma, k_Psi = gains
    slope = power(s, a)
    Psi = so3.sub(Omega_tilde, so3.scale(kappa * slope, s))  # (26), (29)
    on_Psi = power(Psi, 0.5 * (1.0 - alpha))
    pull = so3.scale(k_Psi * on_Psi, Psi)
    Omega_dot = so3.sub(pull, so3.scale(kappa * slope, turned(s, w, a)))
    return Omega_dot, so3.scale(k_sigma * on_Psi * on_Psi, Psi), Psi  # (30)


@kernel
def step(
    state: State,
    Omega_m: Vector,
    tau: Vector,
    L: Matrix,
    constant: float,
    h: float,
    J: tuple[Matrix, Matrix],
    gains: Numbers,
) -> tuple[State, float, float, float]:
    """Advance the state by h, all right sides at its beginning, (30).

    Returns
    -------
    state
        q, Omega_hat and sigma_hat after the step.
    s_norm, cost, psi_norm : float
        |s_L|, Wahba's cost and |Psi| before it.
    """
    q, Omega_hat, sigma = state
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), L)
    s, w = wahba.residual(B), wahba.residual_rate(B, Omega_hat, Omega_m)  # (27)
    Omega_dot, sigma_dot, Psi = derivatives(s, w, so3.sub(Omega_m, Omega_hat), gains)
    gyroscopic = so3.cross(mat3.apply(J[0], Omega_m), Omega_m)
    model = so3.add(mat3.apply(J[1], so3.add(gyroscopic, tau)), sigma)
    after = (
        so3.multiply(q, so3.exp(so3.scale(h, Omega_hat))),
        so3.add(Omega_hat, so3.scale(h, so3.add(model, Omega_dot))),
        so3.add(sigma, so3.scale(h, sigma_dot)),
    )
    return after, sqrt(so3.dot(s, s)), wahba.cost(constant, B), sqrt(so3.dot(Psi, Psi))


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    torque: Array,
    L: Array,
    start: State,
    J: tuple[Matrix, Matrix],
    gains: Numbers,
    out: Array,
) -> None:
    """Fold (30) over the steps; row i of out (n, 16) is the state before step i.

    J is the inertia and its inverse; torque, (n, 3) or (1, 3) where constant, is held over a step.
    The columns of the bias hold sigma_hat instead, the last ones |Psi| and tau_d_hat = J sigma_hat.
    """
    state = start
    for i in range(len(h)):
        q, Omega_hat, sigma = state
        tau = so3.row(torque, min(i, len(torque) - 1))
        Omega_m, L_i = mean_rate(gyro, i, 0, substeps[i]), mat3.matrix_row(L, i)
        state, s_norm, cost, psi_norm = step(state, Omega_m, tau, L_i, L[i, 9], h[i], J, gains)
        record(out, i, q, Omega_hat, sigma, s_norm, cost)
        out[i, 12] = psi_norm
        out[i, 13], out[i, 14], out[i, 15] = mat3.apply(J[0], sigma)
        for j in range(1, substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            state, _, _, _ = step(state, Omega_m, tau, L_j, 0.0, h[i], J, gains)


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude, rate and disturbance torque; each stretch starts anew."""
    gains = config.gains
    a = (1.0 - gains.alpha) / gains.gamma
    numbers = (gains.alpha, a, gains.kappa, gains.k_sigma, gains.k_Psi)
    J = inertia_matrix(config.plant.inertia)
    both = _tuple(J), _tuple(np.asarray(np.linalg.inv(J), np.float64))
    beta = np.array(config.initial.bias)
    torque = _torque(samples, config)
    out = np.empty((len(samples.t), COLUMNS + 4))
    for part in segments(samples):
        gyro = samples.gyro[part] - beta if beta.any() else samples.gyro[part]
        q = initial_attitude(samples, part, config.initial)
        Omega_hat, sigma = gyro[0], np.zeros(3)
        if part.start == 0:
            sigma = np.array(config.initial.disturbance)
            if config.initial.angular_velocity is not None:
                Omega_hat = np.array(config.initial.angular_velocity)
        start = (so3.as_quaternion(q), so3.as_vector(Omega_hat), so3.as_vector(sigma))
        L = gain_matrices(samples, part, config.weights)
        h, substeps = steps(samples, part), samples.substeps[part]
        run(
            h,
            substeps,
            gyro,
            torque[part] if len(torque) > 1 else torque,
            L,
            start,
            both,
            numbers,
            out[part],
        )
    states = {"disturbance_torque": out[:, 13:16], "psi_norm": out[:, 12]}
    return estimates("eso", samples, out, bias=False, states=states)


def _tuple(A: Array) -> Matrix:
    return mat3.matrix_row(A.reshape(1, 9), 0)


def _torque(samples: Samples, config: Config) -> Array:
    """Return the control torque, (n, 3), or (1, 3) where constant; zero where nothing tells it."""
    if config.plant.torque is not None:
        return np.array([config.plant.torque])
    return np.zeros((1, 3)) if samples.torque is None else samples.torque


def promises(samples: Samples, found: Estimates, config: Config) -> tuple[Claim, ...]:
    """Say what the disturbance is made of, and compare |Psi| with what (40) settles to."""
    lasts = samples.t[-1] - samples.t[len(samples.t) // 2] > 2 * SECOND
    settled = (_settled(samples, found, config),) if lasts else ()
    return (_model(samples, config), *settled)


def _model(samples: Samples, config: Config) -> Claim:
    inertia = "1 kg m² about each axis" if config.plant.inertia is None else "as configured"
    if config.plant.torque is None and samples.torque is None:
        torque = "no control torque is known: all torque is disturbance"
    elif config.plant.torque is None:
        torque = "control torque of the log"
    else:
        torque = "control torque as configured"
    return Claim(
        statement="inertia and control torque are known",
        source="ESO, (5)",
        seen=f"inertia {inertia}; {torque}",
        holds=None,  # nothing in the log tells
    )


def _settled(samples: Samples, found: Estimates, config: Config) -> Claim:
    """Compare |Psi| with the level at which (40) rests under the disturbance's rate delta.

    There sigma_tilde = k_Psi |Psi|^(alpha - 1) Psi and k_sigma |Psi|^(2 alpha - 2) Psi = delta.
    delta is what sigma_hat changes by within a second, so that noise is not in it.
    """
    gains = config.gains
    delta = _disturbance_rate(samples, found, config)
    level = (delta / gains.k_sigma) ** (1.0 / (2.0 * gains.alpha - 1.0))
    lag = gains.k_Psi * level**gains.alpha
    psi = found.states["psi_norm"]
    seen = float(np.percentile(psi[len(psi) // 2 :], 95))
    return Claim(
        statement=f"|Psi| stays within {level:.3g} rad/s, where (40) rests under a disturbance "
        f"that changes by {delta:.3g} rad/s³ (sigma_hat is then {lag:.3g} rad/s² late)",
        source="ESO, Theorem 2",
        seen=f"{seen:.3g} rad/s (95 % of the second half); the change is that of sigma_hat itself, "
        "and noise of gyroscope and vectors is not in the level",
        holds=True if seen <= level else None,
        value=seen,
        bound=level,
    )


def _disturbance_rate(samples: Samples, found: Estimates, config: Config) -> float:
    """Return the most that sigma_hat changes in a second, in the second half, rad/s³."""
    J_inverse = np.linalg.inv(inertia_matrix(config.plant.inertia))
    half = len(samples.t) // 2
    t, sigma = samples.t[half:], found.states["disturbance_torque"][half:] @ J_inverse.T
    later = np.searchsorted(t, t + SECOND)
    whole = later < len(t)
    if not whole.any():
        return 0.0
    change = sigma[later[whole]] - sigma[whole]
    return float(np.linalg.norm(change, axis=1).max())


OBSERVER = Observer(
    title="Extended state observer of attitude, rate and disturbance torque",
    paper="Wang, Sanyal: Theorems 1, 2, Proposition 3, (26)-(32)",
    config=Config,
    estimate=estimate,
    promises=promises,
)
