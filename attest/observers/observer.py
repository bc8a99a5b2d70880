"""What an observer is to the rest of the program."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.claims import Claim
from attest.config import Configuration, Initial, VectorWeights, Weights
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.geometry import mat3, quaternion, so3, static, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.recording import Note
from attest.samples import Samples, mean_rates, segments
from attest.smoothing.inputs import variance

Array = NDArray[np.float64]

COLUMNS = 12
"""q (4), Omega_hat (3), beta_hat (3), |s_L| and Wahba's cost."""
BLOCK = 8192
"""Steps of a piece of a log; the matrices of more do not fit a processor's cache."""
BEND = 2
"""Order of the differences that tell what is between a slow log's samples."""
NEAR = 60_000_000_000
"""How far the gyroscope is believed when it leads back to a start, nanoseconds."""


def _nothing(_samples: Samples, _found: Estimates, _config: Any) -> tuple[Note, ...]:
    """Return what an observer says that does nothing to the data."""
    return ()


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
    lyapunov: Callable[[Estimates, Any, Array], Array | None] | None = None
    """The paper's Lyapunov function, shape (n,), given beta_hat - beta, rad/s, (n, 3); None where
    the gains leave it without one."""
    promises: Callable[[Samples, Estimates, Any], tuple[Claim, ...]] | None = None
    """What its theory promises of this run, against what was seen."""
    notes: Callable[[Samples, Estimates, Any], tuple[Note, ...]] = _nothing
    """What it did to the data, and what in its answer is doubtful."""
    whole: bool = False
    """Whether it looks at the whole log at once, and not step by step."""


def whole_steps(samples: Samples, part: slice) -> Array:
    """Return how long each step of a stretch takes, s, shape (n,); the last is zero."""
    return np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9


def steps(samples: Samples, part: slice) -> Array:
    """Return how long each sub-step of a stretch takes, s, shape (n,); the last step is zero."""
    h = np.empty(part.stop - part.start)
    _divide(samples.t[part], samples.substeps[part], h)
    return h


@kernel
def _divide(t: NDArray[np.int64], substeps: NDArray[np.int64], h: Array) -> None:
    for i in range(len(t)):
        h[i] = 1e-9 * (t[i + 1] - t[i]) / substeps[i] if i + 1 < len(t) else 0.0


def known_vectors(samples: Samples, part: slice) -> Array:
    """Return a stretch's vectors in the world, shape (n, k, 3), or (1, k, 3) where constant."""
    return samples.inertial if len(samples.inertial) == 1 else samples.inertial[part]


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
    q = static.attitude(known, samples.body[at][valid])
    if not first or not np.isfinite(samples.gyro[part.start]).all():  # feature points alone
        return q
    D = np.empty((first + 1, 4))
    so3.integrate(np.diff(samples.t[part.start : at + 1]) * 1e-9, mean_rates(samples)[part], D)
    return quaternion.multiply(q, quaternion.conjugate(D[-1]))


def initial_omega(gyro: Array, part: slice, initial: Initial, beta: Array) -> Array:
    """Return the rate's error omega = Omega_m - Omega_hat - beta_hat at the start of a stretch."""
    if part.start == 0 and initial.angular_velocity is not None:
        return np.asarray(gyro[0] - np.array(initial.angular_velocity) - beta)
    return np.zeros(3)


def _first_with_two(samples: Samples, part: slice) -> int:
    """Return the first step of a stretch with two vectors, if it is near; else its very first."""
    if samples.valid[part.start].sum() >= 2:  # the usual case, and no need to look further
        return 0
    t = samples.t[part]
    near = int(np.searchsorted(t, t[0] + NEAR, side="right"))
    return int(np.argmax(samples.valid[part][:near].sum(axis=1) >= 2))  # 0 where there is none


def gyro_noise(samples: Samples) -> float:
    """Return the gyroscope's noise, the norm of its axes' standard deviations, rad/s.

    Robust, from second differences, in which motion that the log resolves is small.
    """
    bends = np.diff(samples.gyro, n=2, axis=0)
    if not len(bends):
        return 0.0
    deviation = 1.4826 * np.median(np.abs(bends), axis=0) / np.sqrt(6.0)
    return float(np.linalg.norm(deviation))


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
    return mat3.blend(mat3.matrix_row(L, i), mat3.matrix_row(L, following), j / m)


@kernel
def constant_between(L: Array, i: int, j: int, m: int) -> float:
    """Return the constant part of Wahba's cost there, as `between` does of L."""
    following = min(i + 1, len(L) - 1)
    f = j / m
    return float((1.0 - f) * L[i, 9] + f * L[following, 9])


