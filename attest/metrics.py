"""How far an estimate is from its reference."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Statistics:
    """One error over the scored samples, in degrees."""

    rmse: float
    mean: float
    median: float
    p95: float
    max: float


@dataclass(frozen=True, slots=True, eq=False)
class Metrics:
    """Estimate against reference, by q_e = q_est ⊗ q_ref⁻¹ in the world."""

    reference: str
    """Name of the reference."""
    kind: str
    """``truth`` or ``autopilot``."""
    q_ref: NDArray[np.float64]
    """The reference as used, at the estimate's times; NaN where it has none, shape (n, 4)."""
    error_deg: NDArray[np.float64]
    """Total, heading and inclination error, degrees, NaN where not scored, shape (n, 3)."""
    scored: int
    """How many samples were scored."""
    total: Statistics
    heading: Statistics
    inclination: Statistics
    heading_offset_deg: float
    """Constant heading offset of the estimate against the reference, degrees."""
    without_heading_offset: Statistics
    """Total error after that offset is taken out."""
    settling_bound_deg: float
    settling_time_s: float | None
    """From the first scored sample until the total error stays below the bound; None if never."""
    after_settling: Statistics | None
    """Total error after settling."""
    time_offset_s: float | None
    """Reference's time minus estimate's, from |Ω| of both; None where the motion does not tell."""
    misalignment_deg: float
    """Angle of the constant body-frame rotation between the two, degrees."""
    misalignment: tuple[float, float, float, float]
    """That rotation as a quaternion (w, x, y, z): q_est ≈ q_ref ⊗ misalignment."""
    bias_true: tuple[float, float, float] | None
    """Constant gyroscope bias that truth implies, rad/s, body; None without truth."""
    bias_error: float | None
    """|estimated bias - true bias| at the end, rad/s; None without truth."""
