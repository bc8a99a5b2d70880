"""The scenario ``fixed-wing``: five minutes with long coordinated turns in wind.

Level flight, a climb, three circles to the right at 35° of bank, four to the left at 45°, a
descent with S-turns. In a turn the accelerometer's direction is that of the lift: gravity alone
explains it wrongly by the bank angle for more than a minute. The nose points into the air's flow,
not along the track.

World is NED, body FRD, everything a function of time but the path, which is integrated.
"""

import numpy as np

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.recording import Signal, seconds
from attest.simulation import curves, noise, sensors
from attest.simulation.flight import Array, Flight
from attest.simulation.quadcopter import UTC_AT_BOOT

DURATION = 300.0
"""s."""
AIRSPEED = 22.0
"""m/s."""
WIND = (5.0, -3.0, 0.0)
"""Of the air over the ground, m/s, NED."""
GPS_LAG = 0.25
"""Of position and velocity, s."""
GYRO_BIAS = (-0.012, 0.02, 0.006)
"""rad/s."""
ACCEL_BIAS = (0.08, -0.05, 0.12)
"""m/s²."""

_TURNS = (  # start s, end s, bank deg
    (50.0, 117.0, 35.0),
    (135.0, 200.0, -45.0),
    (230.0, 242.0, 30.0),
    (244.0, 256.0, -30.0),
    (258.0, 270.0, 30.0),
)
_SLOPES = ((12.0, 40.0, 6.0), (215.0, 280.0, -4.0))  # start s, end s, degrees
_ROLL_IN = 4.0  # s
_ALPHA = 0.055  # angle of attack per load factor, rad
_GUSTS = ((0.020, 2.3), (0.015, 1.7), (0.012, 1.1))  # rad, rad/s: roll, pitch, yaw
_GYRO_NOISE, _ACCEL_NOISE, _MAG_NOISE, _GPS_NOISE = 0.01, 0.3, 0.4e-6, (1.0, 0.1)


def simulate(seed: int) -> Flight:
    """Fly it; the seed draws the noise."""
    rng = np.random.default_rng(seed)
    t = curves.clock(25.0, DURATION)
    s = seconds(t, 0)
    return Flight(
        scenario="fixed-wing",
        seed=seed,
        t=t,
        q=quaternion.continuous(attitude(s)),
        omega=curves.angular_velocity(attitude, s),
        position=place(s),
        velocity=velocity(s),
        signals=_signals(rng),
        utc_offset=UTC_AT_BOOT,
        constants={"gyro_bias": GYRO_BIAS, "accel_bias": ACCEL_BIAS, "wind": WIND},
    )


def velocity(t: Array) -> Array:
    """Velocity over the ground, m/s, NED, (n, 3)."""
    psi, gamma = _course(t), _slope(t)
    ahead = np.stack(
        [np.cos(gamma) * np.cos(psi), np.cos(gamma) * np.sin(psi), -np.sin(gamma)], axis=-1
    )
    over_ground: Array = AIRSPEED * ahead + np.array(WIND)
    return over_ground


def place(t: Array) -> Array:
    """Position from home, m, NED, (n, 3): 100 m up at 0 s, by Simpson's rule from there."""
    h = 0.02
    knots: Array = h * np.arange(-50.0, round(DURATION / h) + 51.0)
    both = velocity(knots), velocity(knots + 0.5 * h)
    pieces = h / 6.0 * (both[0][:-1] + 4.0 * both[1][:-1] + both[0][1:])
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(pieces, axis=0)])
    start = path[50] + np.array([0.0, 0.0, 100.0])
    return np.stack([np.interp(t, knots, axis) for axis in (path - start).T], axis=-1)


def attitude(t: Array) -> Array:
    """Quaternion body to NED, (n, 4): banked so that no side force is felt, but for gusts."""
    psi, gamma = _course(t), _slope(t)
    level = quaternion.from_euler(np.zeros_like(t), gamma, psi)
    felt = quaternion.rotate(quaternion.conjugate(level), _felt(t))
    bank = np.arctan2(felt[:, 1], -felt[:, 2])
    load = np.hypot(felt[:, 1], felt[:, 2]) / GRAVITY
    banked = quaternion.multiply(level, _about(0, bank))
    q = quaternion.multiply(banked, _about(1, _ALPHA * load))
    for axis, (size, w) in enumerate(_GUSTS):
        q = quaternion.multiply(q, _about(axis, size * np.sin(w * t)))
    return q


def specific_force(t: Array) -> Array:
    """R^T (a - g), m/s² in the body, (n, 3)."""
    return quaternion.rotate(quaternion.conjugate(attitude(t)), _felt(t))


def _felt(t: Array) -> Array:
    felt: Array = curves.derivative(velocity, t) - np.array([0.0, 0.0, GRAVITY])
    return felt


def _signals(rng: np.random.Generator) -> dict[str, Signal]:
    t, t_mag, t_gps = (curves.clock(rate, DURATION) for rate in (50.0, 10.0, 5.0))
    shape, s, late = (len(t), 3), seconds(t, 0), seconds(t_gps, 0) - GPS_LAG
    gyro = curves.angular_velocity(attitude, s) + noise.normal(_GYRO_NOISE, shape, rng)
    accel = specific_force(s) + noise.normal(_ACCEL_NOISE, shape, rng)
    to_body = quaternion.conjugate(attitude(seconds(t_mag, 0)))
    mag = quaternion.rotate(to_body, np.array(sensors.magnetic_field()))
    metres, speed = _GPS_NOISE
    where = place(late) + noise.normal(metres, (len(t_gps), 3), rng)
    moving = velocity(late) + noise.normal(speed, (len(t_gps), 3), rng)
    return {
        "gyro": Signal(t, gyro + np.array(GYRO_BIAS), "simulated IMU"),
        "accel": Signal(t, accel + np.array(ACCEL_BIAS), "simulated IMU"),
        "mag": Signal(t_mag, mag + noise.normal(_MAG_NOISE, mag.shape, rng), "simulated compass"),
        "position": Signal(t_gps, sensors.geodetic(where), "simulated GPS"),
        "velocity": Signal(t_gps, moving, "simulated GPS"),
    }


def _course(t: Array) -> Array:
    """Heading of the velocity through the air, rad."""
    psi = np.full_like(t, np.radians(20.0))
    for start, end, bank in _TURNS:
        turn = GRAVITY / AIRSPEED * np.tan(np.radians(bank))  # of level flight, rad/s
        psi += turn * (curves.ramp(t, start, _ROLL_IN) - curves.ramp(t, end - _ROLL_IN, _ROLL_IN))
    return psi


def _slope(t: Array) -> Array:
    """Angle of climb through the air, rad."""
    gamma = np.zeros_like(t)
    for start, end, degrees in _SLOPES:
        gamma += np.radians(degrees) * curves.window(t, start, end, _ROLL_IN)
    return gamma


def _about(axis: int, angle: Array) -> Array:
    """Quaternions that turn about a body axis."""
    return quaternion.exp(angle[:, np.newaxis] * np.eye(3)[axis])
