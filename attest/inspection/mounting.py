"""Options that turn a sensor's axes to those of the body."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from attest.geometry import frames, quaternion
from attest.inspection import worlds
from attest.recording import Recording, Reference

Array = NDArray[np.float64]

SENSORS = ("gyro", "accel", "mag")
"""That the options turn."""
LEANS = 0.1
"""Median cosine to where a vector should point, from which its sign is clear."""


def option(recording: Recording, name: str, axes: Array) -> str:
    """Return the option that turns a signal so, beyond what it is turned already."""
    told = recording.details.get("axes")
    before = told.get(name) if isinstance(told, Mapping) else None
    whole = axes if before is None else axes @ frames.signed(before)
    return f"--set 'input.axes.{name}=[{','.join(frames.letters(whole))}]'"


def inverted(recording: Recording, name: str) -> str:
    """Return the option that inverts a signal."""
    return option(recording, name, -np.eye(3))


def either_way(recording: Recording, name: str, axes: Array, reference: Reference | None) -> str:
    """Return the option that turns a vector so, or the opposite way; both where that is open."""
    leans = _cosine(recording, name, axes, reference)
    if abs(leans) > LEANS:
        return option(recording, name, np.sign(leans) * axes)
    return " or ".join(option(recording, name, sign * axes) for sign in (1.0, -1.0))


def _cosine(recording: Recording, name: str, axes: Array, reference: Reference | None) -> float:
    """Return the median cosine to up or north, by a reference or the body; 0 where it is open."""
    signal, up = recording.signals[name], -1.0 if recording.world == "ned" else 1.0
    some = slice(None, None, -(-len(signal.t) // worlds.MOST_SAMPLES))
    t, y = signal.t[some], signal.y[some] @ axes.T
    if reference is not None:
        near, at = worlds.nearest(t, reference.t)
        y = quaternion.rotate(reference.q[at], y[near])
    elif name == "mag":
        return 0.0
    length = np.linalg.norm(y, axis=1)
    known = length > 0.0
    if known.sum() < worlds.FEWEST:
        return 0.0
    north = y[:, 0] if recording.world == "ned" else y[:, 1]
    along = north if name == "mag" else up * y[:, 2]
    cosine = float(np.median(along[known] / length[known]))
    return cosine if np.isfinite(cosine) else 0.0
