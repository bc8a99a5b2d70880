"""How late a vector's samples are against the gyroscope, by consistency with its turns.

A direction that is constant in the world stands still in the frame that the gyroscope integrates,
but only if its samples are put at the right time: u' = -Omega x u.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.rows import first_of_cells
from attest.conditioning.specific_force import lowest

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

LATENCIES = np.arange(-0.1, 0.601, 0.02)
"""Latencies that are tried, s."""
COARSE = 3
"""Of which one in so many is tried at first, and then those about the best."""
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
    none = int(np.argmin(np.abs(LATENCIES)))
    misfit, fixed = np.full(len(LATENCIES), np.inf), np.empty_like(u)

    def look(these: Iterable[int]) -> None:
        for k in these:
            if 0 <= k < len(LATENCIES) and misfit[k] == np.inf:
                frame.fix(t, D, stamps, -round(LATENCIES[k] * 1e9), u, fixed)
                misfit[k] = np.sum(np.diff(fixed, axis=0)[near] ** 2)

    look((*range(0, len(LATENCIES), COARSE), len(LATENCIES) - 1, none))
    around = int(np.argmin(misfit))
    look(range(around - COARSE, around + COARSE + 1))
    best = int(np.argmin(misfit))
    without = misfit[none]
    # of residuals without correlation, the misfit falls by the square of the deviations
    sure = without - misfit[best] > SURE**2 * misfit[best] / (3 * near.sum())
    if best in {0, len(LATENCIES) - 1} or not sure:
        return 0.0
    found = LATENCIES[best] + lowest(misfit[best - 1 : best + 2]) * (LATENCIES[1] - LATENCIES[0])
    return max(0.0, float(found))


def _spaced(stamps: Stamps) -> NDArray[np.intp]:
    """Return the first sample of each `SPACING`, `MOST_SAMPLES` at the most."""
    return first_of_cells(stamps, int(SPACING * 1e9))[:MOST_SAMPLES]
