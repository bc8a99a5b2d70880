"""TRIAD at each step: the first vector exactly, the second as well as it can; no memory.

[Black64]  H. D. Black, "A passive system for determining the attitude of a satellite",
           AIAA J. 2(7).

Symbols: R attitude (as a quaternion q); e_1, u_1 the first valid vector and e_2, u_2 the one
most at a right angle to it (more than 5.7° from it), in the world and in the body.

What the vectors of a step leave open (one vector, or none) is as the gyroscope carries it from the
step before.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Section, Weights
from attest.estimates import Estimates
from attest.geometry import directions, mat3, so3, static, wahba
from attest.geometry.jit import kernel
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.observer import (
    COLUMNS,
    Observer,
    estimates,
    gain_matrices,
    initial_attitude,
    record,
    segments,
)
from attest.samples import Samples

Array = NDArray[np.float64]


class Gains(Section):
    """There are none."""


class Config(Configuration):
    """Configuration of ``triad``; the weights are for the reported cost only."""

    observer: str = "triad"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))


@kernel
def run(
    h: Array,
    gyro: Array,
    E: Array,
    U: Array,
    valid: NDArray[np.bool_],
    L: Array,
    start: Quaternion,
    beta: Vector,
    out: Array,
) -> None:
    """Fill row i of out (n, 12) with the solution of step i.

    E (n or 1, k, 3), U (n, k, 3) and valid (n, k) are the vectors, L (n, 10) their
    `attest.geometry.wahba.gain_matrices`; the rest is as in `attest.observers.wahba.run`.
    """
    predicted = start
    N, V = np.empty((4, 4)), np.empty((4, 4))
    for i in range(len(h)):
        row = i if len(E) > 1 else 0
        L_i = mat3.matrix_row(L, i)
        first, second = directions.widest(E, row, valid, i)
        if second >= 0 and directions.apart(U, i, first, second):
            R = static.triad(
                so3.item(E, row, first),
                so3.item(E, row, second),
                so3.item(U, i, first),
                so3.item(U, i, second),
            )
            q = so3.from_matrix(R)
        else:
            q = static.closest(L_i, predicted, N, V)
        B = mat3.matmul(mat3.transpose(so3.matrix(q)), L_i)
        s = wahba.residual(B)
        Omega = so3.sub(so3.row(gyro, i), beta)
        record(out, i, q, Omega, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))
        mean = so3.sub(so3.mean_row(gyro, i), beta)
        predicted = so3.normalize(so3.multiply(q, so3.exp(so3.scale(h[i], mean))))


def estimate(samples: Samples, config: Config) -> Estimates:
    """Solve each step; the angular velocity is the gyroscope's."""
    out = np.empty((len(samples.t), COLUMNS))
    beta = config.initial.bias
    for part in segments(samples):
        start = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        L = gain_matrices(samples, part, config.weights)
        E = samples.inertial if len(samples.inertial) == 1 else samples.inertial[part]
        h = np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9
        measured = samples.body[part], samples.valid[part]
        run(h, samples.gyro[part], E, *measured, L, start, beta, out[part])
    return estimates("triad", samples, out, bias=False)


OBSERVER = Observer(
    title="TRIAD at each step, without memory",
    paper="Black 1964",
    config=Config,
    estimate=estimate,
)
