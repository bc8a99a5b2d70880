"""Multiplicative extended Kalman filter with gyroscope bias.

[Lefferts82]  E. J. Lefferts, F. L. Markley, M. D. Shuster, "Kalman filtering for spacecraft
              attitude estimation", J. Guidance 5(5).
[Markley03]  F. L. Markley, "Attitude error representations for Kalman filtering",
             J. Guidance 26(2).

Symbols: R (as a quaternion q), beta_hat estimates; theta, beta_tilde errors in the body, R = R_hat
exp(hat(theta)), beta = beta_hat + beta_tilde; P_a, P_c, P_b blocks of their covariance; M = R^T E W
E^T R; N = h (tr(M) I - M)/r² what the vectors of a step tell of theta; y = -h s_L/r² the same of
its value.

The vectors' noise has an intensity, so that the same log at a higher rate does not count for more;
weights W in place of single covariances make the update one of information: N and y add up over
the vectors. To first order this is the GAME filter.
"""

from math import radians, sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.config import Configuration, Section, VectorWeights
from attest.estimates import Estimates
from attest.geometry import mat3, so3, wahba
from attest.geometry.jit import kernel
from attest.geometry.mat3 import Matrix
from attest.geometry.so3 import Quaternion, Vector
from attest.observers.observer import (
    COLUMNS,
    Observer,
    between,
    estimates,
    gain_and_known_matrices,
    initial_attitude,
    mean_rate,
    record,
    steps,
    turn_noise,
)
from attest.samples import Samples, segments

Array = NDArray[np.float64]
Covariance = tuple[Matrix, Matrix, Matrix]
"""P_a, P_c, P_b."""
State = tuple[Quaternion, Vector, Covariance]
"""q, beta_hat, covariance."""


class Gains(Section):
    """Noise that the filter expects."""

    theorem = "[Lefferts82]"

    direction_noise: Annotated[float, Field(gt=0, le=1e6)] = 0.21
    """Root intensity r of the vectors' noise at a weight of 1 [rad √s]. More follows them less."""
    gyro_noise: Annotated[float, Field(gt=0, le=1e6)] = 0.13
    """Root intensity of the gyroscope's noise, at the least; of a slow log's steps it is more
    [rad/√s]. More follows the vectors more."""
    bias_walk: Annotated[float, Field(ge=0, le=1e6)] = 0.00024
    """Root intensity of the bias's random walk [rad/s/√s]."""
    attitude_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    """Standard deviation of the initial attitude about each axis, degrees."""
    bias_deg_s: Annotated[float, Field(gt=0, le=1e6)] = 2.0
    """Standard deviation of the initial bias about each axis, degrees/s."""


class Config(Configuration):
    """Configuration of ``mekf``; the defaults suit flight logs."""

    observer: str = "mekf"
    gains: Gains = Gains()
    weights: VectorWeights = VectorWeights(k=(1.2, 1.0, 30.0))


def initial_covariance(attitude_deg: float, bias_deg_s: float) -> Covariance:
    """Return the covariance of standard deviations alike about all axes."""
    return (
        mat3.times(radians(attitude_deg) ** 2, mat3.IDENTITY),
        mat3.times(0.0, mat3.IDENTITY),
        mat3.times(radians(bias_deg_s) ** 2, mat3.IDENTITY),
    )


@kernel
def update(
    q: Quaternion, beta: Vector, P: Covariance, N: Matrix, y: Vector
) -> tuple[Quaternion, Vector, Covariance, Vector]:
    """Take in what vectors tell of theta, information N and N theta = y; [Lefferts82] VI.

    Also return theta. With N = -h A, the covariance solves P' = P A P over h exactly.
    """
    P_a, P_c, P_b = P
    T = mat3.inverse(mat3.plus(mat3.IDENTITY, mat3.matmul(N, P_a)))
    gain = mat3.apply(T, y)
    theta = mat3.apply(P_a, gain)
    G = mat3.symmetric(mat3.matmul(T, N))
    P_a_G = mat3.matmul(P_a, G)
    after = (
        mat3.symmetric(mat3.plus(P_a, mat3.times(-1.0, mat3.matmul(P_a_G, P_a)))),
        mat3.plus(P_c, mat3.times(-1.0, mat3.matmul(P_a_G, P_c))),
        mat3.symmetric(
            mat3.plus(P_b, mat3.times(-1.0, mat3.matmul(mat3.matmul(mat3.transpose(P_c), G), P_c)))
        ),
    )
    beta_after = so3.add(beta, mat3.apply(mat3.transpose(P_c), gain))
    return so3.multiply(q, so3.exp(theta)), beta_after, after, theta


