"""Search for the least of a function of a few numbers between 0 and 1, many at a time.

[Hansen16]  N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772, Fig. 6, Table 1.

Symbols: m, sigma, C mean, step and covariance of the next points; p_s, p_c evolution paths; w
weights of the better half of a generation; y their steps in units of sigma. Only positive weights
are used.

A point outside is put on the border, and taken for where it was put. Points without a finite value
come last; where none has one but the start, the next points are looked for nearer to it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 16
"""Points of a generation: so many that several lanes have work."""
STEP = 0.2
"""Standard deviation of the first generation."""
CONVERGED = 1e-3
"""A step that changes nothing any more."""
TINY = 1e-20
"""Least eigenvalue of C that is divided by."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """What the next generation is drawn from, n numbers a point."""

    m: Array
    C: Array
    p_s: Array
    p_c: Array
    sigma: float = STEP
    count: int = 0
    """Generations that it has learnt from."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """How quickly each part is learnt, [Hansen16, Table 1]."""

    w: Array
    mu_eff: float
    c_s: float
    d_s: float
    c_c: float
    c_1: float
    c_mu: float
    chi: float
    """Expected length of a normal vector."""


def least(
    function: Callable[[Array], Array],
    start: Array,
    generations: int,
    seed: int,
    on_generation: Callable[[float], None] = lambda _: None,
) -> tuple[Array, float]:
    """Return the best point that was met, and its value; never a worse one than the start.

    Parameters
    ----------
    function
        Gives the values, shape (POINTS,), of points of shape (POINTS, n); infinite for a bad one.
    start
        Point to begin at, shape (n,).
    generations
        How many generations there are at the most.
    seed
        Draws the points; the same gives the same.
    on_generation
        Is told the best value after each.
    """
    rng, rates, n = np.random.default_rng(seed), rates_of(len(start)), len(start)
    spread = Spread(m=start, C=np.eye(n), p_s=np.zeros(n), p_c=np.zeros(n))
    best, value = start, float(function(start[np.newaxis])[0])
    for _ in range(generations):
        points = draw(spread, rng)
        values = function(points)
        first = int(np.argmin(values))
        if values[first] < value:
            best, value = points[first], float(values[first])
        on_generation(value)
        if np.isfinite(values).any():
            spread = learnt(spread, rates, points, values)
        elif isfinite(value):
            spread = replace(spread, sigma=0.5 * spread.sigma)
        if spread.sigma * sqrt(float(np.linalg.eigvalsh(spread.C)[-1])) < CONVERGED:
            break
    return best, value


def rates_of(n: int) -> Rates:
    """Return the rates for n numbers."""
    rank = np.log((POINTS + 1) / 2.0) - np.log(np.arange(1, POINTS // 2 + 1))  # (49)
    w = rank / rank.sum()  # (53)
    mu_eff = 1.0 / float(w @ w)
    c_s = (mu_eff + 2.0) / (n + mu_eff + 5.0)
    c_1 = 2.0 / ((n + 1.3) ** 2 + mu_eff)
    told = 2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0) ** 2 + mu_eff)
    return Rates(
        w=w,
        mu_eff=mu_eff,
        c_s=c_s,  # (55)
        d_s=1.0 + 2.0 * max(0.0, sqrt((mu_eff - 1.0) / (n + 1.0)) - 1.0) + c_s,
        c_c=(4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n),  # (56)
        c_1=c_1,  # (57)
        c_mu=min(1.0 - c_1, told),  # (58)
        chi=sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
    )


def draw(spread: Spread, rng: np.random.Generator) -> Array:
    """Draw a generation, (38)-(40)."""
    values, B = np.linalg.eigh(spread.C)
    z = rng.standard_normal((POINTS, len(spread.m)))
    points: Array = spread.m + spread.sigma * (z * np.sqrt(np.maximum(values, 0.0))) @ B.T
    return points.clip(0.0, 1.0)


def learnt(spread: Spread, rates: Rates, points: Array, values: Array) -> Spread:
    """Move to the better half of a generation, and take its form."""
    m, C, sigma, count = spread.m, spread.C, spread.sigma, spread.count + 1
    w, c_s, c_c = rates.w, rates.c_s, rates.c_c
    y = (points[np.argsort(values, kind="stable")[: len(w)]] - m) / sigma
    mean = w @ y  # (41)
    push = sqrt(c_s * (2.0 - c_s) * rates.mu_eff)
    p_s = (1.0 - c_s) * spread.p_s + push * _whitened(C, mean)  # (43)
    length = float(np.linalg.norm(p_s))
    longest = (1.4 + 2.0 / (len(m) + 1.0)) * rates.chi
    h = float(length < longest * sqrt(1.0 - (1.0 - c_s) ** (2 * count)))
    p_c = (1.0 - c_c) * spread.p_c + h * sqrt(c_c * (2.0 - c_c) * rates.mu_eff) * mean  # (45)
    kept = 1.0 - rates.c_1 * (1.0 - (1.0 - h) * c_c * (2.0 - c_c)) - rates.c_mu
    return Spread(
        m=m + sigma * mean,  # (42)
        C=kept * C + rates.c_1 * np.outer(p_c, p_c) + rates.c_mu * (y.T * w) @ y,  # (47)
        p_s=p_s,
        p_c=p_c,
        sigma=sigma * exp(min(1.0, c_s / rates.d_s * (length / rates.chi - 1.0))),  # (44)
        count=count,
    )


def _whitened(C: Array, y: Array) -> Array:
    """Return C^(-1/2) y."""
    values, B = np.linalg.eigh(C)
    white: Array = B @ ((B.T @ y) / np.sqrt(np.maximum(values, TINY)))
    return white
