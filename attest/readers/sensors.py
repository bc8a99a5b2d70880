"""A recording's sensors in the units and along the axes that the user tells."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.config import UNITS
from attest.geometry import frames
from attest.readers.options import ReadOptions
from attest.recording import Note, Recording, Signal


@np.errstate(over="ignore")
def as_told(recording: Recording, options: ReadOptions) -> Recording:
    """Return a recording with units and axes as they are told, and notes of what was done."""
    units, axes = options.units or {}, options.axes or {}
    held = recording.signals
    signals = dict(held)
    for name in held.keys() & units.keys():
        signals[name] = _times(signals[name], UNITS[name][units[name]] * np.eye(3))
    for name in held.keys() & axes.keys():
        signals[name] = _times(signals[name], frames.signed(axes[name]))
    # what the reader saw along other axes is looked for anew
    seen = [note for note in recording.notes if note.about != "up" or "accel" not in axes]
    details = {key: dict(told) for key, told in (("units", units), ("axes", axes)) if told}
    return replace(
        recording,
        signals=signals,
        notes=(*seen, *_unit_notes(held, units), *_axes_notes(held, axes)),
        details={**recording.details, **details},
    )


def _times(signal: Signal, matrix: NDArray[np.float64]) -> Signal:
    return replace(signal, y=np.ascontiguousarray(signal.y @ matrix.T))


def _unit_notes(held: Mapping[str, Signal], units: Mapping[str, str]) -> Iterator[Note]:
    for name, unit in units.items():
        yield (
            Note(f"{name} in {unit}, as input.unit says")
            if name in held
            else _idle(f"input.unit.{name}", name)
        )


def _axes_notes(held: Mapping[str, Signal], axes: Mapping[str, Sequence[str]]) -> Iterator[Note]:
    for name, told in axes.items():
        mirrored = np.linalg.det(frames.signed(told)) < 0.0
        text = f"{name} along ({', '.join(told)}) of its own axes, as input.axes says"
        yield (
            Note(text + (", which mirrors them" if mirrored else ""))
            if name in held
            else _idle(f"input.axes.{name}", name)
        )


def _idle(option: str, name: str) -> Note:
    return Note(f"{option} means nothing here, the log has no {name}: left out", doubt=True)
