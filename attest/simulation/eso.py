"""The scenarios ``eso-6`` and ``eso-6-noise``: a controlled body that an unknown torque disturbs.

[ESO]  Wang, Sanyal, Hölder-continuous extended state observer, section 6.
[REL]  Wang, Hamrah, Sanyal, finite-time stable observer for relative attitude, section 4.

Left open by the paper, and chosen here: steps of 0.01 s for 40 s; the four inertial vectors are
those of [REL] (58)-(61). The noise is Matlab's `rand`, from [0, 1): it is not of zero mean, so it
leaves an offset that is the input's, not the observer's.

Symbols: J inertia, kg·m²; tau control torque (signal ``torque``) and tau_d disturbance (truth
``disturbance_torque``) in the body, N·m; E inertial vectors; U = R^T E (``v1`` … ``v4``).
"""

from functools import cache

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal, seconds
from attest.simulation import dynamics, experiment, noise, rel
from attest.simulation.experiment import IDENTITY, Measured, Turning
from attest.simulation.flight import Array, Flight

STEPS = 4000
"""40 s."""
J = (4.0, 4.0, 10.0)
"""Diagonal, kg·m²."""
K_C = (0.1, 0.2, 0.3)
"""Diagonal of the controller's gain, N·m."""
NOISE = 0.05
"""Bound of the noise: of each entry of U, and of the gyroscope in rad/s."""
E = rel.D

_CONSTANTS = experiment.known(E) | {
    "inertia": J,
    "initial_attitude": IDENTITY,
    "initial_angular_velocity": (0.0, 0.0, 1.0),
    "initial_sigma": (2.0, 3.0, 5.0),
    "eso_alpha": (0.85,),
    "eso_gamma": (2.0,),
    "eso_kappa": (0.15,),
    "eso_k_sigma": (5.0,),
    "eso_k_psi": (5.0,),
}


def tau(t: float, R: Array, Omega: Array) -> Array:  # noqa: ARG001 - a Torque
    """Control torque -1/2 vex(K_c R - R^T K_c), N·m."""
    A = np.array(K_C)[:, np.newaxis] * R
    return -0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])


def tau_d(t: float, R: Array, Omega: Array) -> Array:  # noqa: ARG001 - a Torque
    """Disturbance torque, N·m."""
    w = 0.2 * np.pi * t
    return np.array([0.2 * np.sin(w), 0.1 * np.sin(2.0 * w), 0.5 * np.cos(0.5 * w)])


def noise_free(seed: int) -> Flight:
    """Turn for 40 s from upside down; the seed changes nothing."""
    return _simulate("eso-6", seed, 0.0)


def noisy(seed: int) -> Flight:
    """Turn likewise; the seed draws the paper's uniform noise."""
    return _simulate("eso-6-noise", seed, NOISE)


@cache
def _turning() -> Turning:
    t = experiment.stamps(STEPS)
    body = dynamics.Body(np.diag(J), tau, tau_d)
    q_0 = quaternion.exp(np.array([np.pi, 0.0, 0.0]))
    return Turning(t, *dynamics.integrate(body, q_0, np.array([1.0, 0.5, 0.0]), seconds(t, 0)))


def _simulate(scenario: str, seed: int, bound: float) -> Flight:
    rng = np.random.default_rng(seed)
    t = experiment.stamps(STEPS)
    turning = _turning()
    U = experiment.seen(turning, E)
    U = U + noise.rand(bound, U.shape, rng)
    along = seconds(t, 0), turning.q, turning.omega
    signals = {
        "gyro": Signal(t, turning.omega + noise.rand(bound, (len(t), 3), rng), "Omega + noise"),
        "torque": Signal(t, dynamics.torques(tau, *along), "tau"),
        **experiment.vectors(t, U),
    }
    truth = {"disturbance_torque": Signal(t, dynamics.torques(tau_d, *along), "tau_d")}
    return experiment.flight(scenario, seed, turning, Measured(signals, _CONSTANTS, truth))
