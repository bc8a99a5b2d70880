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


def turned(
    h: Array,
    D: Array,
    unit: Array,
    valid: Mask,
    restart: Mask,
    *,
    aided: bool,
    most: float | Array = SUDDEN,
) -> list[Note]:
    """Say where a field turns by more than most, rad, a number or (n,); the rest as for `turns`.

    Where the log's velocity aids the accelerometer, what it should measure turns with heading.
    """
    angles = turns(h, D, unit, valid, restart, WINDOW)
    sudden = np.flatnonzero(angles > most)
    if not len(sudden):
        return []
    at, angle = np.cumsum(h)[sudden[0]], np.rad2deg(angles[sudden].max())
    text = (
        f"the field turns against the gyroscope, by up to {angle:.0f}° from one {WINDOW:g} s to "
        f"the next, first at {at:.0f} s: disturbed, stuck or late; heading is doubtful since"
    )
    tilt = ", and tilt where it accelerates" if aided else ""
    return [Note(text + tilt, len(sudden), doubt=True)]


@kernel
def turns(h: Array, D: Array, unit: Array, valid: Mask, restart: Mask, window: float) -> Array:
    """Return the angles between a direction's means over one window and the next, in the frame.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    D : shape (n, 4)
        Frame of the gyroscope, body to frame.
    unit, valid : shape (n, 3) and (n,)
        Unit vectors in the body, and where they are measured.
    window
        Length of a window, s; one that is measured in less than half of it has no mean.

    Returns
    -------
    angles : shape (n,)
        At the end of each window, rad; zero elsewhere.
    """
    angles = np.zeros(len(unit))
    before = total = (0.0, 0.0, 0.0)
    time = seen = 0.0
    for i in range(len(unit)):
        if restart[i]:
            before = total = (0.0, 0.0, 0.0)
            time = seen = 0.0
        time += h[i]
        if valid[i]:
            seen += h[i]
            R = so3.matrix(so3.row4(D, i))
            total = so3.add(total, so3.scale(h[i], mat3.apply(R, so3.row(unit, i))))
        if time >= window:
            across = so3.cross(before, total)
            if seen > 0.5 * window and so3.dot(before, before) > 0.0:
                angles[i] = atan2(sqrt(so3.dot(across, across)), so3.dot(before, total))
            before = total if seen > 0.5 * window else (0.0, 0.0, 0.0)
            total = (0.0, 0.0, 0.0)
            time = seen = 0.0
    return angles
