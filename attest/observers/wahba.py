"""Wahba's problem solved anew at each step: no memory, the baseline that only the vectors feed.

[Wahba65]  G. Wahba, "A least squares estimate of satellite attitude", SIAM Review 7(3).
[Davenport68]  P. B. Davenport, "A vector approach to the algebra of rotations", NASA TN D-4696.

Symbols: R attitude (as a quaternion q), the rotation that maximises <R, L>, L = E W U^T.

What the vectors of a step leave open (one vector, or none) is as the gyroscope carries it from the
step before.
"""

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, VectorWeights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, static
from attest.geometry.jit import kernel
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.gainless import Gains, carried, record_at, stretches
from attest.observers.observer import COLUMNS, Observer, estimates
from attest.samples import Samples

Array = NDArray[np.float64]


class Config(Configuration):
    """Configuration of ``wahba``."""

    observer: str = "wahba"
    gains: Gains = Gains()
    weights: VectorWeights = VectorWeights(k=(1.2, 1.0, 30.0))


@kernel
def run(
    h: Array, gyro: Array, mean: Array, L: Array, start: Quaternion, beta: Vector, out: Array
) -> None:
    """Fill row i of out (n, 12) with the solution of step i.

    Parameters
    ----------
    h : shape (n,)
        Length of each step, s.
    gyro, mean : shape (n, 3)
        Measured rate, and its mean over the step that follows, rad/s.
    L : shape (n, 10)
        From `attest.geometry.wahba.gain_matrices`.
    start
        What the first step's vectors leave open is as here.
    beta
        Known bias, rad/s.
    """
    predicted = start
    N, V = np.empty((4, 4)), np.empty((4, 4))
    for i in range(len(h)):
        q = static.closest(mat3.matrix_row(L, i), predicted, N, V)
        record_at(out, i, q, gyro, L, beta)
        predicted = so3.normalize(carried(q, mean, i, h[i], beta))


def estimate(samples: Samples, config: Config) -> Estimates:
    """Solve each step's problem; the angular velocity is the gyroscope's."""
    out = np.empty((len(samples.t), COLUMNS))
    for part, given in stretches(samples, config):
        run(*given, out[part])
    return estimates("wahba", samples, out, bias=False)


OBSERVER = Observer(
    title="Wahba's problem at each step, without memory",
    paper="Wahba 1965; Davenport 1968",
    config=Config,
    estimate=estimate,
)
