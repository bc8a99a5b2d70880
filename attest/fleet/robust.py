"""Level, spread, slope and odd ones of a series, whatever a few flights are.

[Sen68]       P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", Journal
              of the American Statistical Association 63(324), 1968.
[Mosteller77] F. Mosteller, J. W. Tukey, "Data Analysis and Regression", 1977, chapters 10 and 14:
              the biweight, and Student's t of 0.7 (n - 1) degrees of freedom with it.
[Wallace59]   D. L. Wallace, "Bounds on normal approximations to Student's and the chi-square
              distributions", Annals of Mathematical Statistics 30(4), 1959.
"""

from math import erfc, log1p, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMAL = 1.4826
"""Deviations of a normal distribution in its median absolute deviation."""
COMPLETE = 200
"""Values of which all pairs are compared; of more, each with the one half a series later."""
NEAR = 3.0
"""Deviations within which no value is odd."""
FAR = 9.0
"""Median absolute deviations at which a value counts nothing."""


def spread(x: Array) -> float:
    """Return the median absolute deviation from the median."""
    return float(np.median(np.abs(x - np.median(x))))


def slope(t: Array, x: Array) -> float:
    """Return the median slope of pairs, Theil's and Sen's [Sen68]; NaN where time stands still."""
    n = len(t)
    if n > COMPLETE:
        first, last = np.arange(n - n // 2), np.arange(n // 2, n)
    else:
        first, last = np.triu_indices(n, 1)
    passed = t[last] - t[first]
    apart = passed > 0.0
    if not apart.any():
        return float("nan")
    return float(np.median((x[last] - x[first])[apart] / passed[apart]))


def odd(x: Array) -> Array:
    """Return each value's chance to be so far from zero, which is their level, if all are normal.

    By the biweight's deviation [Mosteller77]; one within `NEAR` of it, or where most are equal.
    """
    n, mad = len(x), float(np.median(np.abs(x)))
    if n < 2 or mad == 0.0:
        return np.ones(n)
    u = np.minimum((x / (FAR * mad)) ** 2, 1.0)
    below = float(np.sum((1.0 - u) * (1.0 - 5.0 * u)))
    deviation = sqrt(n * float(np.sum(x**2 * (1.0 - u) ** 4))) / abs(below)
    chance = np.ones(n)
    for i in np.flatnonzero(np.abs(x) > NEAR * deviation):
        chance[i] = student(float(x[i]) / deviation, 0.7 * (n - 1))
    return chance


def student(t: float, freedom: float) -> float:
    """Return the chance of Student's |t| to be larger, nearly [Wallace59]."""
    z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * sqrt(freedom * log1p(t * t / freedom))
    return erfc(z / sqrt(2.0))
