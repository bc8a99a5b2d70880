"""What an observer steps over."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One timeline of n steps with k measured vectors.

    Steps stand at the gyroscope's stamps and, where the log is slower than the gains allow, at
    sub-steps between them; ``kept`` tells which steps are the gyroscope's own.
    """

    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, strictly increasing, shape (n,)."""
    gyro: NDArray[np.float64]
    """Measured angular velocity held over the step that begins at ``t``, rad/s, body, (n, 3)."""
    body: NDArray[np.float64]
    """Measured unit vectors u_i in the body, shape (n, k, 3); zero where not valid."""
    inertial: NDArray[np.float64]
    """Known unit vectors e_i in the world, shape (n, k, 3), or (1, k, 3) where constant."""
    valid: NDArray[np.bool_]
    """Which vectors may be used at each step, shape (n, k)."""
    names: tuple[str, ...]
    """The signal of each vector, k of them."""
    kept: NDArray[np.intp]
    """Steps that stand at a stamp of the gyroscope, shape (m,)."""
    restart: NDArray[np.bool_]
    """Steps at which an observer must start anew: the first, and after each gap, shape (n,)."""
