"""What a scenario makes: the truth, and what the sensors made of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from attest.errors import ConfigError
from attest.recording import Signal, World

Array = NDArray[np.float64]
Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """One simulated flight; times are nanoseconds since the vehicle was switched on."""

    scenario: str
    seed: int
    t: Times
    """Times of the truth, strictly increasing, shape (n,)."""
    q: Array
    """True attitude (w, x, y, z), body to world, shape (n, 4)."""
    omega: Array
    """True angular velocity in the body, rad/s, shape (n, 3)."""
    position: Array
    """True position from home in the world, m, shape (n, 3)."""
    velocity: Array
    """True velocity in the world, m/s, shape (n, 3)."""
    signals: Mapping[str, Signal]
    """What the sensors gave, named and scaled as in a Recording."""
    autopilot: Array | None = None
    """The attitude that the autopilot believes in at the times of the truth, shape (n, 4)."""
    utc_offset: int | None = None
    """Nanoseconds to add to reach UTC since 1970."""
    outages: tuple[tuple[int, int], ...] = ()
    """From and until when nothing was received."""
    constants: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """What the scenario fixes, by name, in SI.

    True constants (``gyro_bias``, ``inertia``: its diagonal), the known vector or place of a signal
    by the signal's name (``v1``, ``point1``), the start of an observer (``initial_attitude``) and
    gains that a paper gives (``fts_kappa``).
    """
    truth: Mapping[str, Signal] = field(default_factory=dict)
    """Further truth that changes with time, such as ``disturbance_torque`` in N·m."""
    world: World = "ned"

    def received(self, t: Times) -> NDArray[np.bool_]:
        """Tell which of these times lie outside the outages."""
        inside = [(start <= t) & (t < end) for start, end in self.outages]
        return ~np.any(inside, axis=0) if inside else np.ones(len(t), np.bool_)


def believed(flight: Flight, signals: tuple[str, ...], what: str) -> Array:
    """Return the autopilot's attitude of a flight that has all that a vehicle's log carries.

    Raises
    ------
    ConfigError
        It lacks some of the signals, or the attitude.
    """
    missing = [name for name in signals if name not in flight.signals]
    if missing or flight.autopilot is None:
        lack = ", ".join(missing or ["autopilot"])
        raise ConfigError(f"{flight.scenario} has no {lack} for {what}. Write a .csv instead.")
    return flight.autopilot


def following(signal: Signal, t: Times) -> Array:
    """Return the values of the sample at or after each time; of the last beyond it."""
    return signal.y[np.minimum(np.searchsorted(signal.t, t), len(signal.t) - 1)]
