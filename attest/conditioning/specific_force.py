"""The accelerometer's reference where the log has velocity: a - g, known in the world.

An accelerometer measures R^T (a - g). In a turn that differs from -R^T g for minutes, so gravity
alone is no known vector; with a from the log's velocity, a - g is one, as the papers ask
([FTS] Assumption 1). Both sides are smoothed by the same Gaussian: the velocity's derivative in the
world, the accelerometer in the frame that the gyroscope integrates.
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel
from attest.recording import seconds

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

REACH = 3.0
"""Standard deviations at which the Gaussian is cut."""
LAGS = np.arange(-1.0, 1.0001, 0.02)
"""Lags of the velocity that are tried, s."""
USUAL = 0.15
"""Lag of a velocity, s, as a standard deviation: receivers and their filters are late by 0.05 to
0.3 s."""
ALIKE = 1.0
"""How long residuals of what is smoothed stay the same, s."""
ENOUGH = 0.3
"""Standard deviation of |a - g|, m/s², from which the lag can be told."""


@kernel
def _line(x: Array, y: Array, sigma: float, level: Array, slope: Array) -> None:
    """Fit y = level + slope x with Gaussian weights.

    Fills level and slope (3,); NaN from fewer than three samples.
    """
    s0 = s1 = s2 = 0.0
    level[:] = 0.0
    slope[:] = 0.0
    for j in range(len(x)):
        w = np.exp(-0.5 * (x[j] / sigma) ** 2)
        s0 += w
        s1 += w * x[j]
        s2 += w * x[j] * x[j]
        for a in range(3):
            level[a] += w * y[j, a]
            slope[a] += w * x[j] * y[j, a]
    det = s0 * s2 - s1 * s1
    for a in range(3):
        y0, y1 = level[a], slope[a]
        if len(x) < 3 or det <= 1e-12 * s0 * s2:
            level[a] = slope[a] = np.nan
        else:
            level[a] = (s2 * y0 - s1 * y1) / det
            slope[a] = (s0 * y1 - s1 * y0) / det


@kernel
def _lines(t: Array, stamps: Array, y: Array, sigma: float, level: Array, slope: Array) -> None:
    """Fill level and slope (n, 3) of the lines around each of the times t."""
    first = last = 0
    for i in range(len(t)):
        while first < len(stamps) and stamps[first] < t[i] - REACH * sigma:
            first += 1
        while last < len(stamps) and stamps[last] <= t[i] + REACH * sigma:
            last += 1
        _line(stamps[first:last] - t[i], y[first:last], sigma, level[i], slope[i])


def smooth(t: Stamps, stamps: Stamps, y: Array, sigma: float) -> tuple[Array, Array]:
    """Return level and slope (per second) of y at times t, by a local line with Gaussian weights.

    Evaluated at knots a fifth of ``sigma`` apart and interpolated, so that the cost grows with the
    number of samples and not with their rate times ``sigma``. NaN where too few are in reach.
    """
    origin = int(t[0])
    at = seconds(t, origin)
    knots = _knots(at, sigma / 5.0)
    level, slope = np.empty((len(knots), 3)), np.empty((len(knots), 3))
    _lines(knots, seconds(stamps, origin), y, sigma, level, slope)
    if len(knots) == len(at):
        return level, slope
    return _interpolate(at, knots, level), _interpolate(at, knots, slope)


def _knots(at: Array, spacing: float) -> Array:
    """Return the times themselves, or fewer that stand where the times do."""
    chosen = np.unique(np.floor(at / spacing), return_index=True)[1]
    if 2 * len(chosen) > len(at):
        return at
    knots: Array = at[np.unique(np.append(chosen, len(at) - 1))]
    return knots


def _interpolate(at: Array, x: Array, y: Array) -> Array:
    """Interpolate the columns of y (n, 3) linearly."""
    return np.stack([np.interp(at, x, y[:, axis]) for axis in range(y.shape[1])], axis=1)


def find_lag(at: Array, expected: Array, measured: Array) -> tuple[float, float] | None:
    """Return how late the velocity is, s, from magnitudes, which know no attitude.

    Little motion tells little: what it tells counts by how sure it is, against what is usual.

    Parameters
    ----------
    at, expected, measured : shape (n,)
        Seconds; |a - g| as the velocity has it, and the accelerometer's magnitude, m/s².

    Returns
    -------
    tuple of floats or None
        The lag, and its standard deviation, by where the two fit best and by what is usual; None
        where the motion is too little to tell.
    """
    good = np.isfinite(expected) & np.isfinite(measured)
    if good.sum() < 20 or expected[good].std() < ENOUGH:
        return None
    x, y, target = at[good], expected[good], measured[good]
    misfit = np.array([np.var(np.interp(x + late, x, y) - target) for late in LAGS])
    best = int(np.argmin(misfit))
    if best in {0, len(LAGS) - 1} or misfit[best] > 0.8 * np.var(target):
        return None
    step, three = float(LAGS[1] - LAGS[0]), misfit[best - 1 : best + 2]
    lag, bend = float(LAGS[best] + lowest(three) * step), float(np.diff(three, 2)[0]) / step**2
    if bend <= 0.0:
        return None
    # of residuals that are the same for so long
    apart = float(np.minimum(np.diff(x), ALIKE).sum()) / ALIKE  # stretches may be hours apart
    variance = 2.0 * float(misfit[best]) / (bend * max(apart, 1.0))
    share = USUAL**2 / (USUAL**2 + variance)
    return lag * share, float(np.sqrt(variance * share))


def lowest(three: Array) -> float:
    """Return where the parabola through three values has its minimum, in steps from the middle."""
    left, middle, right = three
    bend = left - 2.0 * middle + right
    return float(0.5 * (left - right) / bend) if bend > 0.0 else 0.0


def explains(expected: Array, measured: Array, gravity: float) -> bool:
    """Whether |a - g| fits the accelerometer's magnitude about as well as gravity alone does."""
    good = np.isfinite(expected) & np.isfinite(measured)
    if not good.any():
        return False
    with_motion = np.sqrt(np.mean((measured[good] - expected[good]) ** 2))
    without = np.sqrt(np.mean((measured[good] - gravity) ** 2))
    return bool(with_motion <= 1.2 * without + 0.05)
