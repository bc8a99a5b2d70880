"""The gyroscope integrated from the start: the baseline that no vector corrects.

[FTS]  A. K. Sanyal, R. R. Warier, R. Hamrah, "Finite time stable attitude and angular velocity bias
       estimation for rigid bodies with unknown dynamics". Kinematics (25).

Symbols: R attitude (as a quaternion q); Omega_m gyroscope, beta its bias, as configured.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration, Section, Weights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
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
    """Configuration of ``integration``; ``initial.bias`` is what is subtracted."""

    observer: str = "integration"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))


@kernel
def run(h: Array, gyro: Array, L: Array, start: Quaternion, beta: Vector, out: Array) -> None:
    """Fill row i of out (n, 12) with the attitude at step i; rates are linear between steps."""
    q = start
    for i in range(len(h)):
        L_i = mat3.matrix_row(L, i)
        B = mat3.matmul(mat3.transpose(so3.matrix(q)), L_i)
        s = wahba.residual(B)
        Omega = so3.sub(so3.row(gyro, i), beta)
        record(out, i, q, Omega, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))
        mean = so3.sub(so3.mean_row(gyro, i), beta)
        q = so3.multiply(q, so3.exp(so3.scale(h[i], mean)))  # (25)


def estimate(samples: Samples, config: Config) -> Estimates:
    """Integrate each stretch from its first vectors."""
    out = np.empty((len(samples.t), COLUMNS))
    beta = config.initial.bias
    for part in segments(samples):
        start = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        L = gain_matrices(samples, part, config.weights)
        h = np.diff(samples.t[part], append=samples.t[part][-1]) * 1e-9
        run(h, samples.gyro[part], L, start, beta, out[part])
    return estimates("integration", samples, out, bias=False)


OBSERVER = Observer(
    title="Gyroscope alone, integrated from the first vectors",
    paper="Sanyal, Warier, Hamrah: kinematics (25)",
    config=Config,
    estimate=estimate,
)
