"""What a cheap sensor set on a shaking quadcopter makes of the truth.

Every function takes times in seconds of the flight and the generator that draws its noise.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.simulation import trajectory

Array = NDArray[np.float64]

HOME = (47.40, 8.55, 500.0)
"""Latitude and longitude in degrees, altitude in m: the hills near Zurich."""
GYRO_BIAS = (0.02, -0.015, 0.01)
"""rad/s."""
ACCEL_BIAS = (0.03, -0.04, 0.05)
"""m/s²."""
DISTURBANCE = (22.0, 8.0, (6.0e-6, 3.5e-6, 12.0e-6))
"""A steel structure: passed at s, felt for s, tesla in NED at the closest (14 µT)."""
POSITION_LAG = 0.1
"""Of the autopilot's position and velocity, s."""

_DECIMAL_YEAR = 2026.0 + 120.0 / 365.0  # 1 May
_METRES_PER_DEGREE = 111318.84502145034  # as ArduPilot's flat earth has it
_IDLE = 0.08  # vibration of idling motors, as a share of that in flight
_MOTORS = (83.0, 117.0, 131.0, 172.0)  # Hz, all beyond what 50 Hz can show: aliased
_GYRO_NOISE, _ACCEL_NOISE, _MAG_NOISE = 0.004, 0.05, 0.4e-6
_GYRO_SHAKE, _ACCEL_SHAKE = (0.012, 0.012, 0.006), (0.35, 0.35, 0.6)  # per motor and as noise


@cache
def magnetic_field() -> tuple[float, float, float]:
    """Earth's field at home on the day, tesla in NED, from WMM2025."""
    from pygeomag import GeoMag

    latitude, longitude, altitude = HOME
    field = GeoMag().calculate(latitude, longitude, altitude / 1000.0, _DECIMAL_YEAR)
    return field.x * 1e-9, field.y * 1e-9, field.z * 1e-9


def gyro(t: Array, rng: np.random.Generator) -> Array:
    """Angular velocity, rad/s, with bias, noise and what the motors shake."""
    noise = _GYRO_NOISE * rng.standard_normal((len(t), 3))
    omega: Array = trajectory.angular_velocity(t) + np.array(GYRO_BIAS) + noise
    return omega + _vibration(t, _GYRO_SHAKE, rng)


def accel(t: Array, rng: np.random.Generator) -> Array:
    """Specific force, m/s², with bias, noise and what the motors shake."""
    noise = _ACCEL_NOISE * rng.standard_normal((len(t), 3))
    force: Array = trajectory.specific_force(t) + np.array(ACCEL_BIAS) + noise
    return force + _vibration(t, _ACCEL_SHAKE, rng)


def mag(t: Array, rng: np.random.Generator) -> Array:
    """Magnetic field in the body, tesla, with noise and a disturbance fixed to the ground."""
    passed, felt, strength = DISTURBANCE
    near = np.clip((t - passed) / felt + 0.5, 0.0, 1.0)
    bump = np.sin(np.pi * near) ** 2
    field = np.array(magnetic_field()) + bump[:, np.newaxis] * np.array(strength)
    noise = _MAG_NOISE * rng.standard_normal((len(t), 3))
    return quaternion.rotate(quaternion.conjugate(trajectory.attitude(t)), field) + noise


def navigation(t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Late latitude, longitude, altitude (degrees, m) and NED velocity (m/s) of the autopilot."""
    place, velocity, _ = trajectory.kinematics(t - POSITION_LAG)
    wander = np.stack([np.sin(0.11 * t), np.cos(0.07 * t), np.sin(0.05 * t + 1.0)], axis=-1)
    place = place + 0.5 * wander + 0.02 * rng.standard_normal((len(t), 3))
    velocity = velocity + 0.04 * wander + 0.03 * rng.standard_normal((len(t), 3))
    return geodetic(place), velocity


def geodetic(place: Array) -> Array:
    """Latitude, longitude (degrees) and altitude (m) of NED metres from home."""
    latitude, longitude, altitude = HOME
    narrow = np.cos(np.radians(latitude))
    north, east, down = place.T / np.array([[_METRES_PER_DEGREE], [_METRES_PER_DEGREE], [1.0]])
    return np.stack([latitude + north, longitude + east / narrow, altitude - down], axis=-1)


def local(position: Array) -> Array:
    """NED metres from home of latitude, longitude (degrees) and altitude (m)."""
    north, east, up = (position - np.array(HOME)).T
    narrow = np.cos(np.radians(HOME[0]))
    scale = _METRES_PER_DEGREE
    return np.stack([scale * north, scale * narrow * east, -up], axis=-1)


def autopilot(t: Array) -> Array:
    """Estimate on board: off by 1–2° in tilt, slowly varying, and 3° in heading."""
    error = np.stack(
        [
            1.2 * np.sin(2.0 * np.pi * t / 23.0),
            1.3 * np.cos(2.0 * np.pi * t / 31.0),
            3.0 + 0.5 * np.sin(2.0 * np.pi * t / 41.0),
        ],
        axis=-1,
    )
    return quaternion.multiply(quaternion.exp(np.radians(error)), trajectory.attitude(t))


def _vibration(t: Array, shake: tuple[float, ...], rng: np.random.Generator) -> Array:
    """Four motors near their rates, each axis in its own phase, and as much noise, (n, 3)."""
    phases = rng.uniform(0.0, 2.0 * np.pi, (len(_MOTORS), 3))
    total = rng.standard_normal((len(t), 3))
    for k, (rate, phase) in enumerate(zip(_MOTORS, phases, strict=True)):
        hunting = 3.0 * np.sin(0.7 * t + k)  # the speed controller at work, rad
        total += np.sin((2.0 * np.pi * rate * t + hunting)[:, np.newaxis] + phase)
    work = _IDLE + (1.0 - _IDLE) * trajectory.airborne(t)
    shaken: Array = work[:, np.newaxis] * np.array(shake) * total
    return shaken
