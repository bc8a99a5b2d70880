"""The scenarios ``fts-7.1``, ``fts-7.2-high`` and ``fts-7.2-low``: three directions, biased gyro.

[FTS]  Sanyal, Warier, Hamrah, finite-time stable attitude and angular-velocity-bias estimation,
       section 7.

Left open by the paper, and chosen here: the directions are the inertial axes; the motion of 7.1 is
that of 7.2, Eq. (96); noise turns each direction by a vector of three independent draws, so that
the stated standard deviation is that about either axis across it; the initial principal angle of
7.2 is normal, about an axis drawn evenly from the sphere. Both cases of 7.2 have the same start and
the same draws for the same seed, scaled. Which of two gains of 7.1 is k_p is not readable.

Symbols: E = I the inertial vectors e_1, e_2, e_3; U = R^T E what the body sees (``v1`` … ``v3``);
beta the gyroscope's bias.
"""

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal
from attest.simulation import experiment, motion, noise
from attest.simulation.experiment import IDENTITY, H, Measured, Turning
from attest.simulation.flight import Array, Flight

STEPS = 3000
"""30 s."""
E = np.eye(3)
BETA_1 = (-0.1, -1.0, 0.2)
"""beta of 7.1, rad/s."""
BETA_2 = (-0.01, -0.005, 0.02)
"""beta of 7.2, rad/s."""
ATTITUDE_STD = np.radians(60.0)
"""Of the initial principal angle in 7.2."""

_GAINS = {"fts_k_p": (2.0,), "fts_k_v": (1.0,), "fts_kappa": (0.1,), "fts_mu": (0.35,)}
_START = {"initial_attitude": IDENTITY, "initial_bias": (0.0, 0.0, 0.1)}
_CONSTANTS = experiment.known(E) | _START | _GAINS | {"fts_p": (1.1,)}
_OTHERS = {"vae_m": (0.5,), "vae_d": (2.4, 2.6, 2.8), "cgo_k_i": (0.3,)}  # (97) and beside it


def noise_free(seed: int) -> Flight:
    """Turn for 30 s from upside down; the seed changes nothing."""
    turning = _turn(np.array([np.pi, 0.0, 0.0]))
    gyro = Signal(turning.t, turning.omega + np.array(BETA_1), "Omega + beta")
    signals = {"gyro": gyro, **experiment.vectors(turning.t, experiment.seen(turning, E))}
    start = {"gyro_bias": BETA_1, "initial_angular_velocity": (0.0, 0.0, 1.0)}
    return experiment.flight("fts-7.1", seed, turning, Measured(signals, {**_CONSTANTS, **start}))


def high_noise(seed: int) -> Flight:
    """Case I: 30° and 25°/s."""
    return _noisy("fts-7.2-high", seed, np.radians(30.0), np.radians(25.0))


def low_noise(seed: int) -> Flight:
    """Case II: 0.95° and 2.5°/s."""
    return _noisy("fts-7.2-low", seed, np.radians(0.95), np.radians(2.5))


def _noisy(scenario: str, seed: int, vector_std: float, gyro_std: float) -> Flight:
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    angle = noise.normal(ATTITUDE_STD, 1, rng)
    turning = _turn(angle * axis / np.linalg.norm(axis))
    U = experiment.seen(turning, E)
    U = noise.turned(U, noise.bump(vector_std, U.shape, rng))
    Omega_m = turning.omega + np.array(BETA_2) + noise.bump(gyro_std, turning.omega.shape, rng)
    gyro = Signal(turning.t, Omega_m, "Omega + beta + noise")
    levels = {
        "gyro_bias": BETA_2,
        "attitude_std": (ATTITUDE_STD,),
        "vector_std": (vector_std,),
        "gyro_std": (gyro_std,),
    }
    signals = {"gyro": gyro, **experiment.vectors(turning.t, U)}
    measured = Measured(signals, {**_CONSTANTS, **_OTHERS, **levels})
    return experiment.flight(scenario, seed, turning, measured)


def _turn(phi_0: Array) -> Turning:
    """Motion (96) from exp(hat(phi_0)), discretised as the paper has it."""
    omega = motion.Omega(H * np.arange(STEPS + 1.0))
    q = motion.attitudes(quaternion.exp(phi_0[np.newaxis]), omega, H)
    return Turning(experiment.stamps(STEPS), quaternion.continuous(q), omega)
