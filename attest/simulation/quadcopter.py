"""The scenario ``quadcopter``: a flight of 64 s with everything that troubles an observer.

Standing 4 s, take-off, hover, turns, forward flight past a steel structure, a full circle, a lost
link for 1.5 s, the way back sideways, landing.
"""

from datetime import UTC, datetime

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal
from attest.simulation import sensors, trajectory
from attest.simulation.flight import Array, Flight, Times

BOOT = 12_345_000_000
"""How long the autopilot had been on when the log starts, ns."""
UTC_AT_BOOT = int(datetime(2026, 5, 1, 9, 30, tzinfo=UTC).timestamp()) * 10**9
OUTAGE = (44.3, 45.8)
"""The link is lost, s of the flight."""


def simulate(seed: int) -> Flight:
    """Fly it; the seed draws noise and jitter only."""
    rng = np.random.default_rng(seed)
    # the truth keeps to whole milliseconds, as the messages that will carry it do
    t = _clock(rng, 40_000_000, 3_000_000, 1_000_000)
    seconds = _seconds(t)
    place, velocity, _ = trajectory.kinematics(seconds)
    return Flight(
        scenario="quadcopter",
        seed=seed,
        t=t,
        q=quaternion.continuous(trajectory.attitude(seconds)),
        omega=trajectory.angular_velocity(seconds),
        position=place,
        velocity=velocity,
        signals=_inertial(rng) | _navigation(rng),
        autopilot=quaternion.continuous(sensors.autopilot(seconds)),
        utc_offset=UTC_AT_BOOT,
        outages=((BOOT + round(OUTAGE[0] * 1e9), BOOT + round(OUTAGE[1] * 1e9)),),
        constants={"gyro_bias": sensors.GYRO_BIAS, "accel_bias": sensors.ACCEL_BIAS},
    )


def _inertial(rng: np.random.Generator) -> dict[str, Signal]:
    t = _clock(rng, 20_000_000, 300_000, 1_000)
    seconds = _seconds(t)
    return {
        "gyro": Signal(t, sensors.gyro(seconds, rng), "simulated IMU"),
        "accel": Signal(t, sensors.accel(seconds, rng), "simulated IMU"),
        "mag": Signal(t, sensors.mag(seconds, rng), "simulated magnetometer"),
    }


def _navigation(rng: np.random.Generator) -> dict[str, Signal]:
    t = _clock(rng, 100_000_000, 4_000_000, 1_000_000)
    position, velocity = sensors.navigation(_seconds(t), rng)
    return {
        "position": Signal(t, position, "simulated navigation"),
        "velocity": Signal(t, velocity, "simulated navigation"),
    }


def _clock(rng: np.random.Generator, period: int, jitter: int, unit: int) -> Times:
    """Stamps of a periodic task that is a little early or late, all in nanoseconds."""
    ticks = BOOT + period * np.arange(1, round(trajectory.DURATION * 1e9) // period)
    late = unit * rng.integers(-jitter // unit, jitter // unit, len(ticks), endpoint=True)
    return (ticks + late).astype(np.int64)


def _seconds(t: Times) -> Array:
    return (t - BOOT).astype(np.float64) * 1e-9
