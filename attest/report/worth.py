"""What the signals of a log are worth, as text: values, physics, motion, the command to run."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from attest.geometry.earth import GRAVITY

TOGETHER = 0.5
"""Share of a vector's motion that the gyroscope explains, from which the two agree."""
NAMES = {"mag": "magnetometer", "accel": "accelerometer", "reference": "reference"}
NAME, SOURCE = 12, 24
"""Usual widths of columns."""
WIDEST = 40
"""Characters of a name that fit a table; the whole is in the JSON."""


def fitted(text: str) -> str:
    """Shorten a name to what fits a table."""
    return text if len(text) <= WIDEST else f"{text[: WIDEST - 1]}…"


def width(texts: Iterable[str], least: int) -> int:
    """Return how wide a column for some names is, with what parts it from the next."""
    return max([least, *(len(fitted(text)) + 2 for text in texts)])


def text_of_worth(info: Mapping[str, Any]) -> list[str]:
    """Return what an inspection adds to a description, as lines; none without one."""
    if "earth" not in info:
        return []
    signals = {name: s for name, s in info["signals"].items() if "min" in s}
    wide = width(signals, NAME)
    head = f"  {'values':{wide}s}{'jitter p90':>12s}{'repeated':>10s}{'stuck':>9s}{'at limit':>10s}"
    lines = ["", f"{head}{'step':>11s}  range of each axis"]
    lines += [f"  {fitted(name):{wide}s}{_values(signal)}" for name, signal in signals.items()]
    return [*lines, "", *(f"  {name:12s}{text}" for name, text in _physics(info))]


def _values(s: Mapping[str, Any]) -> str:
    jitter = "-" if s["jitter_ms"] is None else f"{s['jitter_ms']:.3g} ms"
    stuck = f"{s['stuck_s']:.2f} s" if s["stuck_s"] else "-"
    step = "-" if s["step"] is None else f"{s['step']:.3g}"
    ranges = ", ".join(_range(low, high) for low, high in zip(s["min"], s["max"], strict=True))
    return (
        f"{jitter:>12s}{s['repeated']:>10.1%}{stuck:>9s}{s['saturated'] or '-':>10}"
        f"{step:>11s}  {ranges}"
    )


def _range(low: float, high: float) -> str:
    """Write a range with as many digits as tell its ends apart."""
    digits = 3
    if high > low:
        digits += max(0, int(np.log10(max(abs(low), abs(high)) / (high - low))))
    digits = min(digits, 9)
    return f"{low:.{digits}g} … {high:.{digits}g}"


def _physics(info: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    earth, motion = info["earth"], info["motion"]
    if "gravity_ms2" in earth:
        yield (
            "gravity",
            f"{earth['gravity_ms2']:.2f} m/s² in the median, {GRAVITY:.2f} m/s² expected",
        )
    if "field_ut" in earth:
        yield "field", _field(earth)
    if "place" in earth:
        yield "place", _place(earth)
    if info["turns_explained"]:
        yield "turns", _turns(info["turns_explained"])
    if motion is not None:
        yield "motion", _motion(motion)
    if info["gyro_correction"] is not None:
        yield "gyroscope", str(info["gyro_correction"])
    if info["command"] is None:
        yield "to run", "nothing: it has neither a gyroscope nor feature points"
    else:
        yield "to run", str(info["command"])


def _turns(explained: Mapping[str, float]) -> str:
    """Tell which vectors turn in the body as the gyroscope says, and which do not."""
    told = {name: f"{NAMES[name]} ({max(0.0, x):.0%})" for name, x in explained.items()}
    if "accel" in told and explained["accel"] < TOGETHER:
        told["accel"] = told["accel"][:-1] + ", usual at rest or when accelerating)"
    agree = ", ".join(told[name] for name, x in explained.items() if x >= TOGETHER)
    others = ", ".join(told[name] for name, x in explained.items() if x < TOGETHER)
    parts = [f"as the gyroscope says: {agree}"] if agree else []
    if others:
        parts.append(f"not as the gyroscope says: {others}")
    return "; ".join(parts)


def _field(earth: Mapping[str, Any]) -> str:
    known = "place" in earth
    strength = f"{earth['field_ut_model']:.1f}" if known else "22-67"
    whose = "by the model" if known else "on Earth"
    if earth["field_ut"] is None:
        return f"direction only: its strength is not the Earth's ({strength} µT {whose})"
    return f"{earth['field_ut']:.4g} µT in the median, {strength} {whose}"


def _place(earth: Mapping[str, Any]) -> str:
    latitude, longitude, altitude = earth["place"]
    when = "at no known date" if earth["year"] is None else f"in {earth['year']:.1f}"
    return (
        f"{latitude:.4f}, {longitude:.4f}, {altitude:.0f} m {when}: declination "
        f"{earth['declination_deg']:+.1f}°, dip {earth['dip_deg']:+.1f}°"
    )


def _motion(motion: Mapping[str, Any]) -> str:
    edge = motion["edge_of_band"]
    rate = motion["rate_hz"]
    verdict = {
        True: "the gyroscope is fast enough for it",
        False: "the gyroscope is TOO SLOW for it",
        None: f"at {rate:.2g} Hz the gyroscope cannot see motion faster than {0.5 * rate:.2g} Hz",
    }[motion["fast_enough"]]
    text = (
        f"{verdict}: up to {motion['fastest_rad_s']:.2f} rad/s, "
        f"{motion['large_steps']:.1%} of steps over 0.1 rad"
    )
    return text if edge is None else f"{text}, {edge:.1%} of power at the band's edge"
