"""What a series of flights does: its level, where it changes, and which flights are odd."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from attest.fleet import change, robust
from attest.fleet.figures import Figure
from attest.fleet.series import Series

Array = NDArray[np.float64]

FEWEST = 10
"""Flights with a date, of which a change is told; of fewer no order is improbable enough."""
SMALLEST = 1.0
"""Change that is worth a word, in deviations of the flights from their level."""
ODD = 0.05
"""Chance of any flight at all to be called odd, were all normal."""
TINY = 1e-300
"""What is left of a series without scatter, so that it has a logarithm."""
MONTH = 30.4375 * 86400.0


@dataclass(frozen=True, slots=True)
class Change:
    """Where a series changes."""

    kind: Literal["step", "drift"]
    at: int
    """First flight after a step; of a drift, zero."""
    before: float
    after: float
    deviations: float
    """Between these, in deviations of the flights; infinite where they do not scatter."""
    chance: float
    """Of a steady series to look so."""
    sure: bool
    """Whether that is so small among so many series; else it is a perhaps."""


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """A series, and what it does."""

    series: Series
    median: float
    spread: float
    """Median absolute deviation."""
    slope: float
    """A month; NaN where fewer than two flights have a date."""
    chance: float
    """Of a steady series to look so changed; NaN of fewer flights than `FEWEST`."""
    level: Array
    """Of each flight with a date."""
    changes: tuple[Change, ...] = ()
    odd: tuple[tuple[int, float], ...] = field(default=())
    """Flights far from the level, and the chance of each to be so."""


@dataclass(frozen=True, slots=True)
class Tests:
    """How many series and flights were judged, and how strictly."""

    series: int
    flights: int
    threshold: float
    """Chance up to which a change is sure; zero where none is."""


def trends(found: Sequence[Series]) -> tuple[list[Trend], Tests]:
    """Judge all series together: of many, some look changed by chance."""
    judged = [one for one in found if one.dated >= FEWEST]
    orders = change.orders_for(len(judged))
    chances = {id(one): change.chance(one.x[: one.dated], orders) for one in judged}
    tests = Tests(
        series=len(judged),
        flights=sum(one.dated for one in judged),
        threshold=change.threshold(list(chances.values())),
    )
    told = [_trend(one, chances.get(id(one), float("nan")), tests, orders) for one in found]
    return sorted(told, key=_urgency), tests


def _urgency(trend: Trend) -> tuple[bool, bool, float]:
    """Return what sorts sure changes first, then others, then by their chance."""
    sure = any(change.sure for change in trend.changes)
    return not sure, not trend.changes, trend.chance if trend.chance >= 0.0 else 2.0


def _trend(one: Series, chance: float, tests: Tests, orders: int) -> Trend:
    n = one.dated
    t, x = (one.t[:n] - one.t[0]) / MONTH, one.x[:n]
    slope = robust.slope(t, x) if n > 1 else float("nan")
    odd: tuple[tuple[int, float], ...] = ()
    changes: tuple[Change, ...] = ()
    level = np.full(n, np.median(x) if n else np.nan)
    if n >= FEWEST:
        found, level = _changes(t, x, slope, chance, tests, orders)
        changes = tuple(each for each in found if _worth(each, one.figure))
        odd = tuple(_odd(one, level, tests)) if one.figure.level else ()
    median, spread = float(np.median(one.x)), robust.spread(one.x)
    return Trend(one, median, spread, slope, chance, level, changes, odd)


def _changes(
    t: Array, x: Array, slope: float, chance: float, tests: Tests, orders: int
) -> tuple[list[Change], Array]:
    """Return the changes, and the level that they leave."""
    steps = _placed(x, sorted(_steps(x, 0, chance, max(tests.threshold, change.PERHAPS), orders)))
    level = _level(x, [at for at, _ in steps])
    line = slope * t
    line = line + np.median(x - line)
    if steps and _criterion(x - line, 2) < _criterion(x - level, 2 * len(steps) + 1):
        ends = float(line[0]), float(line[-1])
        found = [_change("drift", 0, ends, x - line, chance, tests)]
        level = line
    else:
        found = [
            _change("step", at, (level[at - 1], level[at]), x - level, chance, tests)
            for at, chance in steps
        ]
    return found, level


def _worth(change: Change, figure: Figure) -> bool:
    """Tell whether a change is more than the flights' scatter, and shows."""
    shows = abs(change.after - change.before) >= 10.0**-figure.digits
    return shows and change.deviations >= SMALLEST


def _criterion(left: Array, unknowns: int) -> float:
    """Return Schwarz's criterion of what a model leaves, by Laplace's distribution: less is better.

    G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6(2), 1978.
    """
    n = len(left)
    return 2.0 * n * float(np.log(np.abs(left).mean() + TINY)) + unknowns * float(np.log(n))


def _steps(
    x: Array, first: int, chance: float, limit: float, orders: int
) -> Iterator[tuple[int, float]]:
    """Yield where a series steps, and the chance of it: the clearest one, then those beside it."""
    if chance > limit:
        return
    k, _ = change.split(x)
    yield first + k, chance
    for part, start in ((x[:k], first), (x[k:], first + k)):
        if len(part) >= FEWEST:
            yield from _steps(part, start, change.chance(part, orders), limit, orders)


def _placed(x: Array, steps: list[tuple[int, float]]) -> list[tuple[int, float]]:
    """Return the steps where they are best between their neighbours, which were not all known."""
    at = [0, *(k for k, _ in steps), len(x)]
    for i in range(1, len(at) - 1):
        at[i] = at[i - 1] + change.placed(x[at[i - 1] : at[i + 1]])
    return [(k, chance) for k, (_, chance) in zip(at[1:-1], steps, strict=True)]


def _level(x: Array, at: Sequence[int]) -> Array:
    """Return the median of each stretch between steps, at its flights."""
    parts = np.split(x, list(at))
    return np.concatenate([np.full(len(part), np.median(part)) for part in parts])


def _change(
    kind: Literal["step", "drift"],
    at: int,
    ends: tuple[float, float],
    left: Array,
    chance: float,
    tests: Tests,
) -> Change:
    before, after = float(ends[0]), float(ends[1])
    scatter = robust.NORMAL * float(np.median(np.abs(left)))
    size = abs(after - before)
    deviations = size / scatter if scatter > 0.0 else float("inf") if size else 0.0
    sure = chance <= tests.threshold
    return Change(kind, at, before, after, deviations, chance, sure)


def _odd(one: Series, level: Array, tests: Tests) -> Iterator[tuple[int, float]]:
    """Yield flights that are far from the level; of a size, only the large ones, by ratio.

    By Bonferroni: none in all series that are judged, were all normal, but by a chance of `ODD`.
    """
    x = one.x[: len(level)]
    left = x - level
    if one.figure.positive and (x > 0.0).all() and (level > 0.0).all():
        left = np.log(x / level)
    chance = robust.odd(left)
    far = (chance * tests.flights < ODD) & (np.abs(x - level) >= 10.0**-one.figure.digits)
    if one.figure.positive:
        far &= left > 0.0
    for i in np.flatnonzero(far).tolist():
        yield i, float(chance[i])