def turn_noise(samples: Samples, part: slice, least: float) -> Array:
    """Return the intensity of the gyroscope's noise over each step of a stretch, rad²/s, (n,).

    A step that had to be divided is one of a log too slow for its motion: what lies between its
    samples is interpolated, and off by what their second differences tell.
    """
    h = np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9
    told = variance(h, samples.gyro[part], least**0.5, BEND) / np.where(h > 0.0, h, 1.0)
    slow = (samples.substeps[part] > 1) & (h > 0.0)
    return np.where(slow, told, least)


def blocks(part: slice) -> Iterator[slice]:
    """Yield a stretch in pieces, so that what is made for one is still in the processor's cache."""
    for start in range(part.start, part.stop, BLOCK):
        yield slice(start, min(start + BLOCK, part.stop))


def gain_matrices(samples: Samples, part: slice, weights: Weights) -> Array:
    """Return L and the cost's constant part at each step of a stretch, shape (n, 10)."""
    return _matrices(samples, part, weights, np.empty((0, 6)))


def gain_and_known_matrices(samples: Samples, part: slice, weights: Weights) -> tuple[Array, Array]:
    """Return that and E W E^T by (xx, xy, xz, yy, yz, zz), shape (n, 6)."""
    known = np.empty((part.stop - part.start, 6))
    return _matrices(samples, part, weights, known), known


def _matrices(samples: Samples, part: slice, weights: Weights, known: Array) -> Array:
    L = np.empty((part.stop - part.start, 10))
    E = known_vectors(samples, part)
    U, valid = samples.body[part], samples.valid[part]
    if isinstance(weights, VectorWeights) and weights.w is not None:
        if weights.w and samples.names and not weights.w.keys() & set(samples.names):
            named, held = ", ".join(weights.w), ", ".join(samples.names) or "none"
            raise ConfigError(f"weights.w: names {named}, and none is used. Vectors: {held}.")
        w = np.array([weights.w.get(name, 1.0) for name in samples.names])
        wahba.diagonal_gain_matrices(E, U, valid, w, L, known)
    else:
        north, east, vertical = weights.k
        k = weights.k if samples.world == "ned" else (east, north, vertical)
        wahba.gain_matrices(E, U, valid, k, L, known)
    return L


@kernel
def record(
    out: Array, i: int, q: Quaternion, Omega: Vector, beta: Vector, s_norm: float, cost: float
) -> None:
    """Fill the first `COLUMNS` of row i of out with what every observer gives."""
    out[i, 0], out[i, 1], out[i, 2], out[i, 3] = q
    out[i, 4], out[i, 5], out[i, 6] = Omega
    out[i, 7], out[i, 8], out[i, 9] = beta
    out[i, 10], out[i, 11] = s_norm, cost


def estimates(
    name: str, samples: Samples, out: Array, *, bias: bool = True, **other: Any
) -> Estimates:
    """Make estimates of what `record` left, shape (n, 12 or more).

    Raises
    ------
    ConfigError
        They are not finite.
    """
    for part in segments(samples):
        refuse_divergence(name, samples.t[part], out[part])
    none = np.empty((0, 3))
    rate = none if samples.rate is None else samples.rate
    off = samples.bias if bias and samples.bias is not None else none
    _finish(out, samples.gyro, rate, off)
    return Estimates(
        observer=name,
        t=samples.t,
        q=out[:, 0:4],
        angular_velocity=out[:, 4:7],
        gyro_bias=out[:, 7:10] if bias else None,
        s_norm=out[:, 10],
        cost=out[:, 11],
        updated=samples.valid,
        **other,
    )


@kernel
def _finish(out: Array, gyro: Array, rate: Array, off: Array) -> None:
    """Make the quaternions' signs continuous, the rate that at the stamps, and the bias the whole.

    Parameters
    ----------
    out
        What `record` left, changed in place.
    gyro, rate
        Rate over the step from each stamp and at the stamp, (n, 3); no row of the latter where they
        are the same.
    off
        Bias that conditioning took off, (n, 3); no row where none is asked for or taken.
    """
    sign, before = 1.0, so3.row4(out, 0)
    for i in range(len(out)):
        q = so3.row4(out, i)
        if so3.dot4(q, before) < 0.0:
            sign = -sign
        before = q
        for j in range(4):
            out[i, j] = sign * q[j]
        for j in range(3):
            if len(rate):
                out[i, 4 + j] += rate[i, j] - gyro[i, j]
            if len(off):
                out[i, 7 + j] += off[i, j]