@kernel
def predict(
    q: Quaternion, P: Covariance, Omega_b: Vector, h: float, noise: tuple[float, float]
) -> tuple[Quaternion, Covariance]:
    """Carry state and covariance over h, theta' = -Omega x theta - beta_tilde; [Lefferts82] VI."""
    P_a, P_c, P_b = P
    turn = so3.exp(so3.scale(h, Omega_b))
    A = so3.matrix(turn)
    A_T = mat3.transpose(A)
    spread = mat3.plus(mat3.times(-2.0 * h, mat3.symmetric(P_c)), mat3.times(h * h, P_b))
    P_a = mat3.matmul(mat3.matmul(A_T, mat3.plus(P_a, spread)), A)
    P_c = mat3.matmul(A_T, mat3.plus(P_c, mat3.times(-h, P_b)))
    grown = (h * noise[0], h * noise[0], h * noise[0])
    walked = (h * noise[1], h * noise[1], h * noise[1])
    after = (
        mat3.symmetric(mat3.plus(P_a, mat3.diagonal(grown))),
        P_c,
        mat3.plus(P_b, mat3.diagonal(walked)),
    )
    return so3.multiply(q, turn), after


@kernel
def information(q: Quaternion, known: Array, i: int, scale: float) -> Matrix:
    """Return scale (tr(M) I - M) with M = R^T E W E^T R, from row i of E W E^T (n, 6)."""
    a = known[i, 0], known[i, 1], known[i, 2]
    b = known[i, 1], known[i, 3], known[i, 4]
    c = known[i, 2], known[i, 4], known[i, 5]
    R = so3.matrix(q)
    M = mat3.matmul(mat3.matmul(mat3.transpose(R), (*a, *b, *c)), R)
    trace = M[0] + M[4] + M[8]
    return mat3.times(scale, mat3.plus(mat3.diagonal((trace, trace, trace)), mat3.times(-1.0, M)))


@kernel
def run(
    h: Array,
    substeps: NDArray[np.int64],
    gyro: Array,
    L: Array,
    known: Array,
    start: State,
    numbers: tuple[float, float],
    gyro_noise: Array,
    out: Array,
) -> None:
    """Fold updates and predictions over the steps; row i of out (n, 15) is the state before step i.

    The last columns are the diagonal of P_a. Numbers are r² and the intensity of the bias's
    walk; that of the gyroscope's noise is of each step, (n,).
    """
    q, beta, P = start
    for i in range(len(h)):
        for j in range(substeps[i]):
            Omega_m, L_j = mean_rate(gyro, i, j, substeps[i]), between(L, i, j, substeps[i])
            B = mat3.matmul(mat3.transpose(so3.matrix(q)), L_j)
            s = wahba.residual(B)
            if j == 0:
                Omega_hat = so3.sub(so3.row(gyro, i), beta)
                record(out, i, q, Omega_hat, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))
                out[i, 12], out[i, 13], out[i, 14] = P[0][0], P[0][4], P[0][8]
            told = h[i] / numbers[0]
            N = information(q, known, i, told)
            q, beta, P, _ = update(q, beta, P, N, so3.scale(-told, s))
            q, P = predict(q, P, so3.sub(Omega_m, beta), h[i], (gyro_noise[i], numbers[1]))


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias; the bias survives a restart, the rest starts anew."""
    gains = config.gains
    numbers = (gains.direction_noise**2, gains.bias_walk**2)
    P = initial_covariance(gains.attitude_deg, gains.bias_deg_s)
    out = np.empty((len(samples.t), COLUMNS + 3))
    beta = np.array(config.initial.bias)
    for part in segments(samples):
        q = so3.as_quaternion(initial_attitude(samples, part, config.initial))
        start = (q, so3.as_vector(beta), P)
        L, known = gain_and_known_matrices(samples, part, config.weights)
        h, substeps = steps(samples, part), samples.substeps[part]
        noise = turn_noise(samples, part, gains.gyro_noise**2)
        run(h, substeps, samples.gyro[part], L, known, start, numbers, noise, out[part])
        beta = out[part.stop - 1, 7:10]
    states = {"attitude_std": np.sqrt(np.maximum(out[:, 12:15], 0.0))}
    return estimates("mekf", samples, out, states=states)


OBSERVER = Observer(
    title="Multiplicative extended Kalman filter",
    paper="Lefferts, Markley, Shuster 1982; Markley 2003",
    config=Config,
    estimate=estimate,
)
