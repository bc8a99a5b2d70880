"""The scenario ``fts-7.1``: three directions seen without noise, from upside down.

[FTS]  Sanyal, Warier, Hamrah, finite-time stable attitude and angular-velocity-bias estimation,
       section 7.1. The paper leaves its motion open; here it is that of 7.2, Eq. (96).

Symbols: E = I the inertial vectors e_1, e_2, e_3; U = R^T E what the body sees (``v1`` … ``v3``);
beta the gyroscope's bias; h the step.
"""

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal
from attest.simulation import motion
from attest.simulation.flight import Flight

H = 0.01
"""h, s."""
STEPS = 3000
"""30 s."""
BETA = (-0.1, -1.0, 0.2)
"""beta, rad/s."""


def simulate(seed: int) -> Flight:
    """Turn for 30 s; there is no noise, so the seed changes nothing."""
    t = np.arange(STEPS + 1, dtype=np.int64) * round(H * 1e9)
    omega = motion.Omega(H * np.arange(STEPS + 1.0))
    upside_down = quaternion.exp(np.array([[np.pi, 0.0, 0.0]]))
    q = quaternion.continuous(motion.attitudes(upside_down, omega, H))
    seen = {
        f"v{k}": Signal(t, quaternion.rotate(quaternion.conjugate(q), e_k), f"e_{k} in the body")
        for k, e_k in enumerate(np.eye(3), start=1)
    }
    return Flight(
        scenario="fts-7.1",
        seed=seed,
        t=t,
        q=q,
        omega=omega,
        position=np.zeros((len(t), 3)),
        velocity=np.zeros((len(t), 3)),
        signals={"gyro": Signal(t, omega + np.array(BETA), "Omega + beta"), **seen},
        constants={"gyro_bias": BETA},
    )
