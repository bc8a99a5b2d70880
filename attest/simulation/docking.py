"""The scenario ``docking``: another vehicle, seen by four feature points as one comes near.

``point1`` … ``point4`` are places measured in the observer's frame S, in metres, at 20 Hz, with
3 mm of normal noise per axis; `Flight.constants` holds where each is on the object, in the
object's frame O. The truth q takes components in S to components in O: a_j = R^T (p_j - c), with c
the observer's place in O, which is the flight's position (and c' its velocity). There is no
gyroscope.

Points are hidden at times, so that they have no samples: point3 from 30 s to 38 s, point4 from
34 s to 42 s, point1 from 60 s to 61.5 s. From 34 s to 38 s two points are visible, which leave the
turn about their line open.
"""

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal, seconds
from attest.simulation import curves, noise
from attest.simulation.flight import Array, Flight

DURATION = 80.0
"""s."""
RATE = 20.0
"""Of the points, Hz."""
POINTS = {
    "point1": (0.5, 0.0, 0.0),
    "point2": (0.0, 0.4, 0.0),
    "point3": (0.0, 0.0, 0.6),
    "point4": (-0.3, -0.3, -0.2),
}
"""In the object's frame, m."""
HIDDEN = {"point3": (30.0, 38.0), "point4": (34.0, 42.0), "point1": (60.0, 61.5)}
"""From and until s."""
NOISE = 0.003
"""Standard deviation per axis, m."""

_FAR, _NEAR = (9.0, 1.2, -0.8), (1.6, 0.0, 0.0)  # c, m
_SWAY = 0.05  # m


def simulate(seed: int) -> Flight:
    """Come near; the seed draws the noise."""
    rng = np.random.default_rng(seed)
    t = curves.clock(RATE, DURATION)
    s = seconds(t, 0)
    q = attitude(s)
    return Flight(
        scenario="docking",
        seed=seed,
        t=t,
        q=quaternion.continuous(q),
        omega=curves.angular_velocity(attitude, s),
        position=place(s),
        velocity=curves.derivative(place, s),
        signals={name: _point(name, s, q, rng) for name in POINTS},
        constants=POINTS,
    )


def attitude(t: Array) -> Array:
    """Quaternion from S to O, (n, 4): the object turns slowly and wobbles."""
    roll = 0.3 * np.sin(0.21 * t) + 0.1 * np.sin(0.63 * t + 1.0)
    pitch = 0.25 * np.sin(0.17 * t + 0.7)
    yaw = np.pi + 0.05 * t + 0.2 * np.sin(0.29 * t)
    return quaternion.from_euler(roll, pitch, yaw)


def place(t: Array) -> Array:
    """Place c of the observer in O, m, (n, 3)."""
    near = curves.step(t, 5.0, 65.0)[:, np.newaxis]
    sway = _SWAY * np.sin(np.outer(t, [0.5, 0.37, 0.43]))
    path: Array = np.array(_FAR) + near * (np.array(_NEAR) - np.array(_FAR)) + sway
    return path


def _point(name: str, t: Array, q: Array, rng: np.random.Generator) -> Signal:
    a = quaternion.rotate(quaternion.conjugate(q), np.array(POINTS[name]) - place(t))
    a = a + noise.normal(NOISE, a.shape, rng)
    start, end = HIDDEN.get(name, (DURATION, DURATION))
    shown = (t < start) | (t >= end)
    return Signal(curves.clock(RATE, DURATION)[shown], a[shown], "simulated camera")
