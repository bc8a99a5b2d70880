"""ArduPilot's on-board logs: binary ``.BIN``, and the same as text, ``.log``."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import dataflash_scan, dataflash_text, gps
from attest.readers import dataflash_signals as messages
from attest.readers.dataflash_format import FMT, FMT_FORMAT, Damage, Mask, Scan, text_of
from attest.readers.dataflash_signals import ATTITUDES, Array, Stream
from attest.readers.dataflash_timeline import Timeline, timeline
from attest.readers.options import ReadOptions
from attest.readers.values import declination, parameter, usable
from attest.recording import Note, Recording, Reference, Signal

VELOCITY = ("XKF1", "NKF1", "GPS")
POSITION = ("POS", "GPS")
IDS = {"BRD_SERIAL_NUM": "serial", "SYSID_THISMAV": "system", "MAV_SYSID": "system"}
"""Parameters that number the vehicle, the surest first; zero is none."""
MOST_ID = 1e9


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 (others look at the path)
    """Whether a description of messages begins the file, or two follow each other behind junk."""
    return _binary(head) or dataflash_text.recognises(head)


def _binary(head: bytes) -> bool:
    data = np.frombuffer(head, np.uint8)
    places = dataflash_scan.marks(data)
    at = places[data[places + 2] == FMT]
    if len(at) and at[0] == 0:
        return True
    first = at[np.isin(at + FMT_FORMAT.length, at)]
    pairs = np.union1d(first, first + FMT_FORMAT.length)
    return len(dataflash_scan.definitions(data, pairs)) > 1


def read(path: Path, options: ReadOptions) -> Recording:
    """Read one log.

    Raises
    ------
    ReadError
        There is no inertial data, or not what the options ask for.
    """
    scan = _scan(path)
    notes = _damage(scan, path)
    gyros = [s for family in ("IMU", "GYR") for s in messages.streams(scan.tables, family, notes)
             if messages.measured("gyro", s.table) is not None]  # fmt: skip
    imu = _inertial_stream(path, gyros, options.imu)
    families = ("IMU", "GYR", "ACC", "MAG", "GPS", "POS", *ATTITUDES)
    found = {family: messages.streams(scan.tables, family, notes) for family in families}
    line = timeline([s for group in found.values() for s in group], imu.label, notes)
    if line is None:
        raise ReadError(f"{path}: {imu.label} carries no TimeUS. attest cannot use such a log.")
    found["GPA"] = messages.streams(scan.tables, "GPA", notes)
    log = _Log(found, line, notes)
    return Recording(
        path=path,
        format="dataflash",
        signals=_signals(log, imu, path),
        references=_references(log),
        clock=line.clock,
        vehicle=_vehicle(scan),
        vehicle_id=_vehicle_id(scan),
        declination=_declination(scan),
        restarts=line.restarts,
        notes=tuple(dict.fromkeys(notes)),
        details={
            "messages": dict(sorted(scan.counts.items())),
            "gaps": scan.damage.gaps,
            "bytes_skipped": scan.damage.bytes_skipped,
        },
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """What the parts of a reading share."""

    streams: Mapping[str, list[Stream]]
    """By family."""
    line: Timeline
    notes: list[Note]


def _scan(path: Path) -> Scan:
    with path.open("rb") as file:
        head = file.read(1 << 16)
    if _binary(head):
        return dataflash_scan.scan(path, messages.WANTED)
    return dataflash_text.scan(path, messages.WANTED)


def _damage(scan: Scan, path: Path) -> list[Note]:
    damage: Damage = scan.damage
    notes = []
    if damage.bytes_skipped:
        heavy = damage.bytes_skipped > 0.05 * path.stat().st_size
        text = f"stretches without a message skipped, {damage.bytes_skipped:,} bytes"
        notes.append(Note(text, damage.gaps, doubt=heavy))
    if damage.cut:
        notes.append(Note("the log ends within a message: left out"))
    notes += [Note(f"{name} whose format does not fit its length: not used", doubt=True)
              for name in scan.contradictory]  # fmt: skip
    return notes


def _inertial_stream(path: Path, gyros: list[Stream], wanted: str | None) -> Stream:
    """Return the stream to take the gyroscope from: the quickest, and among those the first."""
    held = {stream.label: stream for stream in gyros}
    named = {stream.message: stream for stream in reversed(gyros)} | held
    if wanted is not None and wanted not in named:
        labels = ", ".join(held) or "no inertial message"
        raise ReadError(f"{path}: no {wanted} to read. The log holds: {labels}.")
    if not gyros:
        raise ReadError(f"{path}: no IMU or GYR message, so no inertial data. Log IMU.")
    if wanted is not None:
        return named[wanted]
    most = max(len(stream.table) for stream in gyros)
    return next(stream for stream in gyros if len(stream.table) >= 0.9 * most)


def _signals(log: _Log, imu: Stream, path: Path) -> dict[str, Signal]:
    found = {"gyro": _sensor(log, imu, "gyro")}
    if found["gyro"] is None:
        raise ReadError(f"{path}: no sample of {imu.label} can be used. Choose another one.")
    same = [s for s in log.streams["ACC"] if s.instance == imu.instance]
    own = [imu] if imu.message.startswith("IMU") else same
    found["accel"] = _first(log, [*own, *log.streams["IMU"], *log.streams["ACC"]], "accel")
    found["mag"] = _first(log, sorted(log.streams["MAG"], key=lambda s: -len(s.table)), "mag")
    if found["mag"] is not None:
        log.notes.append(Note("magnetometer as the autopilot corrected it by its own offsets"))
    found["velocity"] = gps.vetted(_velocity(log), _receivers(log), log.notes)
    found["position"] = _position(log)
    return {name: signal for name, signal in found.items() if signal is not None}


def _first(log: _Log, streams: list[Stream], signal: str) -> Signal | None:
    tried = (_sensor(log, stream, signal) for stream in streams)
    return next((found for found in tried if found is not None), None)


def _sensor(log: _Log, stream: Stream, signal: str) -> Signal | None:
    values = messages.measured(signal, stream.table)
    return None if values is None else _signal(log, stream, *values, signal)


def _signal(log: _Log, stream: Stream, y: Array, held: Mask, what: str) -> Signal | None:
    """Put values on the clock; None where there are none."""
    if not held.any():
        return None
    times = log.line.of(stream, log.notes)
    t, rows = usable(f"{stream.label} {what}", times, y, held, log.notes)
    return Signal(t, np.ascontiguousarray(y[rows]), stream.label) if len(t) else None


def _velocity(log: _Log) -> Signal | None:
    for stream in (s for family in VELOCITY for s in log.streams.get(family, [])[:1]):
        values = messages.velocity(stream)
        if values is None:
            continue
        y, held = values
        if not np.any(np.nan_to_num(y[held])):
            text = f"{stream.label} with a velocity of zero throughout: not used"
            log.notes.append(Note(text))
            continue
        signal = _signal(log, stream, y, held, "velocity")
        if signal is not None:
            return signal
    return None


def _receivers(log: _Log) -> list[gps.Receiver]:
    found = []
    for stream in log.streams["GPS"]:
        same = [speed for speed in log.streams["GPA"] if speed.instance == stream.instance]
        t, rows = log.line.of(stream, log.notes)
        accuracy, fix = messages.quality(stream, next(iter(same), None))
        found.append(gps.Receiver(stream.label, t, fix[rows], accuracy[rows]))
    return found


def _position(log: _Log) -> Signal | None:
    for stream in (s for family in POSITION for s in log.streams[family][:1]):
        values = messages.position(stream)
        signal = None if values is None else _signal(log, stream, *values, "position")
        if signal is not None:
            return signal
    return None


def _references(log: _Log) -> dict[str, Reference]:
    """Return the attitudes, the best first."""
    found = {}
    ranked = sorted(ATTITUDES, key=lambda name: (ATTITUDES[name].kind != "truth",
                                                 ATTITUDES[name].rank))  # fmt: skip
    for family in ranked:
        for stream in log.streams[family]:
            values = messages.attitude(stream.table)
            if values is None:
                continue
            q, held = values
            if not held.any():
                log.notes.append(Note(f"{stream.label} without an attitude throughout: not used"))
                continue
            times = log.line.of(stream, log.notes)
            t, rows = usable(f"{stream.label} attitude", times, q, held, log.notes)
            if len(t):
                kind = ATTITUDES[family].kind
                turned = quaternion.continuous(q[rows])
                found[stream.label] = Reference(stream.label, kind, t, turned)
    return found


def _declination(scan: Scan) -> float | None:
    found = _parameters(scan)
    return declination(*found) if found else None


def _parameters(scan: Scan) -> tuple[Any, Any] | None:
    """Return the names of parameters and their values, if they are logged as such."""
    columns = scan.tables["PARM"].columns if "PARM" in scan.tables else {}
    return (columns["Name"], columns["Value"]) if {"Name", "Value"} <= columns.keys() else None


def _vehicle_id(scan: Scan) -> str | None:
    """Return the number that somebody gave the board, or else the vehicle."""
    names, values = _parameters(scan) or (np.empty(0), np.empty(0))
    for name, word in IDS.items():
        number = parameter(names, values, name)
        if number is not None and 0.0 < abs(number) < MOST_ID:
            return f"{word} {number:.0f}"
    return None


def _vehicle(scan: Scan) -> str:
    """Return the firmware's name for itself."""
    for name, column in (("VER", "FWS"), ("MSG", "Message")):
        if name in scan.tables and column in scan.tables[name].columns:
            texts = map(text_of, scan.tables[name].columns[column].tolist())
            told = next((text for text in texts if text.startswith("Ardu") or " V" in text), "")
            if told:
                return "".join(char for char in told if char.isprintable())
    return "ArduPilot"
