"""Doubts of a CSV's unit of time."""

from dataclasses import replace

import numpy as np
import pytest
from flights import flight

from attest import inspection
from attest.recording import Signal


def paced(step, unit="s", form="csv"):
    """Return the doubts of a flight whose gyroscope has these steps, s."""
    made = flight()
    gyro = made.signals["gyro"]
    t = np.rint(np.arange(len(gyro.t)) * step * 1e9).astype(np.int64)
    log = replace(
        made, format=form, signals={"gyro": Signal(t, gyro.y)}, details={"units": {"time": unit}}
    )
    return [note.text for note in inspection.doubts(log)]


@pytest.mark.parametrize(
    ("step", "unit", "text"),
    [
        (10.0, "s", "has 0.1 Hz: its times seem to be in ms, not s"),
        (1.0, "s", "has 1 Hz: its times seem to be in ms, not s"),
        (1e4, "s", "has 0.0001 Hz: its times seem to be in us, not s"),
        (1e-5, "ms", "has 1e+05 Hz: its times seem to be in s, not ms"),
        (1e-5, "us", "has 1e+05 Hz: its times seem to be in ms, not us"),
    ],
)
def test_a_rate_that_cannot_be_doubts_the_unit_of_time(step, unit, text):
    right = text.partition(" in ")[2].partition(",")[0]
    assert paced(step, unit) == [f"the gyroscope {text}: --set input.csv.time.unit={right}"]


def test_a_rate_that_can_be_is_not_doubted():
    for step in (0.5, 0.01, 0.0001):
        assert not any("its times" in text for text in paced(step))
    assert not any("its times" in text for text in paced(10.0, form="tlog"))
