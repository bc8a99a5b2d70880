"""A series as a drawing in a page: flights in time, their level, changes and odd ones."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.fleet.words import day, value

Array = NDArray[np.float64]

WIDTH, HEIGHT, LEFT, RIGHT, TOP, FOOT = 600, 176, 64, 14, 6, 24
"""Of the drawing, without the lines of dates above it."""
LINE, CHARACTER, APART = 13, 6.2, 8
"""Height of a line of text, width of a character, and what is left between two texts."""
MOST = 600
"""Flights that are drawn; of more, some at even distances, and the farthest."""
MOST_FAR = 60
ROOM = 0.15
"""Above and below, as a share of what is shown."""
STYLE = """
svg .flight { fill: var(--mark); fill-opacity: .75 }
svg .odd { fill: none; stroke: var(--alert); stroke-width: 1.5 }
svg .level { fill: none; stroke: var(--ink); stroke-width: 1.5 }
svg .change { stroke: var(--alert); stroke-dasharray: 4 3 }
svg .grid { stroke: var(--line) }
svg text.date { fill: var(--alert) }
svg text.far { fill: var(--ink) }
"""


class _Frame:
    """Where times and values are in a drawing."""

    def __init__(self, t: Array, x: Array, level: Array, lines: int) -> None:
        self.top = TOP + LINE * lines
        self.foot = HEIGHT - FOOT + LINE * lines
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
        return self.foot - min(max(share, 0.0), 1.0) * (self.foot - self.top)

    def holds(self, x: Array) -> NDArray[np.bool_]:
        """Tell which values are not far out."""
        return (x >= self.low) & (x <= self.high)


def drawing(one: Mapping[str, Any]) -> str:
    """Return SVG of a series with points."""
    t, x, level = np.array(one["points"], float).T
    steps = [change for change in one["changes"] if change["kind"] == "step"]
    dates = _stacked([(_Frame(t, x, level, 0).across(_between(step)), step) for step in steps])
    frame = _Frame(t, x, level, max((line for *_, line in dates), default=0) + 1)
    height = frame.foot + FOOT
    return (
        f'<svg width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}" role="img">'
        f"{_axes(one, frame)}{_flights(one, t, x, level, frame)}{_odd(one, frame)}"
        f"{_level(t, level, frame)}{_changes(dates, frame)}</svg>"
    )


def _flights(one: Mapping[str, Any], t: Array, x: Array, level: Array, frame: _Frame) -> str:
    """Return a point for each flight, and for one that is far out an arrow with its value."""
    far = np.flatnonzero(~frame.holds(x))
    far = np.sort(far[np.argsort(-np.abs(x - level)[far], kind="stable")[:MOST_FAR]])
    even = np.linspace(0, len(t) - 1, min(len(t), MOST)).astype(int)
    near = np.unique(even[frame.holds(x[even])])
    return "".join(
        f'<circle class="flight" cx="{frame.across(t[i]):.1f}" cy="{frame.down(x[i]):.1f}" r="3">'
        f"{_title(one, t[i], x[i])}</circle>"
        for i in near
    ) + "".join(_arrows(one, t[far], x[far], frame))


def _arrows(one: Mapping[str, Any], t: Array, x: Array, frame: _Frame) -> Iterator[str]:
    """Yield an arrow for each flight beyond the edge, and its value where there is room for it."""
    free = {True: 0.0, False: 0.0}
    for at, number in zip(t.tolist(), x.tolist(), strict=True):
        above = number > frame.high
        across, edge, back = frame.across(at), frame.down(number), 7 if above else -7
        yield (
            f'<path class="flight" d="M{across:.1f} {edge - 0.5 * back:.1f}l4 {back}h-8z">'
            f"{_title(one, at, number)}</path>"
        )
        text = value(one, number)
        begin, end = _beside(across, text, 10)
        if begin >= free[above]:
            free[above] = end + APART
            y = edge + (LINE if above else -5)
            yield f'<text class="far" x="{begin:.1f}" y="{y:.1f}">{escape(text)}</text>'


def _title(one: Mapping[str, Any], t: float, x: float) -> str:
    return f"<title>{_date(t)}: {escape(value(one, x, unit=True))}</title>"


def _beside(x: float, text: str, apart: float) -> tuple[float, float]:
    """Return where a text beside a place begins and ends: to the left near the right edge."""
    width = CHARACTER * len(text)
    begin = x + apart if x + apart + width < WIDTH else x - apart - width
    return begin, begin + width


def _between(step: Mapping[str, Any]) -> float:
    """Return the time in the midst of the flights before and after a step."""
    return 0.5 * (_time(step["after_utc"]) + _time(step["by_utc"]))


def _stacked(
    steps: Sequence[tuple[float, Mapping[str, Any]]],
) -> list[tuple[float, str, float, int]]:
    """Return where each step is, its day, and where that begins, in a line with room for it."""
    ends: list[float] = []
    found = []
    for x, step in steps:
        text = day(step["by_utc"])
        begin, end = _beside(x, text, 4)
        line = next((i for i, taken in enumerate(ends) if begin >= taken), len(ends))
        ends[line:] = [end + APART, *ends[line + 1 :]]
        found.append((x, text, begin, line))
    return found


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
        at = f'x="{frame.across(t):.1f}" y="{frame.foot + FOOT - 6}" text-anchor="{anchor}"'
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


def _changes(dates: Sequence[tuple[float, str, float, int]], frame: _Frame) -> str:
    """Return a line at each step, with the day above the flights."""
    return "".join(
        f'<line class="change" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP + LINE * line}" '
        f'y2="{frame.foot}"/>'
        f'<text class="date" x="{begin:.1f}" y="{TOP + LINE * line + 8}">{text}</text>'
        for x, text, begin, line in dates
    )


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
