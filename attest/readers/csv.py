"""CSV: SI columns by name, as the configuration maps them, or of a known layout.

Canonical header ``time_s, gyro_x, gyro_y, gyro_z`` (rad/s), and optionally ``accel_x`` … (m/s²),
``mag_x`` … (µT), ``ref_qw`` … (body to world), ``lat_deg, lon_deg, alt_m``, ``vel_x`` … (m/s,
world), ``torque_x`` … (N·m), ``point1_x`` … (feature points, m; these need no gyroscope) and
``<name>_x, <name>_y, <name>_z`` for any other vector in the body. Comma, semicolon or tab between
cells; lines that start with ``#`` are comments. Other columns and units by ``input.csv``.
"""

from dataclasses import replace
from pathlib import Path

from attest.errors import ReadError
from attest.readers import (
    csv_head,
    csv_layouts,
    csv_plan,
    csv_preamble,
    csv_signals,
    csv_times,
    unknown,
)
from attest.readers.csv_layouts import Known
from attest.readers.csv_plan import Plan
from attest.readers.csv_signals import Taken
from attest.readers.options import ReadOptions
from attest.recording import Clock, Note, Recording, World

UNIX = 10**18
"""Nanoseconds, the year 2001: later stamps are unix time."""


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 - the content tells, not the name
    """Whether the header names a ``time_s`` column, or is that of a known logger."""
    line, _ = csv_preamble.header(head)
    return csv_head.TIME in csv_head.fields(line.first)[0] or csv_layouts.of_log(head) is not None


def read(path: Path, options: ReadOptions) -> Recording:
    """Read the signals and the reference of one file.

    Raises
    ------
    ReadError
        The file is no CSV of a layout that is known or told, or holds no gyroscope.
    ConfigError
        The columns that the configuration tells are not there.
    """
    known = None if _maps(options) else _known(path)
    plan = _plan(path, options, known)
    if "gyro" not in plan.signals and not csv_plan.further(plan.signals):
        raise ReadError(
            f"{path}: no gyro_x, gyro_y, gyro_z, which an observer needs, in rad/s. The file has: "
            f"{unknown.listed(list(plan.layout.names))}. Rename them, or tell them {unknown.MAP}."
            if not _maps(options)
            else f"{path}: no gyroscope, which an observer needs. Name it in input.csv.gyro."
        )
    taken = csv_signals.take(path, plan)
    if "gyro" not in taken.signals and not csv_plan.further(taken.signals):
        held = plan.signals["gyro"].source if "gyro" in plan.signals else "gyro_x, gyro_y, gyro_z"
        why = csv_times.fault(path, plan) or f"no row has a time and {held}. Fill the cells."
        raise ReadError(f"{path}: {why}")
    return recording(path, plan, _with_truth(path, known, taken), options, known)


def references(path: Path, options: ReadOptions) -> Recording:
    """Read what a file has of references alone; a gyroscope is not needed.

    Raises
    ------
    ReadError
        It holds none.
    """
    known = csv_layouts.of_trajectory(path) or _known(path)
    csv = options.csv if options.csv is not None and options.csv.reference else None
    plan = replace(_plan(path, replace(options, csv=None if known else csv), known), signals={})
    taken = csv_signals.take(path, plan) if plan.references else Taken({}, {}, [], 0)
    return recording(path, plan, taken, options, known)


def recording(
    path: Path, plan: Plan, taken: Taken, options: ReadOptions, known: Known | None
) -> Recording:
    """Return what was taken as a recording on its own clock and axes."""
    notes = taken.notes
    if plan.layout.before:
        notes.append(Note("lines before the header, skipped", plan.layout.before))
    if known is None:
        world = _world(options.world, notes)
    else:
        world = options.world or known.world
        notes += csv_layouts.notes(known, world)
    if options.csv is not None and (told := options.csv.units()):
        notes.append(Note(f"units as input.csv says: {csv_plan.listed(told)}"))
    stamps = [signal.t for signal in taken.signals.values()]
    stamps += [reference.t for reference in taken.references.values()]
    start = min((int(t[0]) for t in stamps), default=0)
    return Recording(
        path=path,
        format="csv",
        signals=taken.signals,
        references=taken.references,
        clock=Clock(f"CSV {plan.clock}", 0 if start > UNIX else None),
        world=world,
        body="frd" if world == "ned" else "flu",
        notes=tuple(notes),
        details={"rows": taken.rows, "columns": list(plan.layout.names[:1000])}
        | {"units": csv_plan.units(plan), "reference_columns": csv_plan.columns(plan)}
        | ({"layout": known.name} if known else {}),
    )


def _maps(options: ReadOptions) -> bool:
    """Whether the columns are told, and not by the header."""
    return options.csv is not None and options.csv.maps


def _known(path: Path) -> Known | None:
    try:
        with path.open("rb") as file:
            return csv_layouts.of_log(file.read(csv_head.BLOCK))
    except OSError:
        return None  # which the reading will tell


def _plan(path: Path, options: ReadOptions, known: Known | None) -> Plan:
    try:
        if options.csv is not None and options.csv.maps:
            return csv_plan.mapped(path, options.csv)
        plan = csv_layouts.plan(path, known) if known else csv_plan.canonical(path)
        return plan if options.csv is None else csv_plan.amended(path, plan, options.csv)
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror or error}. Check the file.") from error


def _with_truth(path: Path, known: Known | None, taken: Taken) -> Taken:
    """Add the ground truth that a data set keeps in another file."""
    if known is None or (beside := csv_layouts.truth_beside(path)) is None:
        return taken
    truth = references(beside, ReadOptions())
    notes = [note for note in truth.notes if "axes not declared" not in note.text]
    held = Note(f"ground truth of {beside.parent.name}/{beside.name} beside the log")
    return taken._replace(
        references={**taken.references, **truth.references}, notes=[*taken.notes, held, *notes]
    )


def _world(given: World | None, notes: list[Note]) -> World:
    """Axes as declared, else north-east-down, and noted."""
    if given is not None:
        return given
    notes.append(Note("world axes not declared: north-east-down and body forward-right-down taken"))
    return "ned"
