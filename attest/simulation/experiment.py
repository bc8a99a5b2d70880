"""What the papers' experiments share: a body that only turns, and directions that it sees.

Symbols: E = [e_1 … e_k] known inertial vectors; U = R^T E the same in the body.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from attest.geometry import quaternion
from attest.recording import Signal
from attest.simulation.flight import Array, Flight, Times

H = 0.01
"""The papers' step h, s."""
IDENTITY = (1.0, 0.0, 0.0, 0.0)

Constants = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """How a body turns: the truth."""

    t: Times
    """Nanoseconds, shape (n,)."""
    q: Array
    """Attitude, body to inertial, shape (n, 4)."""
    omega: Array
    """Angular velocity in the body, rad/s, shape (n, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What is known of a turning body."""

    signals: Mapping[str, Signal]
    constants: Constants
    truth: Mapping[str, Signal] = field(default_factory=dict)


def stamps(steps: int) -> Times:
    """Return the times of a start and so many steps of h, ns."""
    return np.arange(steps + 1, dtype=np.int64) * round(H * 1e9)


def seen(turning: Turning, E: Array) -> Array:
    """U at each moment for (k, 3) vectors E, shape (n, k, 3)."""
    return quaternion.rotate(quaternion.conjugate(turning.q)[:, np.newaxis], E)


def vectors(t: Times, U: Array) -> dict[str, Signal]:
    """Name the measured vectors ``v1`` … ``vk``."""
    each = enumerate(np.moveaxis(U, 1, 0), start=1)
    return {f"v{k}": Signal(t, u, f"e_{k} in the body") for k, u in each}


def known(E: Array) -> dict[str, tuple[float, ...]]:
    """Name the inertial vectors as `vectors` does."""
    return {f"v{k}": tuple(e.tolist()) for k, e in enumerate(E, start=1)}


def flight(scenario: str, seed: int, turning: Turning, measured: Measured) -> Flight:
    """Put together a flight that goes nowhere."""
    nowhere = np.zeros((len(turning.t), 3))
    return Flight(
        scenario=scenario,
        seed=seed,
        t=turning.t,
        q=turning.q,
        omega=turning.omega,
        position=nowhere,
        velocity=nowhere,
        signals=measured.signals,
        constants=measured.constants,
        truth=measured.truth,
    )
