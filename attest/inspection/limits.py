"""Whether a sensor stays at the end of its range: what lies beyond is lost."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from attest.recording import Note, Recording, Signal

Array = NDArray[np.float64]

SENSORS = {
    "gyro": ("gyroscope", "rad/s", 1.0),
    "accel": ("accelerometer", "m/s²", 1.0),
    "mag": ("magnetometer", "µT", 1e6),
}
"""What has a range that motion can leave: its name, and the unit that it is told in."""
MOST_SAMPLES = 1_000_000
"""That limits are looked for in, the first ones."""
FEWEST = 10
"""Samples at an extreme before it is taken for a limit of the sensor."""
FINE = 30
"""Distinct values of a signal before one of them can stand out as its limit."""
STANDS_OUT = 5
"""How many times as often a limit is met as the value next to it."""
RUN = 3
"""Samples in a row at a limit, from which they are one stay at it."""
ELSEWHERE = 0.2
"""Stays at other values, per sample at the limits, from which the signal is just not fine."""


def at(x: Array) -> int:
    """Return how many values lie at a limit: an extreme that is met much oftener than its next."""
    return sum(_count(side) for side in (x, -x))


def doubts(recording: Recording) -> Iterator[Note]:
    """Yield which sensors stay at a limit for samples in a row."""
    for name, (what, unit, scale) in SENSORS.items():
        if name in recording.signals:
            yield from _of(recording.signals[name], what, unit, scale)


def _of(signal: Signal, what: str, unit: str, scale: float) -> Iterator[Note]:
    y = signal.y[:MOST_SAMPLES]
    if not _suspects(y):
        return
    # a value that is logged again is no stay
    fresh = y[np.append(True, np.any(y[1:] != y[:-1], axis=1))]
    cut, total = [], 0
    for axis, column in zip("xyz", fresh.T, strict=False):
        for limit, samples in _stays(column).items():
            cut.append(f"{axis} at {limit * scale:.3g} {unit}")
            total += samples
    if cut:
        text = f"the {what} is cut off, {', '.join(cut)}: what lies beyond its range is lost"
        yield Note(text, total, doubt=True)


def _suspects(y: Array) -> bool:
    """Whether an extreme is met often enough to look closer, which few signals do."""
    columns = [np.ascontiguousarray(column) for column in y.T]  # ten times as fast
    met = (np.count_nonzero(x == extreme) for x in columns for extreme in (x.max(), x.min()))
    return any(count >= FEWEST for count in met)


def _stays(x: Array) -> dict[float, int]:
    """Return the samples in stays at each limit; none where there are stays elsewhere too."""
    limits = [float(sign * (sign * x).max()) for sign in (1.0, -1.0) if _count(sign * x)]
    begins = np.flatnonzero(np.append(True, x[1:] != x[:-1]))
    length = np.diff(begins, append=len(x))
    stays = length >= RUN
    there = {limit: int(length[stays & (x[begins] == limit)].sum()) for limit in limits}
    total = sum(there.values())
    if int(length[stays].sum()) - total > ELSEWHERE * total:
        return {}
    return {limit: samples for limit, samples in there.items() if samples >= FEWEST}


def _count(x: Array) -> int:
    """Return how many values are the greatest, 0 where that is no limit."""
    top = x.max()
    there = x == top
    count = int(there.sum())
    below = x[~there]
    if count < FEWEST or not len(below):
        return 0
    beside = int(np.sum(below == below.max()))
    fine = count > STANDS_OUT * beside and len(np.unique(below[:10_000])) > FINE
    return count if fine else 0
