"""Whether the receivers behind a velocity knew it: their fix, and how accurate they say it is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.readers.values import Array, Ints, Mask
from attest.recording import Note, Signal

FIX = 3
"""Type of a fix in three dimensions, with every autopilot."""
FEWEST = 4
"""Satellites that a fix in three dimensions takes."""
WORST = 2.0
"""Accuracy of the speed from which it tells no acceleration, m/s."""
SILENT = 5_000_000_000
"""A receiver that says nothing for so long has no fix any more, nanoseconds."""


@dataclass(frozen=True, slots=True, eq=False)
class Receiver:
    """What a receiver says of itself, on the recording's clock."""

    label: str
    t: Ints
    fixed: Mask
    """Whether it has a fix in three dimensions."""
    accuracy: Array
    """Of its speed, as it says itself, m/s; zero or not a number where it does not."""


def fixed(kind: NDArray[Any], satellites: NDArray[Any] | None) -> Mask:
    """Whether a receiver has a fix in three dimensions; no satellites stand for an unknown number.

    Parameters
    ----------
    kind
        The type of its fix, ``FIX`` and above in three dimensions.
    """
    held = np.asarray(kind >= FIX)
    if satellites is None:
        return held
    return np.asarray(held & ((satellites == 0) | (satellites >= FEWEST)))


def vetted(
    velocity: Signal | None, receivers: Sequence[Receiver], notes: list[Note]
) -> Signal | None:
    """Leave out what is measured, or estimated, while no receiver has a fix or a good one.

    An estimator that never had a receiver with a fix has its velocity from something else.
    """
    receivers = [receiver for receiver in receivers if len(receiver.t)]
    own = velocity is not None and any(r.label == velocity.source for r in receivers)
    if velocity is None or not (own or any(receiver.fixed.any() for receiver in receivers)):
        return velocity
    if own:
        receivers = [receiver for receiver in receivers if receiver.label == velocity.source]
    verdicts = [_verdict(velocity.t, receiver) for receiver in receivers]
    fix = np.logical_or.reduce([has for has, _ in verdicts])
    good = np.logical_or.reduce([has & precise for has, precise in verdicts])
    for lost, why in ((~fix, "without a 3D fix"), (fix & ~good, f"no better than {WORST:g} m/s")):
        if count := int(lost.sum()):
            text = f"{velocity.source} velocity {why} dropped"
            notes.append(Note(text, count, doubt=count > 0.1 * len(fix)))
    return replace(velocity, t=velocity.t[good], y=velocity.y[good]) if good.any() else None


def _verdict(t: Ints, receiver: Receiver) -> tuple[Mask, Mask]:
    """Return whether a receiver has a fix at times t, and speaks of no bad accuracy."""
    last = np.maximum(np.searchsorted(receiver.t, t, side="right") - 1, 0)
    usual = int(np.median(np.diff(receiver.t))) if len(receiver.t) > 1 else 0
    heard = np.abs(t - receiver.t[last]) <= max(SILENT, 3 * usual)
    accuracy = np.nan_to_num(receiver.accuracy[last])
    return receiver.fixed[last] & heard, accuracy <= WORST
