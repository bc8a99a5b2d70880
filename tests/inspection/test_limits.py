"""Sensors at the end of their range, and what only looks like it."""

from dataclasses import replace

import numpy as np
from flights import flight, tumbling

from attest import inspection
from attest.recording import Signal


def told(log):
    """Return the texts of what is doubted."""
    return [note.text for note in inspection.doubts(log)]


def cut(log, name, share, held=1):
    """Return a log with a signal cut off beyond a share of its range, each value logged again."""
    signal = log.signals[name]
    middle, half = np.median(signal.y, axis=0), share * np.ptp(signal.y, axis=0) / 2.0
    y = np.clip(signal.y, middle - half, middle + half)[np.arange(len(signal.t)) // held * held]
    return replace(log, signals={**log.signals, name: Signal(signal.t, y, signal.source)})


def test_a_sensor_at_the_end_of_its_range_is_told(log):
    for name, what in (("gyro", "gyroscope"), ("accel", "accelerometer"), ("mag", "magnetometer")):
        texts = told(cut(log, name, 0.4))
        assert any(f"the {what} is cut off, " in text for text in texts)
        assert not any("is cut off" in text for text in told(cut(log, name, 2.0)))


def test_what_only_looks_like_a_limit_is_none():
    rng = np.random.default_rng(2)
    log = flight(lambda s: tumbling(np.minimum(s, 15.0)))
    for name in ("gyro", "accel", "mag"):
        y = log.signals[name].y
        noisy = y + 1e-3 * np.abs(y).max() * rng.normal(size=y.shape)
        steps = np.abs(y).max() / 40.0
        for wrong in (
            np.round(noisy / steps) * steps,
            np.repeat(noisy[::20], 20, axis=0)[: len(y)],
            np.zeros_like(y),
        ):
            signals = {**log.signals, name: Signal(log.signals[name].t, wrong)}
            texts = told(replace(log, signals=signals))
            assert not any("is cut off" in text for text in texts)


def test_a_place_and_a_course_have_no_limit(log):
    for name in ("position", "velocity"):
        if name in log.signals:
            stopped = cut(log, name, 0.4)
            assert inspection.inspect(stopped)["signals"][name]["saturated"] == 0
            assert not any("is cut off" in text for text in told(stopped))
