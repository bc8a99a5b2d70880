"""Whether the magnetometer stands still while the gyroscope turns: then it is stuck.

A value that is logged again and again is no more than a slow sensor, unless it lasts for many times
as long as usual. At rest it may last for ever. A gyroscope that only reads its bias turns nothing.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]

SHORTEST, TIMES = 3.0, 10.0
"""For which a value must stay: at the least, s, and as many times as it usually does."""
BIAS = np.deg2rad(10.0)
"""A constant rate below which it may be the gyroscope's bias, rad/s."""
PIECE = 30_000_000_000
"""In which a gyroscope's bias stays the same, ns."""
GAP = 1.0
"""Between two samples, s, across which it is not known how the body turns."""
TURN = np.deg2rad(30.0)
"""By which the body must turn about another axis than the field's, rad."""


def doubts(recording: Recording) -> Iterator[Note]:
    """Yield that the magnetometer is stuck, and for how long at the most."""
    gyro, mag = recording.signals.get("gyro"), recording.signals.get("mag")
    if gyro is None or mag is None:
        return
    lasting = [time for time, turn in _stays(gyro, mag) if turn > TURN]
    if lasting:
        text = (
            f"the magnetometer stands still for {max(lasting):.0f} s while the gyroscope turns: "
            "it is stuck"
        )
        yield Note(text, len(lasting), doubt=True)


def _stays(gyro: Signal, mag: Signal) -> Iterator[tuple[float, float]]:
    """Yield how long each long stay at one value lasts, s, and by how much the body turns in it."""
    new = np.append(True, np.any(mag.y[1:] != mag.y[:-1], axis=1))
    begins = np.flatnonzero(new)
    ends = np.append(begins[1:], len(mag.t)) - 1
    lasts = (mag.t[ends] - mag.t[begins]) * 1e-9
    usual = float(np.median(np.diff(mag.t[begins]))) * 1e-9 if len(begins) > 2 else 0.0
    long = np.flatnonzero(lasts > max(SHORTEST, TIMES * usual))
    if not len(long):
        return
    at = seconds(gyro.t, int(gyro.t[0]))
    h = np.diff(at)
    step = 0.5 * (gyro.y[1:] + gyro.y[:-1]) * np.where(h < GAP, h, 0.0)[:, np.newaxis]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    for first, last in zip(begins[long], ends[long], strict=True):
        begin, end = np.searchsorted(gyro.t, (mag.t[first], mag.t[last])).tolist()
        cuts = np.flatnonzero(np.diff((gyro.t[begin:end] - mag.t[first]) // PIECE)) + begin + 1
        edges = pairwise([begin, *cuts.tolist(), end])
        pieces = [slice(*edge) for edge in edges if edge[1] - edge[0] > 1]
        turns = [_turn(at[piece], turned[piece], mag.y[first]) for piece in pieces]
        yield float(mag.t[last] - mag.t[first]) * 1e-9, max(turns, default=0.0)


def _turn(at: Array, turned: Array, field: Array) -> float:
    """Return the largest turn across a field, less a constant rate that may be a bias, rad."""
    at, turned = at - at[0], turned - turned[0]
    mean = turned[-1] / at[-1]
    bias = mean * min(1.0, BIAS / max(float(np.linalg.norm(mean)), 1e-12))
    axis = field / max(float(np.linalg.norm(field)), 1e-300)
    across = np.cross(turned - np.outer(at, bias), axis)
    return float(np.linalg.norm(across, axis=1).max())
