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
from attest.geometry import mat3, so3
from attest.geometry.jit import kernel

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
    near = int(np.count_nonzero(np.diff(stamps) < LONGEST * 1e9))
    if near < 20:
        return 0.0
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    none = int(np.argmin(np.abs(LATENCIES)))
    misfit = np.full(len(LATENCIES), np.inf)

    def look(these: Iterable[int]) -> None:
        new = [k for k in these if 0 <= k < len(LATENCIES) and misfit[k] == np.inf]
        late = np.round(np.sort(LATENCIES[new]) * 1e9).astype(np.int64)
        found = np.zeros(len(new))
        _misfits(t, D, stamps, u, late, np.empty((len(new), 3)), found)
        misfit[np.sort(new)] = found

    look({*range(0, len(LATENCIES), COARSE), len(LATENCIES) - 1, none})
    around = int(np.argmin(misfit))
    look(range(around - COARSE, around + COARSE + 1))
    best = int(np.argmin(misfit))
    without = misfit[none]
    # of residuals without correlation, the misfit falls by the square of the deviations
    sure = without - misfit[best] > SURE**2 * misfit[best] / (3 * near)
    if best in {0, len(LATENCIES) - 1} or not sure:
        return 0.0
    found = LATENCIES[best] + lowest(misfit[best - 1 : best + 2]) * (LATENCIES[1] - LATENCIES[0])
    return max(0.0, float(found))


def _spaced(stamps: Stamps) -> NDArray[np.intp]:
    """Return the first sample of each `SPACING`, `MOST_SAMPLES` at the most."""
    return first_of_cells(stamps, int(SPACING * 1e9))[:MOST_SAMPLES]


@kernel
def _misfits(
    t: Stamps, D: Array, stamps: Stamps, u: Array, late: Stamps, before: Array, misfit: Array
) -> None:
    """Add to misfit (k,) by how much vectors in the frame differ from those before them, squared.

    All latencies (k,), rising, are tried of a sample before the next, since they are near to each
    other in the log. ``before`` is (k, 3), for work.
    """
    start, last = 0, len(late) - 1
    for j in range(len(stamps)):
        i = start
        near = j > 0 and stamps[j] - stamps[j - 1] < LONGEST * 1e9
        for k in range(last, -1, -1):
            when = min(max(stamps[j] - late[k], t[0]), t[-1])
            i = frame.last_before(t, when, i)
            if k == last:
                start = i
            v = mat3.apply(so3.matrix(frame.between(t, D, when, i)), so3.row(u, j))
            away = so3.sub(v, so3.row(before, k))
            if near:
                misfit[k] += so3.dot(away, away)
            before[k, 0], before[k, 1], before[k, 2] = v
