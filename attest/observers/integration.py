"""The gyroscope integrated from the start: the baseline that no vector corrects.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics". Kinematics (25).

Symbols: R attitude (as a quaternion q); Omega_m gyroscope, beta its bias, as configured.
"""

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Weights
from attest.estimates import Estimates
from attest.geometry.jit import kernel
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.gainless import Gains, carried, record_at, stretches
from attest.observers.observer import COLUMNS, Observer, estimates
from attest.samples import Samples

Array = NDArray[np.float64]


class Config(Configuration):
    """Configuration of ``integration``; ``initial.bias`` is what is subtracted."""

    observer: str = "integration"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))


@kernel
def run(
    h: Array, gyro: Array, mean: Array, L: Array, start: Quaternion, beta: Vector, out: Array
) -> None:
    """Fill row i of out (n, 12) with the attitude at step i."""
    q = start
    for i in range(len(h)):
        record_at(out, i, q, gyro, L, beta)
        q = carried(q, mean, i, h[i], beta)  # (25)


def estimate(samples: Samples, config: Config) -> Estimates:
    """Integrate each stretch from its first vectors."""
    out = np.empty((len(samples.t), COLUMNS))
    for part, given in stretches(samples, config):
        run(*given, out[part])
    return estimates("integration", samples, out, bias=False)


OBSERVER = Observer(
    title="Gyroscope alone, integrated from the first vectors",
    paper="Sanyal, Warier, Hamrah: kinematics (25)",
    config=Config,
    estimate=estimate,
)
