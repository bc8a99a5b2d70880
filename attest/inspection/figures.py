"""What the values of a signal are like: range, jitter, saturation, repeats, steps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.geometry import earth as model
from attest.inspection import limits, units
from attest.inspection.place import Earth
from attest.recording import Recording, Signal

Array = NDArray[np.float64]

MOST_SAMPLES = 1_000_000
"""That figures are taken from, the first ones."""
STEP_SAMPLES = 20_000
"""That a step is taken from."""
STEP_TOLERANCE = 0.02
"""How far from a whole number of steps a difference of values may be, in steps, and how many of
them further."""
ROUNDING = 1e-9
"""Share of the greatest value that is no difference between two."""
MOST_STEPS = 50
"""Between neighbours among values that are nearly all different: more is chance."""


def of(name: str, signal: Signal) -> dict[str, Any]:
    """Return the figures of one signal, JSON-like, in its own unit."""
    t, y = signal.t[:MOST_SAMPLES], signal.y[:MOST_SAMPLES]
    same = np.all(y[1:] == y[:-1], axis=1)
    return {
        "min": y.min(axis=0).tolist(),
        "max": y.max(axis=0).tolist(),
        "median": np.median(y, axis=0).tolist(),
        "jitter_ms": _jitter(t),
        "repeated": round(float(same.mean()), 4) if len(same) else 0.0,
        "stuck_s": round(_longest(t, same), 3),
        # a course or a place has no range to leave
        "saturated": sum(map(limits.at, y.T)) if name in limits.SENSORS else 0,
        # latitude and altitude share no unit, and no step
        "step": None if name == "position" else max(map(_step, y.T), default=0.0) or None,
    }


def of_earth(recording: Recording, earth: Earth | None) -> dict[str, Any]:
    """Return gravity and field as measured, and as they should be where the place is known."""
    figures: dict[str, Any] = {}
    for name, key, scale in (("accel", "gravity_ms2", 1.0), ("mag", "field_ut", 1e6)):
        if name in recording.signals and len(recording.signals[name].t):
            lengths = units.length_of(recording.signals[name].y)
            figures[key] = float(f"{np.median(lengths) * scale:.6g}")  # a wrong unit may be tiny
    if "field_ut" in figures and recording.tells("field strength"):
        figures["field_ut"] = None  # of a direction alone
    if earth is None:
        return figures
    return figures | {
        "place": list(earth.place),
        "year": None if earth.year is None else round(earth.year, 2),
        "declination_deg": round(float(np.rad2deg(model.declination(earth.field))), 2),
        "dip_deg": round(float(np.rad2deg(model.dip(earth.field))), 2),
        "field_ut_model": round(float(np.linalg.norm(earth.field)) * 1e6, 3),
    }


def _jitter(t: NDArray[np.int64]) -> float | None:
    """Return what 90 % of the steps differ from the median by at the most, ms."""
    if len(t) < 3:
        return None
    steps = np.diff(t)
    return round(float(np.percentile(np.abs(steps - np.median(steps)), 90)) * 1e-6, 4)


def _longest(t: NDArray[np.int64], same: NDArray[np.bool_]) -> float:
    """Return the longest time without a new value, s; 0 where each sample brings one."""
    if not same.any():
        return 0.0
    new = np.flatnonzero(np.concatenate([[True], ~same]))
    last = np.append(new[1:] - 1, len(t) - 1)
    return float((t[last] - t[new]).max()) * 1e-9


def _step(x: Array) -> float:
    """Return the step that all values are a whole number of, 0 where there is none."""
    x = x[:STEP_SAMPLES]
    levels = np.unique(x)
    apart = np.diff(levels)
    apart = apart[apart > ROUNDING * np.abs(x).max()]
    if len(apart) < 2:
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    count = apart / step
    few = len(levels) < 0.5 * len(x) or count.max() < MOST_STEPS
    off = np.abs(count - np.round(count)) > STEP_TOLERANCE * np.maximum(1.0, 0.1 * count)
    return float(f"{step:.6g}") if few and off.mean() < STEP_TOLERANCE else 0.0
