"""PX4's on-board logs, ``.ulg``, as pyulog understands them."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from attest.errors import ReadError
from attest.geometry import quaternion
from attest.readers import gps, ulog_frames, ulog_tables
from attest.readers import mavlink_clock as clock
from attest.readers import ulog_topics as topics
from attest.readers.mavlink_clock import SECOND, Times
from attest.readers.mavlink_timeline import sound_rows
from attest.readers.options import ReadOptions
from attest.readers.ulog_frames import MAGIC, Sound
from attest.readers.ulog_topics import ATTITUDES, GYRO, Array, Ints, Mask, Stream, Values
from attest.readers.values import usable
from attest.recording import Clock, Note, Recording, Reference, Signal

ENOUGH = 100.0
"""Hz: a corrected gyroscope as quick as this goes before a raw one that is quicker."""
ASIDE = 10 * SECOND
"""A sample so far from the gyroscope's is from another time."""
_UID = re.compile(r"[0-9A-Fa-f]{8,64}")


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 (others look at the path)
    """Whether the file begins as a ULog does."""
    return head.startswith(MAGIC)


def read(path: Path, options: ReadOptions) -> Recording:
    """Read one log.

    Raises
    ------
    ReadError
        There is no inertial data, or not what the options ask for.
    """
    data = path.read_bytes()
    sound = ulog_frames.sound(data, topics.WANTED)
    if sound.later:
        raise ReadError(
            f"{path}: a ULog of a later kind than attest knows. Convert it with pyulog."
        )
    library = ulog_tables.definitions(path, sound)
    streams = ulog_tables.streams(data, sound, library)
    notes = _damage(sound, path)
    imu = _inertial_stream(path, streams, options.imu)
    log = _Log(streams, int(library.start_timestamp), notes)
    gyro = _signal(log, imu, GYRO[imu.topic](imu), "gyro")
    if gyro is None:
        raise ReadError(f"{path}: no sample of {imu.label} can be used. Choose another one.")
    log = _Log(streams, log.start, notes, (int(gyro.t[0]), int(gyro.t[-1])))
    return Recording(
        path=path,
        format="ulog",
        signals={"gyro": gyro} | _signals(log, imu),
        references=_references(log),
        clock=_clock(log),
        vehicle=_vehicle(library),
        vehicle_id=_vehicle_id(library),
        notes=tuple(dict.fromkeys(notes)),
        details=_details(sound),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """What the parts of a reading share."""

    streams: Mapping[str, list[Stream]]
    """By topic."""
    start: int
    """When the log was begun, microseconds since boot."""
    notes: list[Note]
    span: tuple[int, int] | None = None
    """First and last time of the gyroscope, nanoseconds."""


def _damage(sound: Sound, path: Path) -> list[Note]:
    damage, notes = sound.damage, []
    if damage.gaps:
        heavy = damage.bytes_skipped > 0.05 * path.stat().st_size
        text = f"stretches without a message skipped, {damage.bytes_skipped:,} bytes"
        notes.append(Note(text, damage.gaps, doubt=heavy))
    if damage.orphans:
        notes.append(Note("data of topics that the log does not name skipped", damage.orphans))
    if damage.cut:
        notes.append(Note("the log ends within a message: left out"))
    notes += [Note(f"{name} described so that it cannot be read: not used", doubt=True)
              for name in sound.refused]  # fmt: skip
    if sound.dropouts:
        text = f"dropouts of the logger, {sum(sound.dropouts)} ms"
        notes.append(Note(text, len(sound.dropouts)))
    return notes


def _inertial_stream(path: Path, streams: Mapping[str, list[Stream]], wanted: str | None) -> Stream:
    """Return where to take the gyroscope from: what is corrected, unless it is slow."""
    held = [stream for topic, decode in GYRO.items() for stream in streams.get(topic, [])
            if decode(stream) is not None]  # fmt: skip
    named = {stream.topic: stream for stream in reversed(held)}
    named |= {stream.label: stream for stream in held}
    if wanted is not None and wanted not in named:
        labels = ", ".join(stream.label for stream in held) or "no inertial topic"
        raise ReadError(f"{path}: no {wanted} to read. The log holds: {labels}.")
    if not held:
        raise ReadError(f"{path}: no inertial topic. Log sensor_combined.")
    if wanted is not None:
        return named[wanted]
    rates = [_rate(stream) for stream in held]
    for stream, rate in zip(held, rates, strict=True):
        if rate >= ENOUGH:
            return stream
    return held[int(np.argmax(rates))]


def _rate(stream: Stream) -> float:
    """Return the samples per second, in the middle of the log."""
    values = GYRO[stream.topic](stream)
    if values is None or len(values[0]) < 3:
        return 0.0
    return 1e6 / max(float(np.median(np.abs(np.diff(values[0])))), 1.0)


def _signals(log: _Log, imu: Stream) -> dict[str, Signal]:
    own = topics.PARTNERS.get(imu.topic, imu.topic)
    partner = [s for s in log.streams.get(own, []) if s.instance == imu.instance]
    rest = [s for topic in topics.ACCEL for s in log.streams.get(topic, [])]
    velocity = [s for topic in topics.VELOCITY for s in log.streams.get(topic, [])[:1]]
    position = [s for topic in topics.POSITION for s in log.streams.get(topic, [])[:1]]
    mag = [s for topic in topics.MAG
           for s in sorted(log.streams.get(topic, []), key=lambda s: -len(s))]  # fmt: skip
    found = {
        "accel": _first(log, [*partner, *rest], topics.ACCEL, "accel"),
        "mag": _first(log, mag, topics.MAG, "mag"),
        "velocity": _velocity(log, velocity),
        "position": _first(
            log, position, dict.fromkeys(topics.POSITION, topics.position), "position"
        ),
    }
    signals = {name: signal for name, signal in found.items() if signal is not None}
    used = [imu.label, *(signals[name].source for name in ("accel", "mag") if name in signals)]
    raw = [label for label in dict.fromkeys(used) if label.partition("[")[0] in topics.RAW]
    text = "is raw: the autopilot's calibration is not in it"
    log.notes.extend(Note(f"{label} {text}") for label in raw)
    if "mag" in signals and signals["mag"].source not in raw:
        log.notes.append(Note("magnetometer as the autopilot corrected it by its calibration"))
    return signals


def _velocity(log: _Log, streams: list[Stream]) -> Signal | None:
    """Return the first velocity that is any good."""
    for stream in streams:
        found = _signal(log, stream, topics.velocity(stream), "velocity")
        accuracy, fix = topics.quality(stream)
        t = topics.micros(stream) * 1_000
        row = np.argsort(t, kind="stable")
        receiver = gps.Receiver(stream.label, t[row], fix[row], accuracy[row])
        if (good := gps.vetted(found, [receiver], log.notes)) is not None:
            return good
    return None


def _first(
    log: _Log,
    streams: list[Stream],
    decoders: Mapping[str, Callable[[Stream], Values | None]],
    what: str,
) -> Signal | None:
    tried = (_signal(log, stream, decoders[stream.topic](stream), what) for stream in streams)
    return next((found for found in tried if found is not None), None)


def _signal(log: _Log, stream: Stream, values: Values | None, what: str) -> Signal | None:
    """Put values on the clock; None where there are none."""
    if values is None:
        return None
    micros, y, held = values
    if not held.any():
        log.notes.append(Note(f"{stream.label} without a valid {what} throughout: not used"))
        return None
    t, rows = _usable(log, stream, micros, y, held, what)
    return Signal(t, np.ascontiguousarray(y[rows]), stream.label) if len(t) else None


def _usable(
    log: _Log, stream: Stream, micros: Ints, y: Array, held: Mask, what: str
) -> tuple[Ints, Ints]:
    row = np.flatnonzero(micros < topics.LATEST)
    t = micros[row] * 1_000
    stray = ~clock.not_stray(t)
    # the logger begins with what was published last, be it long ago
    first, last = log.span or (log.start * 1_000, int(t[-1]) if len(t) else 0)
    outside = (t < first - (ASIDE if log.span else SECOND)) | ((t > last + ASIDE) & bool(log.span))
    if not outside.all():
        stray |= outside
    none = np.zeros(len(t), np.int64)
    times = sound_rows(stream.label, Times(row, t, none, row, stray), len(micros), log.notes)
    return usable(f"{stream.label} {what}", times, y, held, log.notes)


def _references(log: _Log) -> dict[str, Reference]:
    """Return the attitudes, the best first."""
    found = {}
    for stream in (s for topic in ATTITUDES for s in log.streams.get(topic, [])):
        values = topics.attitude(stream)
        if values is None:
            continue
        micros, q, held = values
        if not held.any():
            log.notes.append(Note(f"{stream.label} without an attitude throughout: not used"))
            continue
        t, rows = _usable(log, stream, micros, q, held, "attitude")
        if len(t):
            if topics.free_heading(stream):
                text = f"{stream.label} in a local frame: its heading is not from north"
                log.notes.append(Note(text, doubt=True))
            kind, turned = ATTITUDES[stream.topic].kind, quaternion.continuous(q[rows])
            found[stream.label] = Reference(stream.label, kind, t, turned)
    return found


def _clock(log: _Log) -> Clock:
    for stream in (s for topic in topics.GPS for s in log.streams.get(topic, [])):
        ahead = topics.utc(stream)
        if ahead is None:
            continue
        told = stream.data["time_utc_usec"]
        sane = (told > clock.SANE_UNIX // 1_000) & (told < clock.LATEST // 1_000)
        if sane.any():
            return Clock("autopilot boot clock, UTC by GPS", int(np.median(ahead[sane])) * 1_000)
    return Clock("autopilot boot clock")


def _vehicle(library: Any) -> str:
    """Return the firmware's name, its version and its board."""
    info = library.msg_info_dict
    version = library.get_version_info_str() if "ver_sw_release" in info else None
    board = f"on {info['ver_hw']}" if "ver_hw" in info else ""
    words = (str(info.get("sys_name", "PX4")), version or "", board)
    text = " ".join(word for word in words if word)
    return "".join(char for char in text if char.isprintable())[:200]


def _vehicle_id(library: Any) -> str | None:
    """Return the number of the board's processor."""
    told = str(library.msg_info_dict.get("sys_uuid", ""))
    return f"uid {told.lower()}" if _UID.fullmatch(told) and told.strip("0") else None


def _details(sound: Sound) -> dict[str, object]:
    return {
        "messages": dict(sorted(sound.counts.items())),
        "dropouts": len(sound.dropouts),
        "gaps": sound.damage.gaps,
        "bytes_skipped": sound.damage.bytes_skipped,
    }
