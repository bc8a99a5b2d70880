"""How late a vector's samples are against the gyroscope, by consistency with its turns.

A direction that is constant in the world stands still in the frame that the gyroscope integrates,
but only if its samples are put at the right time: u' = -Omega x u.
"""

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.specific_force import lowest

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

LATENCIES = np.arange(-0.1, 0.601, 0.02)
"""Latencies that are tried, s."""
SPACING = 0.2
"""Least time between the samples that are compared, s: turns must show over the noise."""
LONGEST = 1.0
"""Greatest time between the samples that are compared, s: the gyroscope's bias must not show."""
MOST_SAMPLES = 20_000
SURE = 5.0
"""Standard deviations that a latency must be from none to be believed."""


def find(t: Stamps, D: Array, stamps: Stamps, y: Array) -> float:
    """Return the latency of a vector, s, at least zero; zero where the turns do not tell.

    Parameters
    ----------
    t, D
        Stamps of the gyroscope, nanoseconds, and its frame there, shapes (n,) and (n, 4).
    stamps, y
        Stamps and values of the vector, shapes (j,) and (j, 3).
    """
    chosen = _spaced(stamps)
    stamps, u = stamps[chosen], y[chosen]
    near = np.diff(stamps) < LONGEST * 1e9
    if near.sum() < 20:
        return 0.0
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    misfit, fixed = np.empty(len(LATENCIES)), np.empty_like(u)
    for k, late in enumerate(LATENCIES):
        frame.fix(t, D, stamps, -round(late * 1e9), u, fixed)
        misfit[k] = np.sum(np.diff(fixed, axis=0)[near] ** 2)
    best = int(np.argmin(misfit))
    without = misfit[int(np.argmin(np.abs(LATENCIES)))]
    # of residuals without correlation, the misfit falls by the square of the deviations
    sure = without - misfit[best] > SURE**2 * misfit[best] / (3 * near.sum())
    if best in {0, len(LATENCIES) - 1} or not sure:
        return 0.0
    found = LATENCIES[best] + lowest(misfit[best - 1 : best + 2]) * (LATENCIES[1] - LATENCIES[0])
    return max(0.0, float(found))


def _spaced(stamps: Stamps) -> NDArray[np.intp]:
    """Return the first sample of each `SPACING`, `MOST_SAMPLES` at the most."""
    cells = (stamps - stamps[0]) // int(SPACING * 1e9)
    return np.unique(cells, return_index=True)[1][:MOST_SAMPLES]
