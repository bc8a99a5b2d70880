"""Bias and scale of an accelerometer, from rests in several attitudes: each reads gravity's size.

Symbols: a mean of what is measured at a rest, b bias, s scale by axis, g gravity: |s (a - b)| = g.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.geometry.earth import GRAVITY

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST = 6
"""Rests, for six unknowns."""
APART = np.deg2rad(20.0)
"""Rests at less than this from one another are of one attitude, rad."""
LEAST_STD = 0.01
"""Of a mean at rest, m/s², however well they fit."""
OBSERVED = 0.05, 0.005
"""Largest deviations of bias, m/s², and scale, 1, that are worth to be told."""
ROUNDS = 10
LIMIT = 20.0
"""Of the unknowns in the fit."""
FARTHEST = 2.0, 0.1
"""No accelerometer's bias, m/s², or scale, 1, is further from 0 and 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """An accelerometer's bias, m/s², and scale, 1, and their deviations, each of shape (3,)."""

    bias: Array
    scale: Array
    bias_std: Array
    scale_std: Array
    rests: int


def find(force: Array, resting: Mask) -> Fit | str:
    """Return what rests tell, or why they do not.

    Parameters
    ----------
    force : shape (n, 3)
        Measured specific force, m/s².
    resting : shape (n,)
        Where the body is at rest.
    """
    a = _attitudes(force, resting)
    if len(a) < FEWEST:
        return (
            f"not observable: rests in {len(a)} of {FEWEST} attitudes, well apart, that are needed"
        )
    x = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    for _ in range(ROUNDS):
        J, left = _linear(a, x)
        # within bounds, so that a fit that diverges stays finite
        x = np.clip(x - np.linalg.lstsq(J, left, rcond=None)[0], -LIMIT, LIMIT)
    J, left = _linear(a, x)
    variance = max(float(left @ left) / max(len(a) - 6, 1), LEAST_STD**2)
    std = np.sqrt(variance * np.diag(np.linalg.pinv(J.T @ J, rcond=1e-12, hermitian=True)))
    if not np.isfinite(x).all() or std[:3].max() > OBSERVED[0] or std[3:].max() > OBSERVED[1]:
        return f"not observable: the {len(a)} attitudes at rest are not spread well enough"
    if np.abs(x[:3]).max() > FARTHEST[0] or np.abs(x[3:] - 1.0).max() > FARTHEST[1]:
        return f"not told: rests in {len(a)} attitudes do not fit one bias and scale"
    return Fit(x[:3], x[3:], std[:3], std[3:], len(a))


def _linear(a: Array, x: Array) -> tuple[Array, Array]:
    """Return how |s (a - b)| - g changes with (b, s), shape (k, 6), and what it is, (k,)."""
    away = a - x[:3]
    f = x[3:] * away
    size = np.linalg.norm(f, axis=1)
    unit = f / np.maximum(size, 1e-9)[:, np.newaxis]
    return np.concatenate([-unit * x[3:], unit * away], axis=1), size - GRAVITY


def _attitudes(force: Array, resting: Mask) -> Array:
    """Return the mean of each attitude's first rest, shape (k, 3)."""
    edges = np.flatnonzero(np.diff(resting, prepend=False, append=False))
    means: list[Array] = []
    for begin, end in edges.reshape(-1, 2):
        mean = force[begin:end].mean(axis=0)
        if all(_angle(mean, other) > APART for other in means):
            means.append(mean)
    return np.array(means).reshape(-1, 3)


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
