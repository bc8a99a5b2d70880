"""The scenario ``vae-6``: nine directions and a gyroscope with bounded noise, a torque that swings.

[VAE]  Izadi, Viswanathan, Sanyal, Silvestre, Oliveira, variational attitude estimator with bias,
       section 6.

Left open by the paper, and chosen here: the nine directions are the axes and the diagonals of the
coordinate planes, all seen all the time; the waves' amplitudes are 1.2°, 0.7° and 0.5° (2.4° in
all), added to each entry of U as radians, and 0.6°/s and 0.37°/s (0.97°/s in all); the seed draws
their phases. At h = 0.01 s the waves of 100 and 200 Hz are the same at every sample: constants of
up to 0.5° and 0.37°/s that no observer can tell from the truth, the latter from bias.

Symbols: E inertial vectors; U = R^T E (``v1`` … ``v9``); beta the bias; J_v inertia, kg·m².
"""

from functools import cache

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal, seconds
from attest.simulation import dynamics, experiment, noise
from attest.simulation.experiment import Measured, Turning
from attest.simulation.flight import Array, Flight

STEPS = 4000
"""40 s."""
J_V = (2.56, 3.01, 2.98)
"""Diagonal of J_v, kg·m²."""
BETA = (-0.01, -0.005, 0.02)
"""(36), rad/s."""
R_0 = np.pi / 4.0 * np.array([3.0, 6.0, 2.0]) / 7.0
"""Rotation vector of the start (35)."""
OMEGA_0 = np.pi / 60.0 * np.array([-2.1, 1.2, -1.1])
"""(35), rad/s."""
VECTOR_NOISE = {1.0: 1.2, 10.0: 0.7, 100.0: 0.5}
"""Degrees by Hz."""
GYRO_NOISE = {10.0: 0.6, 200.0: 0.37}
"""Degrees per second by Hz."""

_DIAGONALS = [[0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 1, -1], [-1, 0, 1], [1, -1, 0]]
E = np.vstack([np.eye(3), np.sqrt(0.5) * np.array(_DIAGONALS)])

_CONSTANTS = experiment.known(E) | {
    "gyro_bias": BETA,
    "inertia": J_V,
    "initial_attitude": tuple(quaternion.exp(1.6 * R_0).tolist()),  # pi/2.5 about the same axis
    "initial_angular_velocity": (-0.26, 0.1725, -0.2446),
    "initial_bias": (0.0, -0.01, 0.01),
    "vae_m": (5.0,),
    "vae_d": (17.4, 18.85, 20.3),  # (37)
    "vae_p": (2000.0, 2000.0, 2000.0),
}


def phi(t: float, R: Array, Omega: Array) -> Array:  # noqa: ARG001 - a Torque
    """External torque (34), N·m."""
    return np.array([0.0, 0.028 * np.sin(2.7 * t - np.pi / 7.0), 0.0])


@cache
def _turning() -> Turning:
    t = experiment.stamps(STEPS)
    body = dynamics.Body(np.diag(J_V), phi)
    return Turning(t, *dynamics.integrate(body, quaternion.exp(R_0), OMEGA_0, seconds(t, 0)))


def simulate(seed: int) -> Flight:
    """Turn for 40 s; the seed draws the phases of the noise."""
    rng = np.random.default_rng(seed)
    t = experiment.stamps(STEPS)
    s = seconds(t, 0)
    turning = _turning()
    U = experiment.seen(turning, E)
    U = U + np.radians(noise.sinusoids(s, VECTOR_NOISE, E.shape, rng))
    nu = np.radians(noise.sinusoids(s, GYRO_NOISE, (3,), rng))
    torque = dynamics.torques(phi, s, turning.q, turning.omega)
    signals = {
        "gyro": Signal(t, turning.omega + np.array(BETA) + nu, "Omega + beta + noise"),
        "torque": Signal(t, torque, "phi"),
        **experiment.vectors(t, U),
    }
    return experiment.flight("vae-6", seed, turning, Measured(signals, _CONSTANTS))
