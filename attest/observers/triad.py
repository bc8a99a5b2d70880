"""TRIAD at each step: the first vector exactly, the second as well as it can; no memory.

[Black64]  H. D. Black, "A passive system for determining the attitude of a satellite",
           AIAA J. 2(7).

Symbols: R attitude (as a quaternion q); e_1, u_1 the first valid vector and e_2, u_2 the one
most at a right angle to it (more than 5.7° from it), in the world and in the body.

What the vectors of a step leave open (one vector, or none) is as the gyroscope carries it from the
step before.
"""

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Weights
from attest.estimates import Estimates
from attest.geometry import directions, mat3, so3, static
from attest.geometry.jit import kernel
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.gainless import Gains, carried, record_at, stretches
from attest.observers.observer import COLUMNS, Observer, estimates, known_vectors
from attest.samples import Samples

Array = NDArray[np.float64]


class Config(Configuration):
    """Configuration of ``triad``; the weights are for the reported cost only."""

    observer: str = "triad"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))


@kernel
def run(
    E: Array,
    U: Array,
    valid: NDArray[np.bool_],
    h: Array,
    gyro: Array,
    mean: Array,
    L: Array,
    start: Quaternion,
    beta: Vector,
    out: Array,
) -> None:
    """Fill row i of out (n, 12) with the solution of step i.

    E (n or 1, k, 3), U (n, k, 3) and valid (n, k) are the vectors; the rest is as in
    `attest.observers.wahba.run`.
    """
    predicted = start
    N, V = np.empty((4, 4)), np.empty((4, 4))
    for i in range(len(h)):
        row = i if len(E) > 1 else 0
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
            q = static.closest(mat3.matrix_row(L, i), predicted, N, V)
        record_at(out, i, q, gyro, L, beta)
        predicted = so3.normalize(carried(q, mean, i, h[i], beta))


def estimate(samples: Samples, config: Config) -> Estimates:
    """Solve each step; the angular velocity is the gyroscope's."""
    out = np.empty((len(samples.t), COLUMNS))
    for part, given in stretches(samples, config):
        E = known_vectors(samples, part)
        run(E, samples.body[part], samples.valid[part], *given, out[part])
    return estimates("triad", samples, out, bias=False)


OBSERVER = Observer(
    title="TRIAD at each step, without memory",
    paper="Black 1964",
    config=Config,
    estimate=estimate,
)
