"""Rates that no inertial sensor has: the unit of a CSV's times taken for another one."""

import numpy as np

from attest.inspection import units
from attest.recording import Note, Recording

DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Units that the times of a CSV can be read in, and their decimals that make a nanosecond."""
SLOWEST, FASTEST = 1.0, 20_000.0
"""Hz, within which a gyroscope's rate is not doubted."""
USUAL = (5.0, 10_000.0)
"""Hz, within which it must be in another unit before this is named."""


def doubt(recording: Recording) -> Note | None:
    """Doubt the unit of time where the gyroscope's rate cannot be, and another unit mends it."""
    gyro = recording.signals.get("gyro")
    if recording.format != "csv" or gyro is None or len(gyro.t) < 3:
        return None
    rate = 1e9 / float(np.median(np.diff(gyro.t)))
    if SLOWEST < rate < FASTEST:
        return None
    now = units.told(recording).get("time", "s")
    for unit, digits in DIGITS.items():
        if USUAL[0] <= rate * 10.0 ** (DIGITS[now] - digits) <= USUAL[1]:
            return Note(
                f"the gyroscope has {rate:.3g} Hz: its times seem to be in {unit}, not {now}"
                f": --set input.csv.time.unit={unit}",
                doubt=True,
            )
    return None
