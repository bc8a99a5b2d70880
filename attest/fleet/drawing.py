"""A series as a drawing in a page: flights in time, their level, changes and odd ones."""

from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.fleet.words import day, value

Array = NDArray[np.float64]

WIDTH, HEIGHT, LEFT, RIGHT, TOP, FOOT = 600, 190, 64, 14, 10, 24
MOST = 600
"""Flights that are drawn; of more, some at even distances."""
ROOM = 0.15
"""Above and below, as a share of what is shown."""
STYLE = """
svg .flight { fill: var(--mark); fill-opacity: .75 }
svg .odd { fill: none; stroke: var(--alert); stroke-width: 1.5 }
svg .level { fill: none; stroke: var(--ink); stroke-width: 1.5 }
svg .change { stroke: var(--alert); stroke-dasharray: 4 3 }
svg .grid { stroke: var(--line) }
svg text.date { fill: var(--alert) }
"""


class _Frame:
    """Where times and values are in a drawing."""

    def __init__(self, t: Array, x: Array, level: Array) -> None:
        shown = np.concatenate([np.percentile(x, [2.0, 98.0]), level])
        low, high = float(shown.min()), float(shown.max())
        room = ROOM * (high - low) or abs(high) * ROOM or 1.0
        self.low, self.high = low - room, high + room
        self.first, self.last = float(t[0]), max(float(t[-1]), float(t[0]) + 1.0)

    def across(self, t: float) -> float:
        """Return where a time is; outside of the flights, at the edge."""
        share = (t - self.first) / (self.last - self.first)
        return LEFT + min(max(share, 0.0), 1.0) * (WIDTH - LEFT - RIGHT)

    def down(self, x: float) -> float:
        """Return where a value is; what is far out, at the edge."""
        share = (x - self.low) / (self.high - self.low)
        return HEIGHT - FOOT - min(max(share, 0.0), 1.0) * (HEIGHT - TOP - FOOT)


def drawing(one: Mapping[str, Any]) -> str:
    """Return SVG of a series with points."""
    t, x, level = np.array(one["points"], float).T
    frame = _Frame(t, x, level)
    chosen = np.unique(np.linspace(0, len(t) - 1, min(len(t), MOST)).astype(int))
    flights = "".join(
        f'<circle class="flight" cx="{frame.across(t[i]):.1f}" cy="{frame.down(x[i]):.1f}" r="3">'
        f"<title>{_date(t[i])}: {value(one, x[i], unit=True)}</title></circle>"
        for i in chosen
    )
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">'
        f"{_axes(one, frame)}{flights}{_odd(one, frame)}{_level(t, level, frame)}"
        f"{_changes(one, frame)}</svg>"
    )


def _axes(one: Mapping[str, Any], frame: _Frame) -> str:
    """Return lines at round values, and days below."""
    parts = []
    for tick in _round(frame.low, frame.high):
        y = frame.down(tick)
        parts.append(
            f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.6g}</text>'
        )
    ends = (("start", frame.first), ("middle", 0.5 * (frame.first + frame.last)))
    for anchor, t in (*ends, ("end", frame.last)):
        at = f'x="{frame.across(t):.1f}" y="{HEIGHT - 6}" text-anchor="{anchor}"'
        parts.append(f"<text {at}>{_date(t)}</text>")
    parts.append(f'<text x="4" y="{TOP + 4}">{escape(one["unit"])}</text>')
    return "".join(parts)


def _round(low: float, high: float) -> list[float]:
    """Return about four round values between two."""
    step = 10.0 ** np.floor(np.log10(high - low))
    step *= next(s for s in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if (high - low) / (s * step) <= 4.5)
    ticks = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0)
    return [float(round(tick, 12)) + 0.0 for tick in ticks]


def _level(t: Array, level: Array, frame: _Frame) -> str:
    """Return the level, broken where it steps."""
    steps = np.flatnonzero(np.diff(level) != 0.0) + 1
    if len(steps) > 0.5 * len(t):  # a drift
        steps = steps[:0]
    parts = zip(np.split(t, steps), np.split(level, steps), strict=True)
    lines = [
        f"M{frame.across(part[0]):.1f} {frame.down(at[0]):.1f}"
        f"L{frame.across(part[-1]):.1f} {frame.down(at[-1]):.1f}"
        for part, at in parts
    ]
    return f'<path class="level" d="{"".join(lines)}"/>'


def _changes(one: Mapping[str, Any], frame: _Frame) -> str:
    """Return a line at each step, with the day beside it."""
    parts = []
    for change in one["changes"]:
        if change["kind"] == "drift":
            continue
        after, by = (datetime.fromisoformat(change[key]) for key in ("after_utc", "by_utc"))
        x = frame.across(0.5 * (after.timestamp() + by.timestamp()))
        anchor, beside = ("start", 4) if x < 0.8 * WIDTH else ("end", -4)
        parts.append(
            f'<line class="change" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - FOOT}"/>'
            f'<text class="date" x="{x + beside:.1f}" y="{TOP + 8}" text-anchor="{anchor}">'
            f"{day(change['by_utc'])}</text>"
        )
    return "".join(parts)


def _odd(one: Mapping[str, Any], frame: _Frame) -> str:
    return "".join(
        f'<circle class="odd" cx="{frame.across(_time(flight["utc"])):.1f}" '
        f'cy="{frame.down(flight["value"]):.1f}" r="6">'
        f"<title>{day(flight['utc'])}: {value(one, flight['value'], unit=True)}</title></circle>"
        for flight in one["odd"]
    )


def _time(utc: str) -> float:
    return datetime.fromisoformat(utc).timestamp()


def _date(t: float) -> str:
    return datetime.fromtimestamp(float(t), UTC).date().isoformat()
