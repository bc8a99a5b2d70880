"""What an observer steps over."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Sensors:
    """The sensors' own errors, as far as a log or the configuration tells them."""

    gyro_scale: NDArray[np.float64] | None = None
    """Of the gyroscope's axes, shape (3,); NaN where it is not known."""
    mag_latency_s: float | None = None
    """How late the magnetometer is against the gyroscope; zero also where turns do not tell."""
    hard_iron: NDArray[np.float64] | None = None
    """In the body, tesla, shape (3,); NaN along what the motion does not tell."""
    soft_iron: NDArray[np.float64] | None = None
    """Shape (3, 3), the identity where there is none."""
    iron: Literal["applied", "found", "given"] | None = None
    """Whether iron was found and taken off, found and left, or taken off as it is configured."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """One timeline of n steps, at the gyroscope's stamps, with k measured vectors.

    Where the log is slower than the gains allow, a step is taken in several sub-steps, for which
    gyroscope and vectors are interpolated to those of the next step.
    """

    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, strictly increasing, shape (n,)."""
    gyro: NDArray[np.float64]
    """Angular velocity over the step that begins here, measured and corrected by what conditioning
    knew of the gyroscope's errors, rad/s, body, (n, 3); NaN where feature points stand alone."""
    body: NDArray[np.float64]
    """Measured unit vectors u_i in the body, shape (n, k, 3); a guess where not valid. Differences
    of feature points keep their length, in units of the longest one of the model."""
    inertial: NDArray[np.float64]
    """Known unit vectors e_i in the world, shape (n, k, 3), or (1, k, 3) where constant; of
    feature points, the differences of the model."""
    valid: NDArray[np.bool_]
    """Which vectors may be used at each step, shape (n, k)."""
    names: tuple[str, ...]
    """The signal of each vector, k of them."""
    substeps: NDArray[np.int64]
    """In how many sub-steps to go from each step to the next, shape (n,)."""
    restart: NDArray[np.bool_]
    """Steps at which an observer must start anew: the first, and after each gap, shape (n,)."""
    length: NDArray[np.float64] | None = None
    """Lengths of the measured vectors in their own units (m/s², tesla), shape (n, k)."""
    torque: NDArray[np.float64] | None = None
    """Control torque in the body, N·m, shape (n, 3), where the log has it."""
    field: NDArray[np.float64] | None = None
    """The magnetic model's field in the world, tesla, shape (3,), where the log has a place."""
    measured: NDArray[np.float64] | None = None
    """Unit vectors in the body before they were smoothed, shape (n, k, 3); None where `body` is."""
    world: str = "ned"
    """Axes of the world in which the inertial vectors are, ned or enu."""
    mean: NDArray[np.float64] | None = None
    """Mean angular velocity over each step, rad/s, (n, 3); None: that of its two ends."""
    rate: NDArray[np.float64] | None = None
    """Angular velocity at the stamps, corrected alike, rad/s, (n, 3); None where it is `gyro`."""
    bias: NDArray[np.float64] | None = None
    """Bias that conditioning took off, rad/s, shape (n, 3); None where it took none."""
    rest: NDArray[np.bool_] | None = None
    """Where the body is at rest, shape (n,); None where that was not looked for."""
    sensors: Sensors = Sensors()
    """The sensors' own errors."""


def segments(samples: Samples) -> Iterator[slice]:
    """Yield the stretches between restarts."""
    edges = [*np.flatnonzero(samples.restart).tolist(), len(samples.t)]
    for first, last in pairwise(edges):
        yield slice(first, last)


def mean_rates(samples: Samples) -> NDArray[np.float64]:
    """Return the mean angular velocity over each step, rad/s, shape (n, 3)."""
    if samples.mean is not None:
        return samples.mean
    gyro = samples.gyro
    mean: NDArray[np.float64] = 0.5 * (gyro + np.concatenate([gyro[1:], gyro[-1:]]))
    return mean
