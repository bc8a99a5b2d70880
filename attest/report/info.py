"""What is in a log: vehicles, signals, rates, gaps, clocks, references, doubts."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest.errors import printable
from attest.recording import Note, Recording
from attest.report.worth import NAME, SOURCE, fitted, text_of_worth, width

GAP = 5
"""A gap is a step of more than this many times the median."""
UNEVEN = 0.05
"""Share by which the mean rate differs from that of the median step before it is the one told."""
MOST_REFERENCES = 12
"""Lines of the table: a tree of frames has a hundred."""
HEAD = f"{'count':>9s}{'rate':>11s}{'gaps':>6s}{'longest':>12s}"

UNITS = {
    "gyro": "rad/s",
    "accel": "m/s²",
    "mag": "T",
    "velocity": "m/s",
    "position": "deg, deg, m",
    "torque": "N·m",
}


def describe(recording: Recording) -> dict[str, Any]:
    """Return what is in a log, JSON-like."""
    clock = recording.clock
    return {
        "path": str(recording.path.resolve()),
        "format": recording.format,
        "vehicle": recording.vehicle,
        "vehicle_id": recording.vehicle_id,
        "body": recording.body,
        "world": recording.world,
        "clock": {"name": clock.name, "utc_offset_ns": clock.utc_offset},
        "duration_s": _duration(recording),
        "restarts": len(recording.restarts),
        "signals": {
            name: {"source": s.source, "unit": unit_of(name), **rhythm(s.t)}
            for name, s in recording.signals.items()
        },
        "references": {
            name: {"kind": r.kind, **rhythm(r.t)} for name, r in recording.references.items()
        },
        "details": dict(recording.details),
        **notes(recording.notes),
    }


def unit_of(name: str) -> str:
    """Return the unit of a signal by its name, or nothing."""
    return "m" if name.removeprefix("point").isdecimal() else UNITS.get(name, "")


def notes(told: tuple[Note, ...]) -> dict[str, Any]:
    """Return notes and warnings, JSON-like, in the order they were made."""
    plain = [{"text": note.text, "count": note.count} for note in told if not note.doubt]
    doubts = [{"text": note.text, "count": note.count} for note in told if note.doubt]
    return {"notes": plain, "warnings": doubts}


def rhythm(t: NDArray[np.int64]) -> dict[str, Any]:
    """Return count, rate and gaps of stamps, JSON-like."""
    if len(t) < 2:
        return {"count": len(t), "rate_hz": None, "gaps": 0, "longest_gap_s": None}
    steps = np.diff(t)
    median = float(np.median(steps))
    return {
        "count": len(t),
        "rate_hz": round(_rate(steps, median), 3),
        "gaps": int((steps > GAP * median).sum()),
        "longest_gap_s": round(float(steps.max()) * 1e-9, 6),
    }


def _rate(steps: NDArray[np.int64], median: float) -> float:
    """Return the rate of the median step, or the mean one without gaps where steps are uneven."""
    usual, mean = 1e9 / median, 1e9 / float(steps[steps <= GAP * median].mean())
    return mean if abs(mean / usual - 1.0) > UNEVEN else usual


def text_of_info(info: Mapping[str, Any]) -> str:
    """Return the description as text for a terminal."""
    clock, vehicle = info["clock"], (info["vehicle"], info["vehicle_id"])
    utc = "UTC known" if clock["utc_offset_ns"] is not None else "UTC not known"
    lines = [
        f"{shown(info['path'])}  {info['format']}, {info['duration_s']:.1f} s",
        f"  vehicle     {', '.join(filter(None, vehicle)) or 'not named'}",
        *_senders(info["details"]),
        f"  axes        body {info['body'].upper()}, world {info['world'].upper()}",
        f"  clock       {clock['name']}; {utc}; {counted(info['restarts'], 'restart')}",
        "",
        *_signals(info["signals"]),
        *text_of_worth(info),
        "",
        *_references(info["references"]),
    ]
    return "\n".join(map(printable, [*lines, *text_of_notes(info)]))


def text_of_notes(document: Mapping[str, Any]) -> list[str]:
    """Return notes and warnings as lines, with a blank one before."""
    lines = []
    for mark, key in (("!", "warnings"), ("-", "notes")):
        lines += [f"  {mark} {_with_count(note)}" for note in document[key]]
    return ["", *lines] if lines else []


def _senders(details: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line for each sender of a log that has several."""
    senders = details.get("senders", [])
    for sender in senders if len(senders) > 1 else []:
        what = str(sender["what"]).split(", system")[0]
        yield f"              {sender['id']:9s}{what}, {sender['messages']:,} messages"


def _signals(signals: Mapping[str, Any]) -> list[str]:
    """Return a table as wide as its longest names ask."""
    left, right = width(signals, NAME), width((s["source"] for s in signals.values()), SOURCE)
    lines = [f"  {'signal':{left}s}{'from':{right}s}{HEAD}  unit"]
    lines += [
        f"  {fitted(name):{left}s}{fitted(s['source']):{right}s}{_rhythm(s)}  {s['unit']}"
        for name, s in signals.items()
    ]
    return lines


def _references(references: Mapping[str, Any]) -> list[str]:
    """Return a table as wide as its longest name asks, of the first ones."""
    shown = dict(list(references.items())[:MOST_REFERENCES])
    left = width(shown, NAME)
    right = max(NAME, NAME + SOURCE - left)
    lines = [f"  {'reference':{left}s}{'kind':{right}s}{HEAD}"]
    lines += [
        f"  {fitted(name):{left}s}{r['kind']:{right}s}{_rhythm(r)}{'  (default)' if not i else ''}"
        for i, (name, r) in enumerate(shown.items())
    ]
    if not references:
        lines.append("  none: the estimate can be made, but not scored")
    if more := len(references) - len(shown):
        lines.append(f"  and {more} more, which --json has")
    return lines


def shown(path: str) -> str:
    """Return a path as people write it: relative where it lies below the working folder."""
    try:
        return printable(str(Path(path).relative_to(Path.cwd())))
    except (ValueError, OSError):  # elsewhere, or the working folder is gone
        return printable(path)


def counted(count: int, noun: str) -> str:
    """Return ``1 restart``, ``2 restarts``, ``no restart``."""
    return f"{count or 'no'} {noun}{'s' if count > 1 else ''}"


def _with_count(note: Mapping[str, Any]) -> str:
    return f"{note['text']} (×{note['count']:,})" if note["count"] != 1 else str(note["text"])


def _rhythm(s: Mapping[str, Any]) -> str:
    rate = "-" if s["rate_hz"] is None else f"{s['rate_hz']:.1f} Hz"
    longest = "-" if s["longest_gap_s"] is None else f"{s['longest_gap_s']:.3f} s"
    return f"{s['count']:>9,d}{rate:>11s}{s['gaps']:>6d}{longest:>12s}"


def _duration(recording: Recording) -> float:
    stamps = [s.t for s in recording.signals.values() if len(s.t)]
    if not stamps:
        return 0.0
    return float(max(t[-1] for t in stamps) - min(t[0] for t in stamps)) * 1e-9
