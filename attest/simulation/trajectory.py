"""A quadcopter's smooth path, and the attitude that flies it.

A multicopter is differentially flat [1]: position and heading, with their derivatives, fix the
attitude, for the thrust along body -z is all that the rotors give. With rotor drag proportional to
velocity [2], ``thrust = a - g + c v``. Here world is NED, body FRD and everything is a function of
time, so that truth is exact at whatever time a sensor looks.

[1]  D. Mellinger, V. Kumar, "Minimum snap trajectory generation and control for quadrotors",
     ICRA 2011.
[2]  R. Mahony, V. Kumar, P. Corke, "Multirotor aerial vehicles", IEEE RAM 19(3), 2012.

A jet is a function of time with its first and second derivative, shape (3, n).
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY

Array = NDArray[np.float64]

DURATION = 64.0
"""Of the flight, s."""
_DRAG = 0.2
"""Rotor drag c by mass, 1/s."""

_LEGS = (  # start s, duration s, course deg (None: down), metres
    (4.0, 6.0, None, -12.0),
    (16.5, 9.5, 130.0, 60.0),
    (46.0, 9.0, 130.0, -60.0),
    (54.0, 7.0, None, 12.0),
)
_HEADING = 30.0
_TURNS = ((12.0, 4.0, 100.0), (26.0, 3.0, -70.0))  # start s, duration s, degrees
_CIRCLE = (29.5, 14.0, 60.0, 6.0)  # start s, duration s, course at entry deg, radius m
_AIRBORNE = ((4.5, 3.0), (57.0, 3.0))  # fade in and out of the wind: start s, duration s
_GUSTS = ((0.06, 1.9, 0.004, 5.6), (0.06, 1.6, 0.004, 4.9), (0.03, 1.3, 0.002, 4.1))  # m, rad/s, …
_YAW_GUSTS = (0.02, 1.3, 0.003, 6.9)  # rad, rad/s, …


def kinematics(t: Array) -> tuple[Array, Array, Array]:
    """Position m, velocity m/s and acceleration m/s² in NED at t seconds, each (n, 3)."""
    path = np.zeros((3, 3, len(t)))  # axis, jet, time
    for start, duration, course, metres in _LEGS:
        step = metres * _step(t, start, duration)
        path += _along(course)[:, np.newaxis, np.newaxis] * step
    start, duration, course, radius = _CIRCLE
    phi = 2.0 * np.pi * _step(t, start, duration)
    entry, right = _along(course), _along(course + 90.0)
    # sin(phi - pi/2) = -cos(phi)
    bulge = _sine(phi, -0.5 * np.pi) + np.array([[1.0], [0.0], [0.0]])
    path += radius * entry[:, np.newaxis, np.newaxis] * _sine(phi)
    path += radius * right[:, np.newaxis, np.newaxis] * bulge
    path += np.stack([_product(_airborne(t), _gusts(t, *gusts)) for gusts in _GUSTS])
    position, velocity, acceleration = np.moveaxis(path, 1, 0)
    return position.T, velocity.T, acceleration.T


def attitude(t: Array) -> Array:
    """Quaternion body to NED at t seconds, (n, 4): thrust along body -z, heading as planned."""
    _, velocity, acceleration = kinematics(t)
    down = np.array([0.0, 0.0, GRAVITY]) - acceleration - _DRAG * velocity  # body z in the world
    yaw = _heading(t)
    ahead = np.cos(yaw) * down[:, 0] + np.sin(yaw) * down[:, 1]
    aside = np.cos(yaw) * down[:, 1] - np.sin(yaw) * down[:, 0]
    # in axes turned by yaw, body z is (sin pitch cos roll, -sin roll, cos pitch cos roll)
    pitch = np.arctan2(ahead, down[:, 2])
    roll = np.arctan2(-aside, np.hypot(ahead, down[:, 2]))
    return quaternion.from_euler(roll, pitch, yaw)


def angular_velocity(t: Array) -> Array:
    """Angular velocity in the body at t seconds, rad/s, (n, 3), by central difference."""
    # the error h²/6 |Omega''| stays under 1e-5 rad/s, and h/2 |jump of Omega'| under 2e-4 at joints
    h = 0.5e-3
    turn = quaternion.multiply(quaternion.conjugate(attitude(t - h)), attitude(t + h))
    return quaternion.log(turn) / (2.0 * h)


def specific_force(t: Array) -> Array:
    """R^T (a - g) at t seconds, m/s² in the body, (n, 3)."""
    _, _, acceleration = kinematics(t)
    felt = acceleration - np.array([0.0, 0.0, GRAVITY])
    return quaternion.rotate(quaternion.conjugate(attitude(t)), felt)


def airborne(t: Array) -> Array:
    """How much the motors work at t seconds: 0 idle, 1 flying, (n,)."""
    weight: Array = _airborne(t)[0]
    return weight


def _along(course: float | None) -> Array:
    """Point along a course in degrees, or down."""
    if course is None:
        return np.array([0.0, 0.0, 1.0])
    return np.array([np.cos(np.radians(course)), np.sin(np.radians(course)), 0.0])


def _heading(t: Array) -> Array:
    """Planned heading, rad: turns, along the circle, and a little wind."""
    turns = sum(np.radians(degrees) * _step(t, *when)[0] for *when, degrees in _TURNS)
    circle = 2.0 * np.pi * _step(t, *_CIRCLE[:2])[0]
    wind = _airborne(t)[0] * _gusts(t, *_YAW_GUSTS)[0]
    heading: Array = np.radians(_HEADING) + turns + circle + wind
    return heading


def _airborne(t: Array) -> Array:
    rise, fall = (_step(t, *fade) for fade in _AIRBORNE)
    return rise - fall


def _step(t: Array, start: float, duration: float) -> Array:
    """Jet of the septic smooth step from 0 to 1, whose first three derivatives end at 0."""
    x = np.clip((t - start) / duration, 0.0, 1.0)
    x3, y = x * x * x, 1.0 - x
    value = x * x3 * (35.0 - 84.0 * x + 70.0 * x * x - 20.0 * x3)
    rate = 140.0 * x3 * y * y * y / duration
    return np.stack([value, rate, 420.0 * x * x * y * y * (y - x) / duration**2])


def _sine(phi: Array, phase: float = 0.0) -> Array:
    """Jet of sin(phi + phase) for the jet of an angle."""
    s, c = np.sin(phi[0] + phase), np.cos(phi[0] + phase)
    return np.stack([s, c * phi[1], c * phi[2] - s * phi[1] ** 2])


def _product(a: Array, b: Array) -> Array:
    """Jet of a product."""
    return np.stack(
        [a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]]
    )


def _gusts(t: Array, slow: float, w_slow: float, fast: float, w_fast: float) -> Array:
    """Jet of two sine waves, as wind moves a hovering vehicle."""
    clock = np.stack([t, np.ones_like(t), np.zeros_like(t)])
    return slow * _sine(w_slow * clock) + fast * _sine(w_fast * clock, 1.0)
