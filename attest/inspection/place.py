"""Where and when a log was made, and what the Earth's field should be there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.geometry import earth
from attest.recording import Recording

GUESSED_YEAR = 2025.0
"""For a log that knows no date: the field's strength changes little within decades."""


@dataclass(frozen=True, slots=True, eq=False)
class Earth:
    """The Earth at the log's place and date."""

    place: earth.Place
    year: float | None
    """None where the log knows no date."""
    field: NDArray[np.float64]
    """World Magnetic Model, north-east-down, tesla, shape (3,)."""


def find(recording: Recording) -> Earth | None:
    """Return place, date and field; None where the log knows no place on Earth."""
    if "position" not in recording.signals:
        return None
    position = recording.signals["position"]
    place = earth.place(position.y)
    if place is None:
        return None
    offset = recording.clock.utc_offset
    year = None if offset is None else earth.year(int(position.t[0]) + offset)
    return Earth(place, year, earth.field(place, year or GUESSED_YEAR))
