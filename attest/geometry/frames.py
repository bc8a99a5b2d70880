"""Pairs of world and body axes that logs are in, and axes that are swapped, turned or mirrored.

ned: world north-east-down, body forward-right-down
enu: world east-north-up, body forward-left-up
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from attest.geometry import quaternion

Array = NDArray[np.float64]

WORLD = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""Turns north-east-down into east-north-up, and back."""
BODY = np.array([0.0, 1.0, 0.0, 0.0])
"""Turns forward-right-down into forward-left-up, and back."""


def bring(q: Array) -> Array:
    """Bring attitudes from one of the two pairs of axes to the other."""
    return quaternion.multiply(quaternion.multiply(WORLD, q), BODY)


def signed(letters: Sequence[str]) -> Array:
    """Return the signed permutation that yields x, y, z, written such as ``y, -x, z``."""
    P = np.zeros((3, 3))
    for row, letter in enumerate(letters):
        P[row, "xyz".index(letter[-1])] = -1.0 if letter.startswith("-") else 1.0
    return P


def letters(P: Array) -> tuple[str, ...]:
    """Write x, y, z as a signed permutation yields them, such as ``y, -x, z``."""
    which = np.argmax(np.abs(P), axis=1)
    return tuple(f"{'-' if P[i, j] < 0.0 else ''}{'xyz'[j]}" for i, j in enumerate(which))
