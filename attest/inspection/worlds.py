"""Worlds and bodies that a log or a reference may be in, which way is up in them, and the option.

ned: world north-east-down, body forward-right-down
enu: world east-north-up, body forward-left-up
"""

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.geometry.earth import GRAVITY
from attest.recording import Recording, Reference, Signal, World

Array = NDArray[np.float64]

FIXED = ("tlog", "dataflash", "ulog", "sensor_logger")
"""Formats whose axes are fixed by their makers."""
SAID = {"ned": "ned with a body forward-right-down", "enu": "enu with a body forward-left-up"}
OTHER: dict[World, World] = {"ned": "enu", "enu": "ned"}
NORTH: dict[World, str] = {"ned": "+x", "enu": "+y"}
"""Axis that is north."""
NAMES = {
    "ned": {"+x": "north-west-up", "+y": "east-north-up"},
    "enu": {"+x": "north-east-down", "+y": "west-north-down", "-y": "east-south-down"},
}
"""A world that is upside down to a declared one, by the declared axis that its north is along."""
MOST_SAMPLES = 2_000
NEAR_GRAVITY = 0.3
"""A specific force that differs from gravity by more than this share tells no vertical."""
OPPOSITE = 0.95
"""Median cosine between a vertical and another's opposite from which they are opposite."""
FEWEST = 10
ALONG = 0.85
"""Cosine from which a field is along an axis: declination and a bad heading leave that much."""


def verticals(recording: Recording) -> Signal | None:
    """Return unit specific force where it is about gravity, at some moments over the log."""
    if "accel" not in recording.signals:
        return None
    accel = recording.signals["accel"]
    every = -(-len(accel.t) // MOST_SAMPLES)
    y = accel.y[::every]
    length = np.linalg.norm(y, axis=1)
    near = np.flatnonzero(np.abs(length / GRAVITY - 1.0) < NEAR_GRAVITY)
    if len(near) < FEWEST:
        return None
    return Signal(accel.t[::every][near], y[near] / length[near, np.newaxis], accel.source)


def nearest(t: NDArray[np.int64], stamps: NDArray[np.int64]) -> tuple[NDArray[np.bool_], Array]:
    """Mark times that have a stamp within a tenth of a second, and return its place."""
    at = np.clip(np.searchsorted(stamps, t), 1, max(1, len(stamps) - 1))
    at = np.minimum(at, len(stamps) - 1)
    near = np.abs(stamps[at] - t) < 100_000_000
    return near, at[near]


def cosine(recording: Recording, reference: Reference, up: Signal) -> float | None:
    """Return the median cosine between the verticals of accelerometer and reference."""
    near, at = nearest(up.t, reference.t)
    if near.sum() < FEWEST:
        return None
    down = quaternion.rotate(reference.q[at], up.y[near])[:, 2]
    return float(np.clip(np.median(-down if recording.world == "ned" else down), -1.0, 1.0))


def north(recording: Recording, reference: Reference) -> str | None:
    """Name the axis of a reference's world that the field's north is along."""
    mag = recording.signals["mag"]
    some = slice(None, None, -(-len(mag.t) // MOST_SAMPLES))
    near, at = nearest(mag.t[some], reference.t)
    if near.sum() < FEWEST:
        return None
    x, y, _ = np.median(quaternion.rotate(reference.q[at], mag.y[some][near]), axis=0)
    flat = np.hypot(x, y)
    along = {"+x": x, "-x": -x, "+y": y, "-y": -y}
    axis = max(along, key=lambda name: along[name])
    return axis if along[axis] > ALONG * flat else None


def try_other(recording: Recording) -> str:
    """Name the option that changes the log's axes, for formats that do not fix them."""
    return "" if recording.format in FIXED else f": try --world {OTHER[recording.world]}"


def try_reference(recording: Recording, reference: Reference) -> str:
    """Name the option that changes the axes of a reference's file and leaves those of the log."""
    if reference.world is None:
        return ""
    world = OTHER[reference.world]
    return f": try --world {world}" if recording.format in FIXED or recording.world == world else ""
