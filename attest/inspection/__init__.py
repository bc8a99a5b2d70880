"""Whether a log can answer: what its signals are worth, and what in them cannot be."""

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from attest.inspection import axes, figures, frames, limits, motion, place, stamps, stuck, units
from attest.inspection.clocks import in_time
from attest.inspection.turning import Fit
from attest.recording import Note, Recording

__all__ = ["command", "doubts", "in_time", "inspect"]


def doubts(recording: Recording) -> tuple[Note, ...]:
    """Return what in a log cannot be: magnitudes, axes, signs, worlds. Silent where unsure."""
    recording = _told(recording)
    with np.errstate(all="ignore"):  # a hostile log's values overflow when squared
        earth = place.find(recording)
        if (time := stamps.doubt(recording)) is not None:  # then no motion is what it seems
            return time, *units.doubts(recording, earth)
        found = axes.fits(recording)
        unit = axes.unit(recording, found)
        found = axes.felt_too(recording, found)
        return (
            *units.doubts(recording, earth),
            *limits.doubts(recording),
            *stuck.doubts(recording),
            # by a wrong unit, motion is not what it seems
            *(motion.doubts(recording) if unit is None else [unit]),
            *axes.doubts(recording, found),
            *frames.doubts(recording, earth, found),
        )


def _told(recording: Recording) -> Recording:
    """Leave out what a single sample, or none, tells nothing of."""
    signals = {name: s for name, s in recording.signals.items() if len(s.t) > 1}
    references = {name: r for name, r in recording.references.items() if len(r.t) > 1}
    return replace(recording, signals=signals, references=references)


def inspect(recording: Recording) -> dict[str, Any]:
    """Return figures of each signal, of the place and of the motion, JSON-like."""
    told = _told(recording)
    with np.errstate(all="ignore"):
        signals = {
            name: figures.of(name, signal)
            for name, signal in recording.signals.items()
            if len(signal.t)
        }
        return {"signals": signals} | _physics(told, axes.fits(told))


def _physics(recording: Recording, turns: Mapping[str, Fit]) -> dict[str, Any]:
    return {
        "earth": figures.of_earth(recording, place.find(recording)),
        "motion": motion.of(recording),
        "gyro_correction": motion.correction(recording),
        "turns_explained": {name: round(fit.as_read, 4) for name, fit in turns.items()},
    }


def command(recording: Recording, options: Iterable[str] = ()) -> str | None:
    """Return the command that runs a log, with the options that it needs; None if none does."""
    log = str(recording.path)
    words = ["attest", "run", f"./{log}" if log.startswith("-") else log, *options]
    if "gyro" not in recording.signals:
        if not any(name.removeprefix("point").isdecimal() for name in recording.signals):
            return None
        words += [] if "--observer" in words else ["--observer", "relative_fts"]
    return shlex.join(words)
