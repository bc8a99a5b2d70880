"""The recording's clock of a DataFlash log: microseconds since boot, restarts, UTC by GPS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from attest.geometry import gps as gps_time
from attest.readers import mavlink_clock as clock
from attest.readers import mavlink_restarts
from attest.readers.dataflash_format import Ints, Table
from attest.readers.dataflash_signals import Stream, fixed
from attest.readers.mavlink_clock import SECOND, Times
from attest.readers.mavlink_timeline import restarts, sound_rows
from attest.recording import Clock, Note

FIELDS = {"TimeUS": 1_000, "TimeMS": 1_000_000}
"""Nanoseconds per count of the fields that hold the time since boot."""
LONGEST_BOOT = 10 * 366 * 86_400 * SECOND
OLDEST_SAMPLE = SECOND
"""What is logged was measured at most so long before."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """How times in a log map to the recording's clock."""

    clock: Clock
    restarts: tuple[int, ...]
    times: Mapping[str, Times]
    """By label of the stream."""

    def of(self, stream: Stream, notes: list[Note]) -> tuple[Ints, Ints]:
        """Give times that advance strictly, and the rows of the table they belong to."""
        times = self.times.get(stream.label)
        if times is None:
            notes.append(Note(f"{stream.label} without a usable time dropped", len(stream.table)))
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        measured = times.moved(-_age(stream.table, times))
        return sound_rows(stream.label, measured, len(stream.table), notes)


def timeline(streams: Sequence[Stream], base: str, notes: list[Note]) -> Timeline | None:
    """Decide the clock; None where the inertial messages carry no time.

    Parameters
    ----------
    base
        Label of the inertial stream.
    """
    raw = {stream.label: _times(stream.table) for stream in streams}
    timed = {label: times for label, times in raw.items() if times is not None}
    if base not in timed or not len(timed[base].sound()):
        return None
    gps = [s for s in streams if s.message.startswith("GPS") and s.label in timed]
    sound = {label: times.sound() for label, times in timed.items() if len(times.sound())}
    parts = mavlink_restarts.segments(sound, base, _utc(gps, timed))
    timed = {label: mavlink_restarts.mapped(times, parts) for label, times in timed.items()}
    found = restarts(parts, timed[base].sound(), notes)
    utc = _utc(gps, timed)
    if utc is None:
        return Timeline(Clock("autopilot boot clock"), found, timed)
    named = Clock("autopilot boot clock, UTC by GPS", int(np.median(utc[1])))
    return Timeline(named, found, timed)


def _times(table: Table) -> Times | None:
    """Return the times since boot; None where there are none."""
    field = next((field for field in FIELDS if field in table.columns), None)
    if "T" in table.columns and field == "TimeMS":
        field = None  # an old GPS message, whose TimeMS is that of its week
    if field is None or table.columns[field].dtype.kind not in "iu":
        return None
    raw, unit = table.columns[field], FIELDS[field]
    row = np.flatnonzero((raw >= 0) & (raw <= LONGEST_BOOT // unit))
    t = raw[row].astype(np.int64) * unit
    return Times(table.at[row], t, np.zeros(len(t), np.int64), row, ~clock.not_stray(t))


def _age(table: Table, times: Times) -> Ints:
    """How long before its message each sample was measured, where the log tells."""
    none = np.zeros(len(times), np.int64)
    name = next((name for name in ("SampleUS", "S") if name in table.columns), None)
    if name is None or "TimeUS" not in table.columns or table.columns[name].dtype.kind not in "iu":
        return none
    logged = table.columns["TimeUS"][times.row].astype(np.int64)
    sampled = table.columns[name][times.row].astype(np.int64)
    age = (logged - sampled) & 0xFFFFFFFF  # S has 32 bits only
    return np.where((sampled != 0) & (age * 1_000 <= OLDEST_SAMPLE), age * 1_000, none)


def _utc(gps: Sequence[Stream], timed: Mapping[str, Times]) -> tuple[Ints, Ints] | None:
    """Place in the file, and UTC less the time since boot, of the first receiver that knows it."""
    for stream in gps:
        table, times = stream.table, timed[stream.label].sound()
        if not {"GWk", "GMS"} <= table.columns.keys() or not len(times):
            continue
        week = table.columns["GWk"][times.row].astype(np.int64)
        ms = table.columns["GMS"][times.row].astype(np.int64)
        unix = gps_time.to_unix(week, ms)
        sane = (unix > clock.SANE_UNIX) & (unix < clock.LATEST) & fixed(table)[times.row]
        if sane.any():
            return times.at[sane], (unix - times.t)[sane]
    return None
