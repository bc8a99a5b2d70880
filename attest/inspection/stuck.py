"""Whether a sensor stands still while another one says that the body turns: then it is stuck.

A value that is logged again and again is no more than a slow sensor, unless it lasts for many times
as long as usual. At rest it may last for ever. A gyroscope that only reads its bias turns nothing,
and one that stands still may turn at a constant rate.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]

NAMES = {"mag": "magnetometer", "accel": "accelerometer"}
SHORTEST, TIMES = 3.0, 10.0
"""For which a value must stay: at the least, s, and as many times as it usually does."""
BIAS = np.deg2rad(10.0)
"""A constant rate below which it may be the gyroscope's bias, rad/s."""
MEAN = 500_000_000
"""Over which a vector is averaged, ns."""
PIECE = 30_000_000_000
"""In which a gyroscope's bias stays the same, ns."""
GAP = 1.0
"""Between two samples, s, across which it is not known how the body turns."""
TURN = np.deg2rad(30.0)
"""By which the body must turn about another axis than the field's, rad."""


def doubts(recording: Recording) -> Iterator[Note]:
    """Yield which sensor is stuck, and for how long at the most."""
    signals = recording.signals
    gyro = signals.get("gyro")
    if gyro is None or not len(gyro.t):
        return
    for name, known in NAMES.items():
        vector = signals.get(name)
        if vector is not None and len(vector.t):
            yield from _told(known, "the gyroscope turns", _stays(gyro, vector))
    vector = signals.get("mag", signals.get("accel"))
    if vector is not None and len(vector.t):
        yield from _told("gyroscope", "the other sensors turn", _frozen(gyro, vector))


def _told(name: str, other: str, stays: Iterator[tuple[float, float]]) -> Iterator[Note]:
    lasting = [time for time, turn in stays if turn > TURN]
    if lasting:
        text = f"the {name} stands still for {max(lasting):.0f} s while {other}: it is stuck"
        yield Note(text, len(lasting), doubt=True)


def _long(signal: Signal) -> Iterator[tuple[int, int]]:
    """Yield the first and the last sample of each long stay at one value."""
    new = np.append(True, np.any(signal.y[1:] != signal.y[:-1], axis=1))
    begins = np.flatnonzero(new)
    ends = np.append(begins[1:], len(signal.t)) - 1
    lasts = (signal.t[ends] - signal.t[begins]) * 1e-9
    usual = float(np.median(np.diff(signal.t[begins]))) * 1e-9 if len(begins) > 2 else 0.0
    for stay in np.flatnonzero(lasts > max(SHORTEST, TIMES * usual)):
        yield int(begins[stay]), int(ends[stay])


def _frozen(gyro: Signal, vector: Signal) -> Iterator[tuple[float, float]]:
    """Yield how long each long stay of the gyroscope lasts, s, and what turn it does not tell, rad.

    Of the vector in means of half a second, against one that turns as the gyroscope reads and
    against one that does not.
    """
    for first, last in _long(gyro):
        begin, end = np.searchsorted(vector.t, (gyro.t[first], gyro.t[last])).tolist()
        t, y = vector.t[begin:end], vector.y[begin:end]
        if len(t) < 2:
            continue
        starts = np.flatnonzero(np.diff((t - t[0]) // MEAN, prepend=-1))
        u = np.add.reduceat(y, starts)
        u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-300)
        s = seconds(t[starts], int(t[0]))
        back = quaternion.exp(-np.outer(s, gyro.y[first]))
        turning = quaternion.rotate(back, u[:1])
        told = [
            np.arccos(np.clip(np.sum(u * v, axis=1), -1.0, 1.0)).max() for v in (turning, u[:1])
        ]
        yield float(gyro.t[last] - gyro.t[first]) * 1e-9, float(min(told))


def _stays(gyro: Signal, vector: Signal) -> Iterator[tuple[float, float]]:
    """Yield how long each long stay at one value lasts, s, and by how much the body turns in it."""
    long = list(_long(vector))
    if not long:
        return
    at = seconds(gyro.t, int(gyro.t[0]))
    h = np.diff(at)
    step = 0.5 * (gyro.y[1:] + gyro.y[:-1]) * np.where(h < GAP, h, 0.0)[:, np.newaxis]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    for first, last in long:
        begin, end = np.searchsorted(gyro.t, (vector.t[first], vector.t[last])).tolist()
        cuts = np.flatnonzero(np.diff((gyro.t[begin:end] - vector.t[first]) // PIECE)) + begin + 1
        edges = pairwise([begin, *cuts.tolist(), end])
        pieces = [slice(*edge) for edge in edges if edge[1] - edge[0] > 1]
        turns = [_turn(at[piece], turned[piece], vector.y[first]) for piece in pieces]
        yield float(vector.t[last] - vector.t[first]) * 1e-9, max(turns, default=0.0)


def _turn(at: Array, turned: Array, field: Array) -> float:
    """Return the largest turn across a field, less a constant rate that may be a bias, rad."""
    at, turned = at - at[0], turned - turned[0]
    mean = turned[-1] / at[-1]
    bias = mean * min(1.0, BIAS / max(float(np.linalg.norm(mean)), 1e-12))
    axis = field / max(float(np.linalg.norm(field)), 1e-300)
    across = np.cross(turned - np.outer(at, bias), axis)
    return float(np.linalg.norm(across, axis=1).max())
