"""The scenario ``handheld``: two minutes of an inertial unit in a person's hand.

On the table 10 s, picked up, turned and swung, back on the table from 50 s to 60 s, carried past a
laptop that bends the magnetic field from 72 s to 84 s, swung harder, at rest from 110 s. No
velocity, no place: gravity and magnetic north are all there is, and swings at arm's length feel
like gravity that moves.

World is NED, body FRD, everything a function of time.
"""

import numpy as np

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.recording import Signal, seconds
from attest.simulation import curves, noise, sensors
from attest.simulation.flight import Array, Flight

DURATION = 120.0
"""s."""
RATE = 100.0
"""Of every sensor, Hz."""
RESTS = ((0.0, 10.0), (50.0, 60.0), (110.0, 120.0))
"""On the table, from and until s."""
DISTURBANCE = (72.0, 84.0, (18.0e-6, -12.0e-6, 15.0e-6))
"""Felt from and until s; tesla in NED at the strongest."""
GYRO_BIAS = (0.008, -0.011, 0.004)
"""rad/s."""
ACCEL_BIAS = (0.06, -0.03, 0.09)
"""m/s²."""

_ARM = (0.0, 0.3, 0.1)  # from the elbow to the hand, m, in the body
_YAW = 40.0  # on the table, deg
_POSES = (  # held from s until s, roll deg, pitch deg, yaw deg
    (11.0, 29.0, 35.0, -20.0, 60.0),
    (30.0, 49.0, -50.0, 40.0, -80.0),
    (61.0, 90.0, 10.0, 25.0, 130.0),
    (90.5, 109.0, 80.0, -30.0, 200.0),
)
_SWINGS = (  # from s until s, Hz, amplitude deg about x, y, z
    (14.0, 24.0, 0.6, (30.0, 15.0, 25.0)),
    (34.0, 46.0, 0.9, (20.0, 40.0, 30.0)),
    (64.0, 88.0, 0.3, (10.0, 10.0, 45.0)),
    (92.0, 107.0, 1.0, (25.0, 35.0, 20.0)),
)
_TREMOR = (0.004, 9.0)  # rad, Hz
_GYRO_NOISE, _ACCEL_NOISE, _MAG_NOISE = 0.003, 0.04, 0.5e-6


def simulate(seed: int) -> Flight:
    """Move it; the seed draws the noise."""
    rng = np.random.default_rng(seed)
    t = curves.clock(RATE, DURATION)
    s, shape = seconds(t, 0), (len(t), 3)
    q, omega = attitude(s), curves.angular_velocity(attitude, s)
    accel = specific_force(s) + noise.normal(_ACCEL_NOISE, shape, rng)
    gyro = omega + noise.normal(_GYRO_NOISE, shape, rng)
    field = quaternion.rotate(quaternion.conjugate(q), magnetic_field(s))
    return Flight(
        scenario="handheld",
        seed=seed,
        t=t,
        q=quaternion.continuous(q),
        omega=omega,
        position=place(s),
        velocity=curves.derivative(place, s),
        signals={
            "gyro": Signal(t, gyro + np.array(GYRO_BIAS), "simulated IMU"),
            "accel": Signal(t, accel + np.array(ACCEL_BIAS), "simulated IMU"),
            "mag": Signal(t, field + noise.normal(_MAG_NOISE, shape, rng), "simulated compass"),
        },
        constants={"gyro_bias": GYRO_BIAS, "accel_bias": ACCEL_BIAS},
    )


def attitude(t: Array) -> Array:
    """Quaternion body to NED, (n, 4)."""
    pose = np.zeros((len(t), 3))
    for start, end, *degrees in _POSES:
        pose += curves.window(t, start, end, 1.5)[:, np.newaxis] * np.radians(degrees)
    swing = np.zeros((len(t), 3))
    for start, end, rate, size in _SWINGS:
        phase = 2.0 * np.pi * rate * (t[:, np.newaxis] - start) + np.array([0.0, 0.8, 2.0])
        swing += curves.window(t, start, end, 2.0)[:, np.newaxis] * np.radians(size) * np.sin(phase)
    small, quick = _TREMOR
    shake = small * np.sin(2.0 * np.pi * quick * t[:, np.newaxis] + np.array([0.0, 2.1, 4.2]))
    swing += _held(t)[:, np.newaxis] * shake
    roll, pitch, yaw = pose.T
    held = quaternion.from_euler(roll, pitch, yaw + np.radians(_YAW))
    return quaternion.multiply(held, quaternion.exp(swing))


def place(t: Array) -> Array:
    """Position of the hand from the elbow, m, NED, (n, 3)."""
    return quaternion.rotate(attitude(t), np.array(_ARM))


def specific_force(t: Array) -> Array:
    """R^T (a - g), m/s² in the body, (n, 3)."""
    felt = curves.second_derivative(place, t) - np.array([0.0, 0.0, GRAVITY])
    return quaternion.rotate(quaternion.conjugate(attitude(t)), felt)


def magnetic_field(t: Array) -> Array:
    """Field at the hand, tesla, NED, (n, 3)."""
    start, end, strength = DISTURBANCE
    near = curves.window(t, start, end, 0.5 * (end - start))
    field: Array = np.array(sensors.magnetic_field()) + near[:, np.newaxis] * np.array(strength)
    return field


def _held(t: Array) -> Array:
    """Whether it is in the hand: 1, or 0 on the table."""
    (_, first), (second, third), (last, _) = RESTS
    return curves.window(t, first, second, 1.0) + curves.window(t, third, last, 1.0)
