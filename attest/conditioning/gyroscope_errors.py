"""A Kalman filter of the constants that a gyroscope errs by: Omega = Omega_m - b - S Omega_m.

Symbols: x = (b, S by rows), twelve; P its covariance; Theta what a change of x turns a frame by.
"""

from math import radians

import numpy as np
from numpy.typing import NDArray

from attest.geometry.jit import kernel
from attest.geometry.so3 import Vector

Array = NDArray[np.float64]

N = 12
REST_STD = radians(0.05)
"""Of a mean rate at rest against the bias, rad/s."""


@kernel
def error(x: Array, Omega_m: Vector) -> Vector:
    """Return b + S Omega_m."""
    return (
        x[0] + x[3] * Omega_m[0] + x[4] * Omega_m[1] + x[5] * Omega_m[2],
        x[1] + x[6] * Omega_m[0] + x[7] * Omega_m[1] + x[8] * Omega_m[2],
        x[2] + x[9] * Omega_m[0] + x[10] * Omega_m[1] + x[11] * Omega_m[2],
    )


@kernel
def update(x: Array, P: Array, H: Array, innovation: float, variance: float) -> None:
    """Take one scalar measurement into x and P."""
    PH = np.zeros(N)
    expected = variance
    for j in range(N):
        for k in range(N):
            PH[j] += P[j, k] * H[k]
        expected += H[j] * PH[j]
    for j in range(N):
        gain = PH[j] / expected
        x[j] += gain * innovation
        for k in range(N):
            P[j, k] -= gain * PH[k]


@kernel
def sensitivity(Theta: Array, f: Vector) -> Array:
    """Return what a change of x moves f by, Theta dx x f, shape (3, 12)."""
    H = np.empty((3, N))
    for j in range(3):
        a, b = (j + 1) % 3, (j + 2) % 3
        for k in range(N):
            H[j, k] = Theta[a, k] * f[b] - Theta[b, k] * f[a]
    return H


@kernel
def spread(H: Array, P: Array) -> float:
    """Return the trace of H P H^T."""
    trace = 0.0
    for j in range(len(H)):
        for k in range(N):
            for m in range(N):
                trace += H[j, k] * P[k, m] * H[j, m]
    return trace


@kernel
def compare(x: Array, P: Array, H: Array, nu: Vector, variance: float) -> None:
    """Take what a direction drifted beyond expectation into x and P; H is its sensitivity."""
    start = x.copy()
    for j in range(3):
        now = 0.0
        for k in range(N):
            now += H[j, k] * (x[k] - start[k])
        update(x, P, H[j], nu[j] - now, variance)


@kernel
def at_rest(x: Array, P: Array, rate: Vector) -> None:
    """Take the mean rate at rest, which is b but for S b, into x and P."""
    H = np.zeros(N)
    for j in range(3):
        H[:] = 0.0
        H[j] = 1.0
        update(x, P, H, rate[j] - x[j], REST_STD**2)


@kernel
def times(Theta: Array, x: Array) -> Vector:
    """Return Theta x."""
    a = b = c = 0.0
    for k in range(N):
        a, b, c = a + Theta[0, k] * x[k], b + Theta[1, k] * x[k], c + Theta[2, k] * x[k]
    return (a, b, c)
