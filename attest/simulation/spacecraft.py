"""The scenario ``spacecraft``: a small satellite that tumbles, with sun sensor and star tracker.

Free fall has no accelerometer's direction. The world is an inertial frame; what is known in it is
the sun (signal ``sun``, 5 Hz, hidden in eclipse from 200 s to 280 s) and two stars of the tracker
(``star1``, ``star2``, 2 Hz). Their places are in `Flight.constants`. Magnetic torquers slow the
tumbling (signal ``torque``); a small torque nobody measures disturbs it, and the gyroscope's bias
drifts: both are in `Flight.truth`.
"""

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal, seconds
from attest.simulation import curves, dynamics, experiment, noise
from attest.simulation.experiment import Measured, Turning
from attest.simulation.flight import Array, Flight, Times

DURATION = 400.0
"""s."""
RATE = 10.0
"""Of gyroscope and torque, Hz."""
J = (1.8, 2.1, 2.6)
"""Diagonal of the inertia, kg·m²."""
OMEGA_0 = (0.08, -0.05, 0.11)
"""rad/s."""
GYRO_BIAS = (0.003, -0.002, 0.001)
"""At the start, rad/s."""
DRIFT = (1.0e-3, 0.7e-3, -0.8e-3)
"""Of the bias until the end, rad/s."""
ECLIPSE = (200.0, 280.0)
"""From and until s."""
SUN = (0.8, 0.36, 0.48)
STARS = {"star1": (-0.6, 0.8, 0.0), "star2": (0.0, 0.28, -0.96)}

_GYRO_NOISE = 3e-4  # rad/s
_SUN_NOISE, _STAR_NOISE = np.radians(0.5), np.radians(0.02)
_DAMPING = 4e-3  # N·m·s


def tau(t: float, R: Array, Omega: Array) -> Array:  # noqa: ARG001 - a Torque
    """Torque of the magnetic torquers, N·m."""
    dither = 2e-3 * np.sin(2.0 * np.pi * t / 90.0 + np.array([0.0, 2.0, 4.0]))
    damped: Array = dither - _DAMPING * Omega
    return damped


def tau_d(t: float, R: Array, Omega: Array) -> Array:  # noqa: ARG001 - a Torque
    """Torque of sunlight and air, N·m: slow, and fixed to the world."""
    return np.array([4e-4, -3e-4, 5e-4 * np.sin(2.0 * np.pi * t / 300.0)]) @ R


def simulate(seed: int) -> Flight:
    """Tumble; the seed draws the noise."""
    rng = np.random.default_rng(seed)
    t = curves.clock(RATE, DURATION)
    body = dynamics.Body(np.diag(J), tau, tau_d)
    q_0 = quaternion.from_euler(*np.radians([[20.0], [-35.0], [110.0]]))
    turning = Turning(
        t, *dynamics.integrate(body, q_0, np.array(OMEGA_0), seconds(t, 0), longest=1.0 / RATE)
    )
    return experiment.flight("spacecraft", seed, turning, _measure(turning, rng))


def _measure(turning: Turning, rng: np.random.Generator) -> Measured:
    t, along = turning.t, (seconds(turning.t, 0), turning.q, turning.omega)
    bias = np.array(GYRO_BIAS) + curves.step(along[0], 0.0, DURATION)[:, np.newaxis] * DRIFT
    gyro = turning.omega + bias + noise.normal(_GYRO_NOISE, bias.shape, rng)
    sun = _seen(turning, SUN, _SUN_NOISE, 2, rng)
    lit = (sun.t < ECLIPSE[0] * 1e9) | (sun.t >= ECLIPSE[1] * 1e9)
    signals = {
        "gyro": Signal(t, gyro, "simulated gyroscope"),
        "torque": Signal(t, dynamics.torques(tau, *along), "magnetic torquers"),
        "sun": Signal(sun.t[lit], sun.y[lit], "simulated sun sensor"),
    }
    for name, star in STARS.items():
        signals[name] = _seen(turning, star, _STAR_NOISE, 5, rng)
    constants = {"gyro_bias": GYRO_BIAS, "inertia": J, "sun": SUN, **STARS}
    truth = {
        "disturbance_torque": Signal(t, dynamics.torques(tau_d, *along), "sunlight and air"),
        "gyro_bias": Signal(t, bias, "drift"),
    }
    return Measured(signals, constants, truth)


def _seen(
    turning: Turning, e: tuple[float, ...], std: float, every: int, rng: np.random.Generator
) -> Signal:
    """Look at one direction at every so many moments."""
    t: Times = turning.t[::every]
    u = quaternion.rotate(quaternion.conjugate(turning.q[::every]), np.array(e))
    return Signal(t, noise.turned(u, noise.normal(std, u.shape, rng)), "simulated sensor")
