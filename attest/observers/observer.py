"""What an observer is to the rest of the program."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Initial
from attest.estimates import Estimates
from attest.geometry import quaternion, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector
from attest.samples import Samples

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Observer:
    """A name's worth of an observer: what it is called, where it is from, how it is run."""

    title: str
    """One line for people."""
    paper: str
    """Where its equations are from."""
    config: type[Configuration]
    """Its configuration, whose defaults are the shipped ones."""
    estimate: Callable[[Samples, Any], Estimates]
    """Run it over samples with its configuration."""
    lyapunov: Callable[[Estimates, Any, Array], Array] | None = None
    """The paper's Lyapunov function, shape (n,), given the true gyroscope bias, rad/s, (3,)."""


def segments(samples: Samples) -> Iterator[slice]:
    """Yield the stretches between restarts."""
    edges = [*np.flatnonzero(samples.restart), len(samples.t)]
    for first, last in pairwise(edges):
        yield slice(int(first), int(last))


def steps(samples: Samples, part: slice) -> Array:
    """Return the length of each step of a stretch, s, shape (n,); the last is zero."""
    return np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9


def inertial(samples: Samples, part: slice) -> Array:
    """Return the vectors in the world of a stretch: (n, k, 3), or (1, k, 3) where constant."""
    return samples.inertial if len(samples.inertial) == 1 else samples.inertial[part]


def initial_attitude(samples: Samples, part: slice, initial: Initial) -> Array:
    """Return the quaternion that a stretch starts from, shape (4,).

    A given attitude holds for the first stretch only; later ones start from their first vectors.
    ``triad`` solves Wahba's problem for the vectors of the first step, which for two directions
    trusts both alike; with one, heading (or tilt) is zero as far as the vector leaves it open.
    """
    if part.start == 0 and initial.attitude == "identity":
        return np.array([1.0, 0.0, 0.0, 0.0])
    if part.start == 0 and not isinstance(initial.attitude, str):
        return quaternion.normalize(np.array(initial.attitude))
    valid = samples.valid[part.start]
    known = samples.inertial[0 if len(samples.inertial) == 1 else part.start][valid]
    return wahba.attitude(known, samples.body[part.start][valid])


@kernel
def between(
    gyro: Array, E: Array, U: Array, i: int, j: int, m: int, e: Array, u: Array
) -> tuple[Array, Array, Vector]:
    """Return the vectors and the gyroscope of sub-step j of m between steps i and i + 1.

    Vectors at the sub-step's beginning, linear between the two steps; the gyroscope's mean over the
    sub-step. A step that is not divided holds its own, as the papers' discrete observers do.

    Parameters
    ----------
    gyro, E, U
        As in `Samples`.
    e, u : shape (k, 3)
        Room for the result.
    """
    last = len(gyro) - 1
    if m == 1 or i == last:
        return E[min(i, len(E) - 1)], U[i], so3.row(gyro, i)
    f = j / m
    for a in range(len(u)):
        for b in range(3):
            u[a, b] = (1.0 - f) * U[i, a, b] + f * U[i + 1, a, b]
            e[a, b] = E[min(i, len(E) - 1), a, b]
            if len(E) > 1:
                e[a, b] = (1.0 - f) * e[a, b] + f * E[i + 1, a, b]
    c = (j + 0.5) / m
    mean = so3.add(so3.scale(1.0 - c, so3.row(gyro, i)), so3.scale(c, so3.row(gyro, i + 1)))
    return e, u, mean
