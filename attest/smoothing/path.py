"""What is looked for, where, and what is expected of the measurements of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Nodes(NamedTuple):
    """Where the nodes are, and what is known of the stretches behind them."""

    at: NDArray[np.int64]
    """Step of each node, (N,)."""
    broken: NDArray[np.bool_]
    """Whether a restart lies between a node and the next, (N,)."""
    gap: Array
    """How long nothing is measured behind such a node, s, (N,); 0 elsewhere."""
    rest: Array
    """How long the rest lasts that the stretch is in, s, (N,); 0 in motion."""
    moving: NDArray[np.bool_]
    """Whether the log's velocity is known, (N,)."""


class Path(NamedTuple):
    """The estimate at the nodes, and the constants."""

    q: Array
    """Body to world, (N, 4)."""
    v: Array
    """Velocity, less what the log has of it, m/s, (N, 3)."""
    b: Array
    """Gyroscope bias, rad/s, (N, 3)."""
    c: Array
    """Constants, (18,)."""


class Expected(NamedTuple):
    """Noise and errors that the sensors have, as standard deviations."""

    scale: float
    """Of a turn, per rad/s and √s: what is left of the gyroscope's errors of scale."""
    bias_walk: float
    """rad/s/√s."""
    rest_rate: float
    """Of the mean rate at rest, rad/s."""
    rest_speed: float
    """Of the velocity at rest, m/s."""
    speed: float
    """Of a body whose velocity is not known, m/s."""
    aided_speed: float
    """Of the velocity that the log has, m/s."""
    speed_time: float
    """Over which a velocity is the same, s."""
    field: float
    """Of the local field, in units of it."""
    field_time: float
    """Over which it is the same while the body moves, s."""
    field_delay: float
    """Of the magnetometer against the gyroscope, s."""
    direction: float
    """Of any other vector, rad."""
    direction_time: float
    """Over which its error is the same, s."""
    tails: bool
    """Whether outliers are expected."""
