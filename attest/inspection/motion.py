"""Whether the gyroscope is fast enough for the motion in it, and what was done to it before."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.recording import Note, Recording, Signal

Array = NDArray[np.float64]

LARGE_STEP = 0.1
"""Turn between two samples, rad, from which its axis within the step matters: 0.1^3 / 12 is 0.005
degrees of a step of motion that the samples cannot tell."""
BAND = 0.8
"""Share of the Nyquist frequency above which power is at the band's edge."""
MOST_STEPS = 50_000
"""That turns are taken from, spread over the log."""
SEGMENT = 256
"""Samples of one spectrum."""
MOST_SEGMENTS = 100
EDGE = 0.15
"""Share of the power at the band's edge from which motion goes on beyond it; white noise has 0.2,
so that the power must also be more than a gyroscope's noise."""
NOISE = 0.05
"""rad/s of standard deviation, above what a gyroscope's noise is."""
SLOW = 20.0
"""Hz; below, a vehicle that turns at all turns between the samples."""
OFTEN = 0.01
"""Share of steps with a large turn from which the gyroscope is slow for its motion."""


CORRECTIONS = {
    "HIGHRES_IMU": "less the bias that the autopilot estimated in flight (as PX4 sends it)",
    "RAW_IMU": "calibrated at start, the bias in flight is in it",
    "SCALED_IMU": "calibrated at start, the bias in flight is in it",
    "SCALED_IMU2": "calibrated at start, the bias in flight is in it",
    "SCALED_IMU3": "calibrated at start, the bias in flight is in it",
    "IMU": "calibrated at start, the bias in flight is in it",
    "sensor_combined": "by the autopilot's stored calibration, the bias in flight is in it",
    "vehicle_imu": "by the autopilot's stored calibration, the bias in flight is in it",
    "sensor_gyro": "raw",
    "sensor_gyro_fifo": "raw",
}
"""By message or topic."""


def of(recording: Recording) -> dict[str, Any] | None:
    """Return how the gyroscope's rate suits its motion, JSON-like; None without one.

    Whether it is fast enough is None where its samples cannot tell.
    """
    gyro = recording.signals.get("gyro")
    if gyro is None or len(gyro.t) < 3:
        return None
    some = np.arange(0, len(gyro.t) - 1, -(-len(gyro.t) // MOST_STEPS))
    steps, y = gyro.t[some + 1] - gyro.t[some], gyro.y[some]
    h = np.minimum(steps, 5 * np.median(steps)) * 1e-9  # a gap is told as such
    turn = np.linalg.norm(y, axis=1) * h
    spread = float(np.linalg.norm(y.std(axis=0)))
    large, edge = float(np.mean(turn > LARGE_STEP)), _edge(gyro)
    rate = 1e9 / float(np.median(steps))
    slow = large > OFTEN or (spread > NOISE and (rate < SLOW or (edge or 0.0) > EDGE))
    return {
        "rate_hz": round(rate, 3),
        "fastest_rad_s": round(float(np.percentile(turn / np.maximum(h, 1e-9), 99.9)), 4),
        "turn_per_step_rad_p99": round(float(np.percentile(turn, 99)), 5),
        "large_steps": round(large, 4),
        "edge_of_band": None if edge is None else round(edge, 4),
        # what a slow gyroscope does not see may be there all the same
        "fast_enough": False if slow else True if rate >= SLOW else None,
    }


def doubts(recording: Recording) -> Iterator[Note]:
    """Yield that the gyroscope is too slow for the motion in it."""
    figures = of(recording)
    if figures is not None and figures["fast_enough"] is False:
        yield Note(f"the gyroscope is too slow for the motion in it: {_why(figures)}", doubt=True)


def _why(figures: Mapping[str, Any]) -> str:
    if figures["large_steps"] > OFTEN:
        return f"{figures['large_steps']:.1%} of its steps turn over {LARGE_STEP:g} rad"
    if (figures["edge_of_band"] or 0.0) > EDGE:
        return f"{figures['edge_of_band']:.1%} of its power is at the band's edge"
    return f"it turns, and is below {SLOW:g} Hz"


def _edge(gyro: Signal) -> float | None:
    """Return the share of the power in the uppermost fifth of the band; None if too short."""
    count = len(gyro.t) // SEGMENT
    if not count:
        return None
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_SEGMENTS)).astype(np.int64))
    parts = gyro.y[: count * SEGMENT].reshape(count, SEGMENT, 3)[chosen]
    window = np.hanning(SEGMENT)[:, np.newaxis]
    power = np.abs(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window, axis=1)) ** 2
    spectrum = power.sum(axis=(0, 2))
    total = float(spectrum.sum())
    first = int(BAND * (len(spectrum) - 1))
    return float(spectrum[first:].sum()) / total if total > 0.0 else None


def correction(recording: Recording) -> str | None:
    """Tell in words whether a gyroscope's bias was taken out before it was logged."""
    if "gyro" not in recording.signals:
        return None
    source = recording.signals["gyro"].source.partition("[")[0]
    return CORRECTIONS.get(source)
