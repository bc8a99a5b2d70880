"""Rotational motion with exact discrete truth, as the papers' experiments have it.

[FTS]  Sanyal, Warier, Hamrah, finite-time stable attitude and angular-velocity-bias estimation.

Symbols: Omega angular velocity in the body, rad/s; h step, s; R = R(q) body to inertial.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion

Array = NDArray[np.float64]


def Omega(t: Array) -> Array:
    """Angular velocity of [FTS] (96) at the times t in seconds, rad/s, shape (n, 3)."""
    return np.stack(
        [
            np.sin(2.0 * np.pi * t / 15.0),
            np.sin(2.0 * np.pi * t / 18.0 + np.pi / 20.0),
            np.cos(2.0 * np.pi * t / 17.0),
        ],
        axis=-1,
    )


def attitudes(q_0: Array, rates: Array, h: float) -> Array:
    """Fold R_{i+1} = R_i exp(h hat(Omega_i)) from R_0, shape (n, 4) for n rates."""
    steps = quaternion.exp(h * rates)
    q = np.empty((len(rates), 4))
    q[:1] = q_0
    for i in range(len(rates) - 1):
        q[i + 1] = quaternion.multiply(q[i], steps[i])
    return quaternion.normalize(q)  # only rounding has left the unit sphere
