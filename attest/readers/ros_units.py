"""The magnetometer's unit, which drivers get wrong."""

from dataclasses import replace

import numpy as np

from attest.readers.ros_offers import Offer
from attest.recording import Note

EARTH = (1.8e-5, 7.5e-5)
"""What the Earth's field can be, tesla, with some room for a sensor's faults."""
UNITS = {"gauss": 1e-4, "µT": 1e-6, "mG": 1e-7, "nT": 1e-9}


def in_tesla(mag: Offer, notes: list[Note]) -> Offer:
    """Mend a unit where the field's strength leaves one choice, and say so."""
    finite = mag.y[np.isfinite(mag.y).all(axis=1)]
    strength = float(np.median(np.linalg.norm(finite, axis=1)))
    if EARTH[0] <= strength <= EARTH[1]:
        return mag
    for unit, factor in UNITS.items():
        if EARTH[0] <= strength * factor <= EARTH[1]:
            text = f"{mag.topic} reads {strength:.3g}, which is {unit} and no tesla: taken so"
            notes.append(Note(text, doubt=True))
            return replace(mag, y=mag.y * factor)
    text = f"{mag.topic} reads {strength:.3g}, no strength of the Earth's field: direction only"
    notes.append(Note(text, about="field strength"))
    return mag
