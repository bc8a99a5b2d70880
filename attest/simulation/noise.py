"""Noise as the papers draw it, and how it enters a measurement.

Every model takes a shape and the generator that draws. Noise is either added to what is measured,
`u + noise`, or turns a direction, `turned`.

[FTS]  Sanyal, Warier, Hamrah, finite-time stable attitude and angular-velocity-bias estimation,
       section 7.2: bump functions.
[VAE]  Izadi et al., variational attitude estimator with bias, section 6: sums of sinusoids.
[ESO]  Wang, Sanyal, Hölder-continuous extended state observer, section 6: `rand`.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion

Array = NDArray[np.float64]
Shape = int | tuple[int, ...]

_KNOTS = 4097  # of the table: its standard deviation is right to 1e-6


def bump(std: float, shape: Shape, rng: np.random.Generator) -> Array:
    """Draw from the density ~ exp(-1/(1 - x²)), |x| < 1, scaled to a standard deviation [FTS].

    It has zero mean and ends at 2.515 standard deviations.
    """
    x, cumulated, spread = _bump_table()
    drawn: Array = np.interp(rng.random(shape), cumulated, x) * (std / spread)
    return drawn


@cache
def _bump_table() -> tuple[Array, Array, float]:
    """Return x, the distribution function there, and the standard deviation of x."""
    x = np.linspace(-1.0, 1.0, _KNOTS)
    density = np.zeros(_KNOTS)
    density[1:-1] = np.exp(-1.0 / (1.0 - x[1:-1] ** 2))
    # the density is flat at both ends, where the trapezoidal rule is exact to rounding
    cumulated = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    spread = float(np.sqrt(np.sum(x * x * density) / np.sum(density)))
    return x, cumulated / cumulated[-1], spread


def sinusoids(
    t: Array, amplitudes: Mapping[float, float], shape: tuple[int, ...], rng: np.random.Generator
) -> Array:
    """Sum sine waves at t seconds, each entry with phases of its own, (len(t), *shape) [VAE].

    Parameters
    ----------
    t
        Times, s.
    amplitudes
        Amplitude by frequency in Hz. Beyond half the sampling rate a wave is aliased, and at a
        multiple of that rate it is a constant.
    shape
        Shape of the noise of one moment.
    rng
        Draws the phases.
    """
    total = np.zeros((len(t), *shape))
    for frequency, amplitude in amplitudes.items():
        phase = rng.uniform(0.0, 2.0 * np.pi, shape)
        angle = 2.0 * np.pi * frequency * t
        total += amplitude * np.sin(angle.reshape(-1, *(1 for _ in shape)) + phase)
    return total


def uniform(bound: float, shape: Shape, rng: np.random.Generator) -> Array:
    """Draw evenly from [-bound, bound): zero mean, standard deviation bound / sqrt 3."""
    return rng.uniform(-bound, bound, shape)


def rand(bound: float, shape: Shape, rng: np.random.Generator) -> Array:
    """Draw evenly from [0, bound), as Matlab's `rand` does: the mean is bound / 2 [ESO]."""
    drawn: Array = bound * rng.random(shape)
    return drawn


def normal(std: float, shape: Shape, rng: np.random.Generator) -> Array:
    """Draw from the normal distribution of zero mean."""
    drawn: Array = std * rng.standard_normal(shape)
    return drawn


def turned(u: Array, nu: Array) -> Array:
    """Turn directions by noise: exp(hat(nu)) u keeps their length.

    With three independent entries of nu, each of standard deviation s in radians, u errs by s about
    either axis across it; what nu has along u does nothing.
    """
    return quaternion.rotate(quaternion.exp(nu), u)
