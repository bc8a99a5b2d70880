"""VQF, by its authors' package: another filter's answer to the same log, for comparison.

[Laidig23]  D. Laidig, T. Seel, "VQF: highly accurate IMU orientation estimation with bias
            estimation and magnetic disturbance rejection", Information Fusion 91.

The package wants samples at one rate: the log is interpolated to its median rate, and the estimate
back to the log's stamps. It looks for gravity in the accelerometer, not for a - g, so that a log's
velocity does not help it. Magnetic north is turned to true north by the known direction of the
field.
"""

from math import sqrt
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.config import Configuration, RawConditioning, Section, Weights
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.geometry import frames, mat3, quaternion, so3, wahba
from attest.geometry.jit import kernel
from attest.observers.observer import (
    COLUMNS,
    Observer,
    estimates,
    gain_matrices,
    record,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]

LONGEST = 5_000_000
"""Samples of a stretch at one rate; a log of bursts would have no end of them."""


class Gains(Section):
    """Parameters of the package, [Laidig23] Table 2."""

    theorem = "[Laidig23, Table 2]"

    tauAcc: Annotated[float, Field(gt=0)] = 3.0
    """Time constant of the accelerometer's low-pass [s]. More follows it less."""
    tauMag: Annotated[float, Field(gt=0)] = 9.0
    """Time constant of the magnetometer's heading [s]. More follows it less."""
    offline: bool = False
    """Use the offline variant, which sees the future of each moment too."""


class Config(Configuration):
    """Configuration of ``vqf``; the defaults are the package's."""

    observer: str = "vqf"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))
    conditioning: RawConditioning = RawConditioning()


def estimate(samples: Samples, config: Config) -> Estimates:
    """Run the package over each stretch.

    Raises
    ------
    ConfigError
        The package is not installed, or the log has no accelerometer.
    """
    if "accel" not in samples.names or samples.length is None:
        raise ConfigError("vqf: needs the vector 'accel'. Choose another observer for this log.")
    out = np.empty((len(samples.t), COLUMNS))
    for part in segments(samples):
        q, bias = _stretch(samples, part, config.gains)
        L = gain_matrices(samples, part, config.weights)
        _diagnose(q, samples.gyro[part], bias, L, out[part])
    return estimates("vqf", samples, out)


def _stretch(samples: Samples, part: slice, gains: Gains) -> tuple[Array, Array]:
    """Return attitude (n, 4), body to world, and bias (n, 3) of a stretch."""
    t = (samples.t[part] - samples.t[part][0]) * 1e-9
    if len(t) < 2:
        return np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 3))
    usual = float(np.median(np.diff(samples.t[part]))) / 1e9
    period = max(usual, float(t[-1]) / LONGEST)
    at = np.arange(0.0, t[-1] + 0.5 * period, period)
    signals = [_at(at, t, y) for y in _signals(samples, part)]
    found = _package(signals, period, gains)
    with_mag = len(signals) == 3
    grid = np.round(at * 1e9).astype(np.int64)
    q = quaternion.continuous(found["quat9D" if with_mag else "quat6D"])
    stamps = np.clip(samples.t[part] - samples.t[part][0], grid[0], grid[-1])
    back = quaternion.slerp(grid, q, stamps, np.iinfo(np.int64).max)
    return quaternion.multiply(_from_enu(samples, part), back), _at(t, at, found["bias"])


def _signals(samples: Samples, part: slice) -> list[Array]:
    """Return gyroscope, accelerometer and, where there is one, magnetometer of a stretch."""
    signals = [samples.gyro[part]]
    for name in ("accel", "mag"):
        if name in samples.names and samples.length is not None:
            i = samples.names.index(name)
            seen = samples.valid[part, i] * samples.length[part, i]  # the package skips zeros
            signals.append(seen[:, np.newaxis] * samples.body[part, i])
    return signals


def _at(at: Array, t: Array, y: Array) -> Array:
    return np.ascontiguousarray(np.stack([np.interp(at, t, column) for column in y.T], axis=1))


def _package(signals: list[Array], period: float, gains: Gains) -> dict[str, Any]:
    try:
        from vqf import VQF, offlineVQF
    except ImportError as error:
        raise ConfigError(
            "vqf: the package 'vqf' is not installed. Install it: pip install 'attest[vqf]'."
        ) from error
    parameters = {"tauAcc": gains.tauAcc, "tauMag": gains.tauMag}
    if gains.offline:
        mag = signals[2] if len(signals) == 3 else None
        return dict(offlineVQF(signals[0], signals[1], mag, period, parameters))
    return dict(VQF(period, **parameters).updateBatch(*signals))


def _from_enu(samples: Samples, part: slice) -> Array:
    """Return the turn from the package's world (up, magnetic north as y) to the log's, (n|1, 4)."""
    up = samples.inertial[0, samples.names.index("accel")]
    flip = np.array([1.0, 0.0, 0.0, 0.0])
    if up[2] < 0.0:  # north-east-down: x and y change places, z changes sign
        flip = frames.WORLD
    if "mag" not in samples.names:
        return flip[np.newaxis]
    field = samples.inertial[:, samples.names.index("mag")]
    field = field if len(field) == 1 else field[part]
    in_enu = quaternion.rotate(quaternion.conjugate(flip), field)
    turn = np.zeros((len(field), 3))
    turn[:, 2] = np.arctan2(in_enu[:, 1], in_enu[:, 0]) - 0.5 * np.pi
    return quaternion.multiply(flip, quaternion.exp(turn))


@kernel
def _diagnose(q: Array, gyro: Array, bias: Array, L: Array, out: Array) -> None:
    """Fill out (n, 12) with what every observer gives."""
    for i in range(len(q)):
        q_i, beta = (q[i, 0], q[i, 1], q[i, 2], q[i, 3]), so3.row(bias, i)
        B = mat3.matmul(mat3.transpose(so3.matrix(q_i)), mat3.matrix_row(L, i))
        s = wahba.residual(B)
        rate = so3.sub(so3.row(gyro, i), beta)
        record(out, i, q_i, rate, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))


OBSERVER = Observer(
    title="VQF, by its authors' package, for comparison",
    paper="Laidig, Seel 2023",
    config=Config,
    estimate=estimate,
)
