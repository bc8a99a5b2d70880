"""The scenarios ``rel-4`` and ``rel-4-noise``: four vectors of an observed object, no gyroscope.

[REL]  Wang, Hamrah, Sanyal, finite-time stable observer for relative attitude, section 4.
[FTS]  Sanyal, Warier, Hamrah, finite-time stable attitude and angular-velocity-bias estimation.

Left open by the paper, and chosen here: steps of 0.01 s for 30 s; the relative motion is [FTS]
(96), which does not start at the paper's Omega_0 = (1, 0.5, 0); the normal noise has a standard
deviation of 0.01 in each entry of L, a hundredth of the vectors' length.

Symbols: R from the observer's frame S to the object's O; D = [d_1 … d_4] known in O; L = R^T D
measured in S (``v1`` … ``v4``).
"""

import numpy as np

from attest.geometry import quaternion
from attest.simulation import experiment, motion, noise
from attest.simulation.experiment import IDENTITY, H, Measured, Turning
from attest.simulation.flight import Flight

STEPS = 3000
"""30 s."""
D = np.vstack([np.eye(3), np.sqrt(6.0) * np.array([1.0, 2.0, 1.0]) / 6.0])
"""(58)-(61)."""
NOISE = 0.01
"""Standard deviation of each entry of L."""

_CONSTANTS = experiment.known(D) | {
    "initial_attitude": IDENTITY,
    "initial_angular_velocity": (0.0, 0.0, 1.0),
    "rel_k_p": (3.0,),
    "rel_p": (1.1,),
    "rel_mu": (0.414,),
    "rel_w_n": (80.0 * np.pi,),
}


def noise_free(seed: int) -> Flight:
    """Turn for 30 s from upside down; the seed changes nothing."""
    return _simulate("rel-4", seed, 0.0)


def noisy(seed: int) -> Flight:
    """Turn likewise; the seed draws normal noise."""
    return _simulate("rel-4-noise", seed, NOISE)


def _simulate(scenario: str, seed: int, std: float) -> Flight:
    omega = motion.Omega(H * np.arange(STEPS + 1.0))
    q_0 = quaternion.exp(np.array([[np.pi, 0.0, 0.0]]))  # (54)
    q = quaternion.continuous(motion.attitudes(q_0, omega, H))
    turning = Turning(experiment.stamps(STEPS), q, omega)
    L = experiment.seen(turning, D)
    L = L + noise.normal(std, L.shape, np.random.default_rng(seed))
    signals = experiment.vectors(turning.t, L)
    constants = {**_CONSTANTS, "vector_std": (std,)}
    return experiment.flight(scenario, seed, turning, Measured(signals, constants))
