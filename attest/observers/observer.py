"""What an observer is to the rest of the program."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Initial
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.geometry import quaternion, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.so3 import Matrix, Vector
from attest.samples import Samples

Array = NDArray[np.float64]

NEAR = 60_000_000_000
"""How far the gyroscope is believed when it leads back to a start, nanoseconds."""


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
    """Return how long each sub-step of a stretch takes, s, shape (n,); the last step is zero."""
    h = np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9
    divided: Array = h / samples.substeps[part]
    return divided


def initial_attitude(samples: Samples, part: slice, initial: Initial) -> Array:
    """Return the quaternion that a stretch starts from, shape (4,).

    A given attitude holds for the first stretch only; later ones start from their first vectors.
    ``triad`` solves Wahba's problem for the vectors of the first step, which for two directions
    trusts both alike; where the second comes later, the gyroscope leads back from there. With one,
    heading (or tilt) is zero as far as the vector leaves it open.
    """
    if part.start == 0 and initial.attitude == "identity":
        return np.array([1.0, 0.0, 0.0, 0.0])
    if part.start == 0 and not isinstance(initial.attitude, str):
        return quaternion.normalize(np.array(initial.attitude))
    first = _first_with_two(samples, part)
    at = part.start + first
    valid = samples.valid[at]
    known = samples.inertial[0 if len(samples.inertial) == 1 else at][valid]
    q = wahba.attitude(known, samples.body[at][valid])
    if not first:
        return q
    D = np.empty((first + 1, 4))
    so3.integrate(np.diff(samples.t[part.start : at + 1]) * 1e-9, samples.gyro[part], D)
    return quaternion.multiply(q, quaternion.conjugate(D[-1]))


def _first_with_two(samples: Samples, part: slice) -> int:
    """Return the first step of a stretch with two vectors, if it is near; else its very first."""
    if samples.valid[part.start].sum() >= 2:  # the usual case, and no need to look further
        return 0
    t = samples.t[part]
    near = int(np.searchsorted(t, t[0] + NEAR, side="right"))
    return int(np.argmax(samples.valid[part][:near].sum(axis=1) >= 2))  # 0 where there is none


def refuse_divergence(name: str, t: NDArray[np.int64], states: Array) -> None:
    """Refuse the states (n, j) of a stretch unless they are finite to its end.

    What is not finite never becomes so again, so the last row tells.

    Raises
    ------
    ConfigError
        Explicit steps diverge where the gains are too high for their length.
    """
    if np.isfinite(states[-1]).all():
        return
    after = float(t[int(np.argmin(np.isfinite(states).all(axis=1)))] - t[0]) * 1e-9
    raise ConfigError(
        f"{name}: the estimate is no number any more after {after:.2f} s: the gains are too high "
        "for the steps. Lower the gains or conditioning.max_step_s."
    )


@kernel
def mean_rate(gyro: Array, i: int, j: int, m: int) -> Vector:
    """Return the gyroscope's mean over sub-step j of m from step i, linear between the steps.

    A step that is not divided holds its own, as the papers' discrete observers do.
    """
    if m == 1 or i + 1 == len(gyro):
        return so3.row(gyro, i)
    c = (j + 0.5) / m
    return so3.add(so3.scale(1.0 - c, so3.row(gyro, i)), so3.scale(c, so3.row(gyro, i + 1)))


@kernel
def between(L: Array, i: int, j: int, m: int) -> Matrix:
    """Return L at the beginning of sub-step j of m from step i, linear between the steps.

    L has shape (n, 10), from `attest.geometry.wahba.gain_matrices`.
    """
    following = min(i + 1, len(L) - 1)
    return so3.blend(so3.matrix_row(L, i), so3.matrix_row(L, following), j / m)


def gain_matrices(samples: Samples, part: slice, K: Vector) -> Array:
    """Return L and the cost's constant part at each step of a stretch, shape (n, 10)."""
    L = np.empty((part.stop - part.start, 10))
    E = samples.inertial if len(samples.inertial) == 1 else samples.inertial[part]
    wahba.gain_matrices(E, samples.body[part], samples.valid[part], K, L)
    return L
