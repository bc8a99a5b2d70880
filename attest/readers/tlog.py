"""MAVLink telemetry logs: ``.tlog``, and raw streams of the same frames."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import gps, mavlink_frames, mavlink_scan, mavlink_vehicle
from attest.readers import mavlink_signals as messages
from attest.readers.mavlink import V2, Ints
from attest.readers.mavlink_scan import Scan, Table
from attest.readers.mavlink_signals import ATTITUDES, INERTIAL
from attest.readers.mavlink_timeline import NOW, Timeline, timeline
from attest.readers.mavlink_vehicle import ARDUPILOT, Sender
from attest.readers.options import ReadOptions
from attest.readers.values import declination
from attest.recording import Note, Recording, Reference, Signal

VELOCITY = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
POSITION = ("GLOBAL_POSITION_INT", "GPS_RAW_INT")
RECEIVERS = ("GPS_RAW_INT", "GPS2_RAW")
WANTED = {*INERTIAL, *ATTITUDES, *NOW, *VELOCITY, *POSITION, *RECEIVERS, "SYSTEM_TIME",
          "HEARTBEAT", "PARAM_VALUE", "AUTOPILOT_VERSION"}  # fmt: skip


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 (others look at the path)
    """Whether frames with right checksums lie in the first bytes, be it behind junk."""
    buffer = np.frombuffer(head, np.uint8)
    frames = mavlink_frames.checked_frames(buffer)
    if not len(frames):
        return False
    # two bytes of checksum and one of message id are right by chance now and then
    return int(frames.at[0]) in (0, 8) or len(frames) > 1 or bool(buffer[frames.at[0]] == V2)


def read(path: Path, options: ReadOptions) -> Recording:
    """Read one vehicle's messages.

    Raises
    ------
    ReadError
        There is no inertial data, or not what the options ask for.
    """
    scan = mavlink_scan.scan(path, WANTED)
    notes = _damage(scan, path)
    senders = mavlink_vehicle.senders(scan)
    vehicle = mavlink_vehicle.choose(path, senders, options.vehicle, notes)
    own = _sent_by(scan.tables, vehicle.number)
    imu = _inertial_message(path, own, options.imu)
    line = timeline(own, imu, scan.stamped, notes)
    if line is None:
        raise ReadError(f"{path}: no message carries a time. attest cannot use such a log.")
    log = _Log(scan, vehicle, own, line, notes)
    return Recording(
        path=path,
        format="tlog",
        signals=_signals(log, imu, path),
        references=_references(log),
        clock=line.clock,
        vehicle=str(vehicle),
        vehicle_id=_vehicle_id(own),
        declination=_declination(own),
        restarts=line.restarts,
        notes=_counted(notes),
        details=_details(scan, senders, vehicle),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """What the parts of a reading share."""

    scan: Scan
    vehicle: Sender
    own: Mapping[str, Table]
    """The vehicle's messages."""
    line: Timeline
    notes: list[Note]


def _sent_by(tables: Mapping[str, Table], sender: int) -> dict[str, Table]:
    mine = {name: table.sender == sender for name, table in tables.items()}
    return {
        name: tables[name] if rows.all() else tables[name][rows]
        for name, rows in mine.items()
        if rows.any()
    }


def _damage(scan: Scan, path: Path) -> list[Note]:
    damage, notes = scan.damage, []
    if damage.bytes_skipped:
        heavy = damage.bytes_skipped > 0.05 * path.stat().st_size
        text = f"bad frames skipped, {damage.bytes_skipped:,} bytes"
        notes.append(Note(text, damage.bad_frames, doubt=heavy))
    if damage.unknown_frames:
        notes.append(Note("frames of unknown messages skipped", damage.unknown_frames))
    return notes


def _inertial_message(path: Path, own: Mapping[str, Table], wanted: str | None) -> str:
    """Return the message to take gyro and accelerometer from: by rate, then completeness."""
    held = [name for name in INERTIAL if name in own]
    if wanted is not None:
        if wanted not in held:
            raise ReadError(f"{path}: no {wanted} to read. The log holds: {', '.join(held)}.")
        return wanted
    samples = {name: _samples(name, own[name], "gyro") for name in held}
    complete = {name: samples[name] * (_samples(name, own[name], "accel") > 0) for name in held}
    most = max(complete.values()) or max(samples.values())
    quick = [name for name in held if (complete[name] or samples[name]) >= 0.9 * most]
    with_mag = [name for name in quick if _samples(name, own[name], "mag")]
    return (with_mag or quick)[0]


def _samples(name: str, table: Table, signal: str) -> int:
    return int(messages.inertial(name, table.rows, signal)[1].sum())


def _signals(log: _Log, imu: str, path: Path) -> dict[str, Signal]:
    own, notes = log.own, log.notes
    found = {"gyro": _inertial(log, imu, "gyro"), "accel": _inertial(log, imu, "accel")}
    found["mag"] = _magnetometer(log, imu)
    if found["gyro"] is None:
        raise ReadError(f"{path}: no gyroscope sample in {imu} can be used. Choose another one.")
    if imu == "RAW_IMU" and log.vehicle.autopilot not in (None, ARDUPILOT):
        notes.append(Note("RAW_IMU read in ArduPilot's units, but another autopilot sent it: "
                          "it may hold raw counts", doubt=True))  # fmt: skip
    found["velocity"] = gps.vetted(_velocity(log), _receivers(log), notes)
    for name in POSITION:
        if name in own and found.get("position") is None:
            found["position"] = _signal(log, name, *messages.position(name, own[name].rows))
    return {name: signal for name, signal in found.items() if signal is not None}


