"""Whether a field turns against the gyroscope: in its frame, that of the world stands still."""

from math import atan2, radians, sqrt

import numpy as np
from numpy.typing import NDArray

from attest.geometry import mat3, so3
from attest.geometry.jit import kernel
from attest.recording import Note

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW = 5.0
"""Over which a field's direction is averaged to be compared with the next, s."""
SUDDEN = radians(20.0)
"""By which it may turn against the gyroscope, rad, for iron in the body."""
LEVEL = 0.05
"""Least part of a vector that is taken across another that has a direction."""


def turned(
    h: Array,
    D: Array,
    vectors: tuple[Array, Array],
    valid: Mask,
    restart: Mask,
    *,
    aided: bool,
    most: float | Array = SUDDEN,
) -> list[Note]:
    """Say where a field turns by more than most, rad, a number or (n,); the rest as for `turns`.

    Where the log's velocity aids the accelerometer, what it should measure turns with heading.
    """
    ends, angles = turns(h, D, vectors, valid, restart, WINDOW)
    sudden = np.flatnonzero(angles > (most if isinstance(most, float) else most[ends]))
    if not len(sudden):
        return []
    at, angle = h[: ends[sudden[0]] + 1].sum(), np.rad2deg(angles[sudden].max())
    text = (
        f"the field turns against the gyroscope, by up to {angle:.0f}° from one {WINDOW:g} s to "
        f"the next, first at {at:.0f} s: disturbed, stuck or late; heading is doubtful since"
    )
    tilt = ", and tilt where it accelerates" if aided else ""
    return [Note(text + tilt, len(sudden), doubt=True)]


def turns(
    h: Array,
    D: Array,
    vectors: tuple[Array, Array],
    valid: Mask,
    restart: Mask,
    window: float,
) -> tuple[NDArray[np.intp], Array]:
    """Return where windows end, and the angles of a direction's mean to the one before, rad.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    D : shape (n, 4)
        Frame of the gyroscope, body to frame.
    vectors : shape (n, 3) and (n, 3) or (0, 3)
        Unit vectors in the body, and those across which they are taken.
    valid : shape (n,)
        Where they are measured.
    window
        Length of a window, s; one that is measured in less than half of it has no mean.
    """
    most = min(len(h), 1 + int(h.sum() / window))
    ends, angles = np.empty(most, np.intp), np.empty(most)
    found = _turns(h, D, vectors, valid, restart, window, ends, angles)
    return ends[:found], angles[:found]


@kernel
def _turns(
    h: Array,
    D: Array,
    vectors: tuple[Array, Array],
    valid: Mask,
    restart: Mask,
    window: float,
    ends: NDArray[np.intp],
    angles: Array,
) -> int:
    """Fill the ends of windows and the angles there; return how many."""
    unit, up = vectors
    found = 0
    before = total = (0.0, 0.0, 0.0)
    time = seen = 0.0
    for i in range(len(unit)):
        if restart[i]:
            before = total = (0.0, 0.0, 0.0)
            time = seen = 0.0
        time += h[i]
        v, size = so3.unit_of(so3.flat(so3.row(unit, i), up, i))
        if valid[i] and size > LEVEL:
            seen += h[i]
            R = so3.matrix(so3.row4(D, i))
            total = so3.add(total, so3.scale(h[i], mat3.apply(R, v)))
        if time >= window:
            across = so3.cross(before, total)
            if seen > 0.5 * window and so3.dot(before, before) > 0.0:
                ends[found] = i
                angles[found] = atan2(sqrt(so3.dot(across, across)), so3.dot(before, total))
                found += 1
            before = total if seen > 0.5 * window else (0.0, 0.0, 0.0)
            total = (0.0, 0.0, 0.0)
            time = seen = 0.0
    return found
