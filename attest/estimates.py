"""What an observer found."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """Attitude and what came with it, at n times."""

    observer: str
    """Name of the observer, such as ``fts``."""
    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, strictly increasing, shape (n,)."""
    q: NDArray[np.float64]
    """Unit quaternion (w, x, y, z), body to world, sign continuous in time, shape (n, 4)."""
    angular_velocity: NDArray[np.float64]
    """Estimated angular velocity in the body, rad/s, shape (n, 3)."""
    gyro_bias: NDArray[np.float64] | None
    """Estimated gyroscope bias in the body, rad/s, shape (n, 3); None of an observer without."""
    s_norm: NDArray[np.float64]
    """|s_L|, the observer's residual, shape (n,)."""
    cost: NDArray[np.float64]
    """Wahba's cost U of the estimate, shape (n,)."""
    updated: NDArray[np.bool_]
    """Which vectors were used, shape (n, k)."""
    lyapunov: NDArray[np.float64] | None = None
    """The paper's Lyapunov function, shape (n,), where it has one and truth is known."""
    frames: tuple[str, str] | None = None
    """Names of the frames that q leads to and from; None: the world, and the body."""
    states: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """Observer-specific states, each (n,) or (n, j)."""
    constants: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    """What an observer found that is the same throughout, of any shape."""
