"""Synthetic recordings whose truth is known, for any attitude written as a function of time."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from attest.geometry import quaternion
from attest.recording import Clock, Recording, Reference, Signal
from attest.samples import Samples

SECOND = 1_000_000_000
START = 100 * SECOND
G = 9.80665
FIELD = np.array([20e-6, 2e-6, 40e-6])
"""Magnetic field, north-east-down, tesla."""


def stamps(rate, duration, start=START):
    """Return the stamps of a sensor, ns."""
    return start + np.round(np.arange(0.0, duration, 1.0 / rate) * SECOND).astype(np.int64)


def at(t):
    """Return seconds since the start of the flight."""
    return (t - START) * 1e-9


def tumbling(seconds):
    """Attitude that turns about all axes, at rates that never repeat within minutes."""
    roll = 0.5 * np.sin(0.9 * seconds) + 0.2 * np.sin(2.3 * seconds)
    pitch = 0.4 * np.sin(0.7 * seconds + 1.0)
    yaw = 1.5 * np.sin(0.31 * seconds) + 0.6 * np.sin(1.1 * seconds + 0.4)
    return quaternion.from_euler(roll, pitch, yaw)


def resting(seconds):
    """Attitude that does not change."""
    return quaternion.from_euler(*(np.full(np.shape(seconds), angle) for angle in (0.1, -0.2, 0.7)))


def rate(attitude, seconds, h=1e-4):
    """Return the angular velocity in the body, rad/s."""
    before, after = attitude(seconds - h), attitude(seconds + h)
    return quaternion.log(quaternion.multiply(quaternion.conjugate(before), after)) / (2.0 * h)


def body(attitude, seconds, world):
    """Return a vector of the world as the body sees it."""
    return quaternion.rotate(quaternion.conjugate(attitude(seconds)), world)


def gyro(attitude, t, bias=(0.0, 0.0, 0.0)):
    """Return a gyroscope."""
    return Signal(t, rate(attitude, at(t)) + np.array(bias), "GYRO")


def seen(attitude, t, world, late=0.0):
    """Return a sensor of a constant vector of the world, whose samples are late by seconds."""
    return Signal(t, body(attitude, at(t) - late, np.asarray(world, float)), "SENSOR")


def recording(signals, *, references=(), utc=None, world="ned", restarts=()):
    """Return a log of signals, and of references (name, kind, t, q)."""
    known = {name: Reference(name, kind, t, q) for name, kind, t, q in references}
    return Recording(
        path=Path("flight.csv"),
        format="csv",
        signals=signals,
        references=known,
        clock=Clock("test clock", utc),
        world=world,
        restarts=restarts,
    )


def flight(attitude=tumbling, *, duration=30.0, bias=(0.0, 0.0, 0.0), late=0.0, utc=None):
    """Return a log with gyroscope and accelerometer at 100 Hz, magnetometer at 20 Hz, and truth."""
    t, t_mag = stamps(100.0, duration), stamps(20.0, duration)
    signals = {
        "gyro": gyro(attitude, t, bias),
        "accel": seen(attitude, t, [0.0, 0.0, -G]),
        "mag": seen(attitude, t_mag, FIELD, late),
    }
    truth = ("TRUTH", "truth", t, quaternion.continuous(attitude(at(t))))
    return recording(signals, references=[truth], utc=utc)


@dataclass(frozen=True)
class Turning:
    """S-turns at constant speed and height, each turn coordinated: the body feels no side force."""

    speed: float = 20.0
    steepest: float = 0.7
    """Bank, rad."""
    period: float = 40.0

    def bank(self, seconds):
        """Return the roll angle, rad."""
        return self.steepest * np.sin(2.0 * np.pi * seconds / self.period)

    def _heading(self):
        fine = np.arange(-2.0, 400.0, 1e-3)
        turn = G / self.speed * np.tan(self.bank(fine))
        return fine, np.concatenate([[0.0], np.cumsum(0.5 * (turn[1:] + turn[:-1]) * 1e-3)])

    def heading(self, seconds):
        """Return the yaw angle, rad."""
        return np.interp(seconds, *self._heading())

    def attitude(self, seconds):
        """Return the attitude, body to world."""
        return quaternion.from_euler(
            self.bank(seconds), np.zeros_like(seconds), self.heading(seconds)
        )

    def velocity(self, seconds):
        """Return the velocity, north-east-down."""
        psi = self.heading(seconds)
        return self.speed * np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)], axis=-1)

    def specific_force(self, seconds):
        """Return a - g in the world."""
        psi, turn = self.heading(seconds), G / self.speed * np.tan(self.bank(seconds))
        a = self.speed * turn
        return np.stack([-a * np.sin(psi), a * np.cos(psi), np.full_like(psi, -G)], axis=-1)

    def log(self, duration=120.0, *, lag=0.0, world="ned"):
        """Return a log of 50 Hz, with velocity at 5 Hz, that is late by a lag in seconds."""
        t, t_v = stamps(50.0, duration), stamps(5.0, duration)
        felt = quaternion.rotate(
            quaternion.conjugate(self.attitude(at(t))), self.specific_force(at(t))
        )
        signals = {
            "gyro": Signal(t, rate(self.attitude, at(t), 0.01), "GYRO"),
            "accel": Signal(t, felt, "ACCEL"),
            "mag": seen(self.attitude, t, FIELD),
            "velocity": Signal(t_v, self.velocity(at(t_v) - lag), "GPS"),
        }
        q = quaternion.continuous(self.attitude(at(t)))
        return recording(signals, references=[("TRUTH", "truth", t, q)], world=world)


def samples(t, gyro, body, inertial, **other):
    """Return samples with all vectors valid, no sub-steps and one start, unless told otherwise."""
    inertial = np.asarray(inertial, float)
    valid = np.ones(body.shape[:2], np.bool_)
    restart = np.arange(len(t)) == 0
    names = tuple(f"v{i + 1}" for i in range(body.shape[1]))
    given = {
        "valid": valid,
        "names": names,
        "substeps": np.ones(len(t), np.int64),
        "restart": restart,
    }
    return Samples(t=t, gyro=gyro, body=body, inertial=inertial, **(given | other))


def angle_deg(q, r):
    """Return the angle between rotations, degrees."""
    apart = quaternion.multiply(quaternion.conjugate(q), r)
    return np.rad2deg(np.linalg.norm(quaternion.log(apart), axis=-1))
