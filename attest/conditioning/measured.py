"""One measured vector on the timeline."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.rows import count_between, largest, split
from attest.conditioning.timeline import SECOND, Timeline
from attest.config import Conditioning
from attest.recording import Note, Signal
from attest.samples import Sensors

Array = NDArray[np.float64]

SHORTEST, LONGEST = 1e-12, 1e6
"""Lengths between which a vector is one, in m/s² or tesla or any other unit."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One vector on the timeline: in the body, in the world, and where it may be used."""

    body: Array
    inertial: Array
    """Shape (n, 3), or (1, 3) where constant."""
    valid: NDArray[np.bool_]
    length: Array
    """Of the measured vector in its own unit, shape (n,)."""
    field: Array | None = None
    """Of a magnetometer, the model's field in the world, tesla, shape (3,)."""
    sensors: Sensors | None = None
    """Of a magnetometer, its own errors."""


def any_usable(signal: Signal) -> bool:
    """Tell whether any vector has a direction."""
    few = signal.y[:1]  # the first one, usually
    return count_between(few, SHORTEST, LONGEST) > 0 or len(usable(signal)[0].t) > 0


def usable(signal: Signal) -> tuple[Signal, list[Note]]:
    """Leave out vectors that have no direction: of no length, or of none that is real."""
    if count_between(signal.y, SHORTEST, LONGEST) == len(signal.t):
        return signal, []
    length = largest(signal.y)
    some = np.flatnonzero((length > SHORTEST) & (length < LONGEST))
    left_out = Note(f"{signal.source} vector of no real length left out", len(signal.t) - len(some))
    return Signal(signal.t[some], signal.y[some], signal.source), [left_out]


def carried(
    line: Timeline, signal: Signal, known: Array, config: Conditioning, into: Array
) -> Measured:
    """Carry a signal by the gyroscope to the timeline; its directions fill an array (n, 3)."""
    max_age = min(config.max_age_s, config.restart_gap_s / 2.0)  # never across a restart
    body, valid, _ = frame.carry(line.t, line.D, signal.t, signal.y, round(max_age * SECOND))
    length = np.empty(len(body))
    split(body, into, length)
    return Measured(into, unit(known), valid, length)


def unit(v: Array) -> Array:
    """Scale to unit length; zero stays zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    unit: Array = v / np.where(length > 0.0, length, 1.0)
    return unit
