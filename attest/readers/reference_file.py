"""A reference from a second file, brought to the axes and the clock of a recording."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from attest import readers
from attest.errors import ConfigError, ReadError
from attest.geometry import frames
from attest.readers import csv, csv_layouts
from attest.readers.options import ReadOptions, without_idle
from attest.recording import Note, Recording, Reference

AXES = {
    "ned": "north-east-down and body forward-right-down",
    "enu": "z up and body forward-left-up",
}


def join(recording: Recording, name: str | None, options: ReadOptions) -> Recording:
    """Add the best reference of a file to a recording, the first of all and by the file's name.

    A reference of the recording's own wins over a file of its name.

    Raises
    ------
    ReadError
        The file cannot be read or holds no reference.
    ConfigError
        There is neither a reference nor a file of this name.
    """
    if name is None or name == "none" or name in recording.references:
        return recording
    path = Path(name)
    if not _exists(path):
        held = ", ".join(recording.references) or "none"
        raise ConfigError(
            f"{recording.path}: no reference {name!r}, and no such file. The log has: {held}."
        )
    other = _read(path, options)
    if not other.references:
        raise ReadError(f"{path}: no reference attitude in this file. Name another, or none.")
    best = next(iter(other.references.values()))
    attitude, notes = _brought(best, other, recording)
    # of the file's own notes those about the reference
    told = [replace(n, text=f"{path.name}: {n.text}") for n in other.notes if _tells(n, best)]
    return replace(
        recording,
        references={name: replace(attitude, name=path.name), **recording.references},
        notes=(*recording.notes, *told, *notes),
    )


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _read(path: Path, options: ReadOptions) -> Recording:
    if path.is_dir() and not readers.is_log(path):
        raise ReadError(f"{path}: a folder, and no log. Name the reference's file in it.")
    trajectory = path.is_file() and csv_layouts.of_trajectory(path) is not None
    told = options.csv
    mapped = told is not None and told.maps and told.reference is not None
    form = "csv" if trajectory else readers.recognise(path, mapped=mapped)
    if form == "csv":
        return csv.references(path, options)
    # the choices are those of the log, whose format may have more of them
    choices = replace(options, csv=None, units=None, axes=None, references_alone=True)
    return readers.read(path, without_idle(form, choices))


def _tells(note: Note, best: Reference) -> bool:
    return (
        "reference" in note.text
        or "axes" in note.text
        or best.name in note.text
        or note.text.startswith("layout")
    )


def _brought(
    attitude: Reference, other: Recording, recording: Recording
) -> tuple[Reference, list[Note]]:
    """Turn and shift a reference of another recording to this one."""
    name, notes = other.path.name, []
    q, t = attitude.q, attitude.t
    if other.world != recording.world:
        q = frames.bring(q)
        text = f"{name}: turned from {AXES[other.world]} to {AXES[recording.world]}"
        notes.append(Note(text))
    theirs, ours = other.clock.utc_offset, recording.clock.utc_offset
    if theirs is None or ours is None:
        which = "neither file tells" if theirs is ours else "only one file tells"
        text = f"{name}: its time taken as it stands for the log's, as {which} UTC"
        notes.append(Note(text, doubt=True))
    else:
        t = t + np.int64(theirs - ours)
        notes.append(Note(f"{name}: aligned to the log by UTC"))
    chosen = other.world if other.format == "csv" else None
    return replace(attitude, t=t, q=q, world=chosen), notes