def _inertial(log: _Log, name: str, signal: str) -> Signal | None:
    y, held = messages.inertial(name, log.own[name].rows, signal)
    return _signal(log, name, y, held, signal)


def _magnetometer(log: _Log, imu: str) -> Signal | None:
    held = [name for name in INERTIAL if name in log.own]
    rest = sorted(held, key=lambda name: -_samples(name, log.own[name], "mag"))
    for name in [imu, *rest]:
        if (signal := _inertial(log, name, "mag")) is not None:
            return signal
    return None


def _velocity(log: _Log) -> Signal | None:
    found = {}
    for name in VELOCITY:
        if name in log.own:
            y, held = messages.velocity(name, log.own[name].rows)
            if np.any(y[np.all(np.isfinite(y), axis=1)]):
                found[name] = (y, held)
            else:
                log.notes.append(Note(f"{name} with a velocity of zero throughout: not used"))
    most = max((len(y) for y, _ in found.values()), default=0)
    for name, (y, held) in found.items():
        if len(y) >= 0.9 * most:
            return _signal(log, name, y, held, "velocity")
    return None


def _receivers(log: _Log) -> list[gps.Receiver]:
    found = []
    for name in (name for name in RECEIVERS if name in log.own):
        table = log.own[name]
        t, rows = log.line.of(name, table, log.notes)
        accuracy, fix = messages.quality(table.rows[rows])
        found.append(gps.Receiver(name, t, fix, accuracy))
    return found


def _signal(
    log: _Log, name: str, y: messages.Array, held: NDArray[np.bool_], what: str = ""
) -> Signal | None:
    """Put values on the clock; None where there are none."""
    if not held.any():
        return None
    t, rows = _usable(log, name, y, held, log.own[name], what)
    return Signal(t, np.ascontiguousarray(y[rows]), name) if len(t) else None


def _usable(
    log: _Log,
    name: str,
    y: messages.Array,
    held: NDArray[np.bool_],
    table: Table,
    what: str,
    foreign: bool = False,
) -> tuple[Ints, Ints]:
    """Find times and rows of the values that are held and finite."""
    t, rows = (log.line.of_foreign if foreign else log.line.of)(name, table, log.notes)
    finite = np.all(np.isfinite(y), axis=1)
    label = f"{name} {what}".strip()
    if lost := int((~held & finite).sum()):
        log.notes.append(Note(f"{label} without a value dropped", lost))
    if lost := int((~finite).sum()):
        log.notes.append(Note(f"{label} not finite dropped", lost))
    good = (held & finite)[rows]
    return t[good], rows[good]


def _references(log: _Log) -> dict[str, Reference]:
    found = {}
    for name in ATTITUDES:
        if (reference := _reference(log, name)) is not None:
            found[name] = reference
    best = sorted(found.values(), key=lambda r: (r.kind != "truth", ATTITUDES[r.name].rank,
                                                 -len(r.t)))  # fmt: skip
    return {reference.name: reference for reference in best}


def _reference(log: _Log, name: str) -> Reference | None:
    source = _source(log, name)
    if source is None:
        return None
    table, foreign = source
    q, held = ATTITUDES[name].decode(table.rows)
    if not held.any():
        log.notes.append(Note(f"{name} without an attitude throughout: not used"))
        return None
    t, rows = _usable(log, name, q, held, table, "attitude", foreign)
    if not len(t):
        return None
    if doubt := messages.attitude_doubt(name, table.rows):
        log.notes.append(Note(doubt, doubt=True))
    kind = ATTITUDES[name].kind
    if name == "ODOMETRY":
        kind = "truth" if np.all(table.rows["estimator_type"] == messages.MOCAP) else "autopilot"
    return Reference(name, kind, t, quaternion.continuous(q[rows]))


def _source(log: _Log, name: str) -> tuple[Table, bool] | None:
    """Return the vehicle's messages, or for what others send those of who sent most."""
    if name in log.own:
        return log.own[name], ATTITUDES[name].foreign
    table = log.scan.tables.get(name)
    if table is None or not ATTITUDES[name].foreign:
        return None
    number = Counter(table.sender.tolist()).most_common(1)[0][0]
    log.notes.append(Note(f"{name} taken from {number >> 8}/{number & 0xFF}", doubt=True))
    return table[table.sender == number], True


def _declination(own: Mapping[str, Table]) -> float | None:
    if "PARAM_VALUE" not in own:
        return None
    rows = own["PARAM_VALUE"].rows
    return declination(rows["param_id"], rows["param_value"])


def _vehicle_id(own: Mapping[str, Table]) -> str | None:
    """Return the number of the board's processor."""
    if "AUTOPILOT_VERSION" not in own:
        return None
    told = own["AUTOPILOT_VERSION"].rows[-1]
    if told["uid2"].any():
        return f"uid {told['uid2'].tobytes().hex()}"
    return f"uid {told['uid']:016x}" if told["uid"] else None


def _counted(notes: list[Note]) -> tuple[Note, ...]:
    """Tell the same thing once: a message that gives several signals is dropped from each."""
    return tuple(dict.fromkeys(notes))


def _details(scan: Scan, senders: list[Sender], vehicle: Sender) -> dict[str, object]:
    total: Counter[str] = Counter()
    for sender in senders:
        total += sender.messages
    return {
        "vehicle": vehicle.id,
        "senders": [{"id": s.id, "what": str(s), "messages": s.messages.total()} for s in senders],
        "messages": dict(sorted(total.items())),
        "stamped": scan.stamped,
        "bad_frames": scan.damage.bad_frames,
        "unknown_frames": scan.damage.unknown_frames,
        "bytes_skipped": scan.damage.bytes_skipped,
    }
