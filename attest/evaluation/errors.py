"""Attitude errors, q_e = q_est ⊗ q_ref⁻¹ in the world, and what is constant in them.

[BROAD]  D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD: a benchmark for robust inertial
         orientation estimation", Data 6(7), 2021: total, heading and inclination.
[Markley07]  F. L. Markley, Y. Cheng, J. L. Crassidis, Y. Oshman, "Averaging quaternions",
             JGCD 30(4), 2007.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.metrics import Statistics

Array = NDArray[np.float64]


def attitude_error(q: Array, q_ref: Array) -> Array:
    """Return q_e = q_est ⊗ q_ref⁻¹, the error in the world, shape (n, 4)."""
    return quaternion.multiply(q, quaternion.conjugate(q_ref))


def angles(q_e: Array) -> Array:
    """Return total, heading and inclination error, rad, not negative, shape (n, 3), [BROAD].

    2 acos|w|, 2 atan|z/w| and 2 acos sqrt(w²+z²), so that cos(total/2) is the product of the
    other two's; by atan2, which keeps its digits where acos loses them.
    """
    w, x, y, z = np.abs(np.moveaxis(q_e, -1, 0))
    total = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w)
    heading = 2.0 * np.arctan2(z, w)
    inclination = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    return np.stack([total, heading, inclination], axis=-1)


def statistics(error: Array) -> Statistics:
    """Summarise an error in degrees, shape (n,), n at least 1."""
    return Statistics(
        rmse=float(np.sqrt(np.mean(error**2))),
        mean=float(np.mean(error)),
        median=float(np.median(error)),
        p95=float(np.percentile(error, 95)),
        max=float(np.max(error)),
    )


def mean_rotation(q: Array) -> Array:
    """Return the average of rotations (n, 4), the chief eigenvector of sum q q^T, [Markley07]."""
    _, vectors = np.linalg.eigh(q.T @ q)
    mean: Array = vectors[:, -1]
    return mean if mean[0] >= 0.0 else -mean


def heading_offset(q_e: Array) -> float:
    """Return the constant heading, rad, that makes the total error least.

    Maximises the sum of squared scalar parts of rot_z(-psi) q_e: psi = atan2(2 sum wz, sum w²-z²).
    """
    w, z = q_e[:, 0], q_e[:, 3]
    return float(np.arctan2(2.0 * np.sum(w * z), np.sum(w * w - z * z)))


def turned(q_e: Array, psi: float) -> Array:
    """Return the errors after the heading psi, rad, is taken out of the estimate."""
    back = np.array([np.cos(0.5 * psi), 0.0, 0.0, -np.sin(0.5 * psi)])
    return quaternion.multiply(back, q_e)


def settling(total: Array, bound: float) -> int | None:
    """Return the first sample from which the error stays below the bound; None if it never does."""
    above = np.flatnonzero(total >= bound)
    first = int(above[-1]) + 1 if above.size else 0
    return first if first < len(total) else None
