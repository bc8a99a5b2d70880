"""Whether a series of flights changes its level, when, and how surely.

[Pettitt79]  A. N. Pettitt, "A non-parametric approach to the change-point problem", Applied
             Statistics 28(2), 1979: the sum of the ranks before each split tells of a change there.
[Hawkins10]  D. M. Hawkins, Q. Deng, "A nonparametric change-point control chart", Journal of
             Quality Technology 42(2), 2010: that sum by its deviation, which favours no split.
[Kovacs23]   S. Kovács, P. Bühlmann, H. Li, A. Munk, "Seeded binary segmentation", Biometrika
             110(1), 2023: also within stretches of a half and less, or two opposite steps hide
             each other.
[Besag91]    J. Besag, P. Clifford, "Sequential Monte Carlo p-values", Biometrika 78(2), 1991.
[BH95]       Y. Benjamini, Y. Hochberg, "Controlling the false discovery rate", Journal of the Royal
             Statistical Society B 57(1), 1995.
[Serfling74] R. J. Serfling, "Probability inequalities for the sum in sampling without
             replacement", Annals of Statistics 2(1), 1974.

The chance of a steady series to look so changed is that of its own values in another order: it
holds for any distribution, heavy tails and equal values too, if the flights are independent of each
other. It is not below 1 / (MOST_ORDERS + 1), however clear the change.

Ranks tell that there is a change, but not well where: they forget how far apart two levels are.
Where it is, is told by the least absolute deviations from the medians before and after it.

Symbols: r ranks less their mean; n of them; S sums of the n_1 before and the n_2 after a split.
"""

from collections.abc import Sequence
from heapq import heappop, heappush, heappushpop
from math import erfc, exp, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel

Array = NDArray[np.float64]

SIDE = 3
"""Flights before and after a change, at the least."""
LAYERS = 3
"""Lengths of stretches: the whole, halves and quarters, each beginning in the midst of another."""
SHORTEST = 12
"""Flights of such a stretch, at the least: shorter ones tell little, and cost power."""
SEEN = 10
"""Orders that look as changed, after which no more are tried."""
FEWEST_ORDERS, MOST_ORDERS = 10_000, 400_000
"""Bounds of how many orders are tried, by how many series there are."""
SHARE_BY_CHANCE = 0.05
"""Of what is flagged, the most that is so by chance on average [BH95]."""
CHANCE = 0.005
"""Of a steady series to be flagged as surely changed, at the most."""
PERHAPS = 0.001
"""Chance up to which a change is told as a perhaps, where among so many series it is not sure."""


def ranks(x: Array) -> Array:
    """Return the ranks less their mean, equal values with their mean rank."""
    _, place, count = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.cumsum(count) - 0.5 * (count - 1)
    r: Array = mean[place] - 0.5 * (len(x) + 1)
    return r


def split(x: Array) -> tuple[int, float]:
    """Return how many values are before the likeliest change, and how clear it is, in deviations.

    Zero deviations where all values are equal, or too few.
    """
    r, n = ranks(x), len(x)
    square = float(r @ r)
    if n < 2 * SIDE or square == 0.0:
        return SIDE, 0.0
    first, last, peak = peak_of(r, SIDE)
    return int(first) + placed(x[first:last]), sqrt(peak * (n - 1) / square)


def placed(x: Array) -> int:
    """Return how many values are before the one change of a stretch.

    There the absolute deviations from the medians of both sides are least.
    """
    cost = deviations(x)[:-1] + deviations(x[::-1])[-2::-1]
    return SIDE + int(np.argmin(cost[SIDE - 1 : len(x) - SIDE]))


def chance(x: Array, orders: int) -> float:
    """Return the chance of a steady series to look as changed, as far as so many orders tell."""
    r = ranks(x)
    square = float(r @ r)
    if len(x) < 2 * SIDE or square == 0.0:
        return 1.0
    peak, least = float(peak_of(r, SIDE)[2]), 1.0 / (orders + 1)
    if _bound(r, peak, square) < least:
        return least
    return float(chance_of(r, SIDE, peak * (1.0 - 1e-9), SEEN, orders))


def _bound(r: Array, peak: float, square: float) -> float:
    """Return what the chance is below, from all splits together.

    Ranks that are all different have shorter tails than normal values. Equal ones may have longer
    tails: for them Serfling's inequality [Serfling74] holds, with the larger side of 3 or more.
    """
    n, splits = len(r), 5 * len(r)
    if len(np.unique(r)) == n:
        return splits * erfc(sqrt(0.5 * peak * (n - 1) / square))
    return splits * 2.0 * exp(-1.5 * peak / float(np.ptp(r)) ** 2)


def orders_for(series: int) -> int:
    """Return how many orders tell a chance that is small enough among so many series."""
    return int(np.clip(2 * series / SHARE_BY_CHANCE, FEWEST_ORDERS, MOST_ORDERS))


def threshold(chances: Sequence[float]) -> float:
    """Return the chance up to which series are surely changed, by Benjamini and Hochberg [BH95]."""
    p = np.sort(np.asarray(chances, float))
    below = np.flatnonzero(p <= SHARE_BY_CHANCE * np.arange(1, len(p) + 1) / max(len(p), 1))
    return min(float(p[below[-1]]), CHANCE) if len(below) else 0.0


@kernel
def peak_of(r: Array, side: int) -> tuple[int, int, float]:
    """Return where (S_1 n_2 - S_2 n_1)² / (n_1 n_2 (n_1 + n_2)) is largest, and that.

    Of a split, it returns where its stretch begins and ends.
    """
    n = len(r)
    total = np.zeros(n + 1)
    for i in range(n):
        total[i + 1] = total[i] + r[i]
    begins, ends, peak = 0, n, -1.0
    for layer in range(LAYERS):
        parts = 2**layer
        for begin in range(2 * parts - 1):
            first, last = begin * n // (2 * parts), (begin + 2) * n // (2 * parts)
            if layer > 0 and last - first < SHORTEST:
                continue
            for k in range(first + side, last - side + 1):
                before, after = float(k - first), float(last - k)
                apart = (total[k] - total[first]) * after - (total[last] - total[k]) * before
                clear = apart * apart / (before * after * (before + after))
                if clear > peak:
                    begins, ends, peak = first, last, clear
    return begins, ends, peak


@kernel
def deviations(x: Array) -> Array:
    """Return the sums of absolute deviations from the median, of the first value, two, and all."""
    low, high = [-x[0]], [x[0]]  # heaps: negative values up to the median, and values above
    high.pop()
    found = np.zeros(len(x))
    below, above = x[0], 0.0
    for i in range(1, len(x)):
        most = -heappushpop(low, -x[i])
        heappush(high, most)
        below, above = below + x[i] - most, above + most
        if len(high) > len(low):
            least = heappop(high)
            heappush(low, -least)
            below, above = below + least, above - least
        found[i] = above - below - low[0] * (len(low) - len(high))
    return found


@kernel
def chance_of(r: Array, side: int, peak: float, seen: int, orders: int) -> float:
    """Return the share of random orders that reach a peak, with this one [Besag91]."""
    r, state, found = r.copy(), np.uint64(88172645463325252), 0
    for tried in range(1, orders + 1):
        for i in range(len(r) - 1, 0, -1):
            state ^= state << np.uint64(13)
            state ^= state >> np.uint64(7)
            state ^= state << np.uint64(17)
            j = np.int64((state >> np.uint64(11)) % np.uint64(i + 1))
            r[i], r[j] = r[j], r[i]
        if peak_of(r, side)[2] >= peak:
            found += 1
            if found == seen:
                return found / tried
    return (found + 1) / (orders + 1)
