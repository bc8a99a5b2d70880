"""Which values of a log without checksums can be used."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from attest.recording import Note

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

WILD = {"gyro": 200.0, "accel": 5000.0, "mag": 0.1, "velocity": 20_000.0}
"""No sensor measures more, in SI units: what says so is damaged."""


def any_of(marks: Mask) -> Mask:
    """Whether any in each row is; over rows so short numpy's own takes eight times as long."""
    return reduce(np.logical_or, marks.T)


def usable(
    label: str, times: tuple[Ints, Ints], y: Array, held: Mask, notes: list[Note]
) -> tuple[Ints, Ints]:
    """Find times and rows of the values that are held, finite and possible; note the others.

    Parameters
    ----------
    label
        Message or topic, and the signal as the last word.
    times
        Times and the rows they belong to.
    """
    finite = ~any_of(~np.isfinite(y))
    with np.errstate(invalid="ignore"):
        most = WILD.get(label.rpartition(" ")[2], np.inf)
        wild = held & finite & any_of(np.abs(y) > most)
    for lost, what in (
        (~held & finite, "without a value"),
        (~finite, "not finite"),
        (wild, "beyond what a sensor measures"),
    ):
        if count := int(lost.sum()):
            doubt = what.startswith("beyond") and count > 0.01 * len(y)
            notes.append(Note(f"{label} {what} dropped", count, doubt))
    t, rows = times
    good = (held & finite & ~wild)[rows]
    return t[good], rows[good]


def declination(names: NDArray[np.generic], values: NDArray[np.generic]) -> float | None:
    """Return ArduPilot's parameter COMPASS_DEC, rad, the last of a log; 0 stands for none."""
    told = parameter(names, values, "COMPASS_DEC")
    return told if told is not None and 0.0 < abs(told) <= np.pi else None


def parameter(names: NDArray[np.generic], values: NDArray[np.generic], name: str) -> float | None:
    """Return one of ArduPilot's parameters, the last of a log."""
    known = name if names.dtype.kind == "U" else name.encode()
    if names.ndim != 1 or values.ndim != 1 or values.dtype.kind not in "iuf":
        return None
    told = values[names == known].astype(np.float64)
    return float(told[-1]) if len(told) else None
