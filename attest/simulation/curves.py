"""Smooth functions of time, and what they do to a body that follows them.

Times are in seconds, shape (n,); a path is a function of them.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion

Array = NDArray[np.float64]
Path = Callable[[Array], Array]

_H = 0.5e-3  # s: of the differences; errors stay under 1e-5 of anything a person or a wing does


def step(t: Array, start: float, duration: float) -> Array:
    """Go from 0 to 1 by a polynomial whose first three derivatives end at 0."""
    x = np.clip((t - start) / duration, 0.0, 1.0)
    return x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)


def ramp(t: Array, start: float, duration: float) -> Array:
    """Integrate `step` from before its start."""
    x = np.clip((t - start) / duration, 0.0, 1.0)
    within = x**5 * (7.0 - 14.0 * x + 10.0 * x**2 - 2.5 * x**3)
    return duration * within + np.maximum(t - start - duration, 0.0)


def window(t: Array, start: float, end: float, fade: float) -> Array:
    """Be 1 between two moments but for the fades inside them, and 0 outside."""
    return step(t, start, fade) - step(t, end - fade, fade)


def angular_velocity(attitude: Path, t: Array) -> Array:
    """Angular velocity in the body, rad/s, (n, 3), by central difference."""
    before, after = attitude(t - _H), attitude(t + _H)
    turn = quaternion.multiply(quaternion.conjugate(before), after)
    return quaternion.log(turn) / (2.0 * _H)


def derivative(path: Path, t: Array) -> Array:
    """First derivative by central difference."""
    slope: Array = (path(t + _H) - path(t - _H)) / (2.0 * _H)
    return slope


def second_derivative(path: Path, t: Array) -> Array:
    """Second derivative by central difference."""
    bend: Array = (path(t + _H) - 2.0 * path(t) + path(t - _H)) / _H**2
    return bend


def clock(rate: float, duration: float) -> NDArray[np.int64]:
    """Stamps of a sensor of so many Hz from 0, ns."""
    period = round(1e9 / rate)
    return period * np.arange(round(duration * 1e9) // period + 1, dtype=np.int64)
