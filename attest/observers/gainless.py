"""What the observers without gains share: they solve or integrate, and estimate no bias."""

from collections.abc import Iterator
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Section
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.observer import (
    gain_matrices,
    initial_attitude,
    record,
    whole_steps,
)
from attest.samples import Samples, mean_rates, segments

Array = NDArray[np.float64]
Given = tuple[Array, Array, Array, Array, Quaternion, Vector]
"""Lengths of steps h (n,), gyroscope at each and its mean over the step (n, 3), L (n, 10), attitude
at the start, known bias."""


class Gains(Section):
    """There are none."""


def stretches(samples: Samples, config: Configuration) -> Iterator[tuple[slice, Given]]:
    """Yield each stretch between restarts, and what every kernel needs of it."""
    mean = mean_rates(samples)
    for part in segments(samples):
        start = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        L = gain_matrices(samples, part, config.weights)
        h = whole_steps(samples, part)
        yield part, (h, samples.gyro[part], mean[part], L, start, config.initial.bias)


@kernel
def record_at(out: Array, i: int, q: Quaternion, gyro: Array, L: Array, beta: Vector) -> None:
    """Fill row i of out with the attitude q; the angular velocity is the gyroscope's."""
    B = mat3.matmul(mat3.transpose(so3.matrix(q)), mat3.matrix_row(L, i))
    s = wahba.residual(B)
    Omega = so3.sub(so3.row(gyro, i), beta)
    record(out, i, q, Omega, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))


@kernel
def carried(q: Quaternion, mean: Array, i: int, h: float, beta: Vector) -> Quaternion:
    """Return the attitude a step behind q."""
    return so3.multiply(q, so3.exp(so3.scale(h, so3.sub(so3.row(mean, i), beta))))
