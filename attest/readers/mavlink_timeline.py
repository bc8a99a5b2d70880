"""The recording's clock: every message type of a vehicle brought to one advancing time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from attest.readers import mavlink_clock as clock
from attest.readers import mavlink_restarts
from attest.readers.mavlink import Ints
from attest.readers.mavlink_clock import SECOND, Times
from attest.readers.mavlink_restarts import Segment
from attest.readers.mavlink_scan import Table
from attest.recording import Clock, Note

NOW = ("ATTITUDE", "ATTITUDE_QUATERNION", "HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2",
       "SCALED_IMU3", "SERVO_OUTPUT_RAW", "VIBRATION")  # fmt: skip
"""Messages that carry the time at which they are sent, not that of a fix before."""
SINGLY = 10
"""More late deliveries than this are noted together."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """How times in a log map to the recording's clock."""

    clock: Clock
    restarts: tuple[int, ...]
    """Times of the first inertial samples after each restart."""
    times: Mapping[str, Times]
    """Of the vehicle's messages that carry a time, by name, on the recording's clock."""
    base: Times
    """Of the inertial message."""
    now: Times
    """Of all messages that are stamped when they are sent."""

    def of(self, name: str, table: Table, notes: list[Note]) -> tuple[Ints, Ints]:
        """Give times that advance strictly, and the rows of the vehicle's table they belong to."""
        times = self.times[name] if name in self.times else self._before(name, table, notes)
        return sound_rows(name, times, len(table), notes)

    def of_foreign(self, name: str, table: Table, notes: list[Note]) -> tuple[Ints, Ints]:
        """Do the same for messages that somebody else sent, who may have another clock."""
        times = clock.own_times(table)
        if times is None or not len(times.sound()):
            times = self._before(name, table, notes)
        else:
            shift = _shift(name, times.sound(), self.base, self.clock.utc_offset, notes)
            times = times.moved(shift)
        return sound_rows(name, times, len(table), notes)

    def _before(self, name: str, table: Table, notes: list[Note]) -> Times:
        times = clock.of_message_before(table.at, self.now)
        if len(times):
            text = f"{name} without a time of its own: took that of the message before"
            notes.append(Note(text, len(times)))
        return times


def timeline(
    tables: Mapping[str, Table], base: str, stamped: bool, notes: list[Note]
) -> Timeline | None:
    """Decide the clock of a vehicle; None where none of its messages carries a time.

    Parameters
    ----------
    tables
        The vehicle's messages by name.
    base
        The inertial message.
    """
    raw = {name: clock.own_times(table) for name, table in tables.items()}
    timed = {name: times for name, times in raw.items() if times is not None and len(times.sound())}
    if base not in timed:
        base = max(set(timed) & set(NOW), key=lambda name: (len(timed[name]), name), default="")
    if not base:
        return None
    unix = _unix(tables, timed)
    ahead = None if unix is None else int(np.median(unix[1]))
    for name in sorted(timed.keys() - {base}):
        shift = _shift(name, timed[name].sound(), timed[base].sound(), ahead, notes)
        timed[name] = timed[name].moved(shift) if shift else timed[name]
    now = {name: times for name, times in timed.items() if name in NOW}
    sound = {name: times.sound() for name, times in now.items()}
    parts = mavlink_restarts.segments(sound, base, _unix(tables, timed))
    timed = {name: mavlink_restarts.mapped(times, parts) for name, times in timed.items()}
    base_times = timed[base].sound()
    rebooted = restarts(parts, base_times, notes)
    _late(mavlink_restarts.falls(now), {part.at for part in parts}, base_times, notes)
    chosen = _clock(base_times, _unix(tables, timed), stamped, notes)
    now = {name: timed[name] for name in now}
    return Timeline(chosen, rebooted, timed, base_times, clock.together([*now.values()]))


def _unix(tables: Mapping[str, Table], timed: Mapping[str, Times]) -> tuple[Ints, Ints] | None:
    """Place in the file and UTC less the message's time, of SYSTEM_TIME that knows UTC."""
    if "SYSTEM_TIME" not in timed:
        return None
    times = timed["SYSTEM_TIME"].sound()
    micros = tables["SYSTEM_TIME"].rows["time_unix_usec"][times.row]
    sane = (micros > clock.SANE_UNIX // 1_000) & (micros < clock.LATEST // 1_000)
    if not sane.any():
        return None
    return times.at[sane], micros[sane].astype(np.int64) * 1_000 - times.t[sane]


def _shift(
    name: str, times: Times, base: Times, unix_less_base: int | None, notes: list[Note]
) -> int:
    """Tell what brings a message's clock to that of the inertial message."""
    ahead = clock.difference(times, base)
    if ahead is None or abs(ahead) < clock.SAME:
        return 0
    turns = round(ahead / clock.MICROS_WRAP)
    likely = [turns * clock.MICROS_WRAP] if abs(turns) < 1000 else []
    if unix_less_base is not None:
        likely += [unix_less_base, -unix_less_base]
    for guess in likely:
        if guess and abs(ahead - guess) < clock.SAME:
            notes.append(Note(f"{name} counts time from elsewhere: {-guess / SECOND:.3f} s added"))
            return -guess
    late, base_late = clock.least_latency(times), clock.least_latency(base)
    if late is not None and base_late is not None:
        ahead = base_late - late
    text = f"{name} has a clock of its own, matched by arrival: {-ahead / SECOND:.3f} s added"
    notes.append(Note(text, doubt=True))
    return -ahead


def restarts(parts: list[Segment], base: Times, notes: list[Note]) -> tuple[int, ...]:
    """Return the first inertial times after each restart, and note how far the clock fell."""
    found = []
    for part in parts[1:]:
        after = base.t[base.at >= part.at]
        if not len(after):
            continue
        found.append(int(after.min()))
        seconds = (found[-1] - int(base.t[0])) / SECOND
        fall = part.fall / SECOND
        text = f"the boot clock fell back by {fall:.1f} s at {seconds:.1f} s: taken as a reboot"
        notes.append(Note(text))
    return tuple(found)


def _clock(base: Times, unix: tuple[Ints, Ints] | None, stamped: bool, notes: list[Note]) -> Clock:
    if int(base.t[0]) > clock.SANE_UNIX:
        return Clock("UTC, as the messages carry it", 0)
    if not stamped:
        notes.append(Note("raw stream without a receiver's clock", doubt=unix is None))
    if unix is not None:
        return Clock("autopilot boot clock, UTC by SYSTEM_TIME", int(np.median(unix[1])))
    late = clock.least_latency(base)
    if late is None or late < clock.SANE_UNIX:
        return Clock("autopilot boot clock")
    return Clock("autopilot boot clock, UTC by the receiver's stamps", late)


def _late(
    found: list[mavlink_restarts.Fall], reboots: set[int], base: Times, notes: list[Note]
) -> None:
    """Note where many messages show an older time for a moment: they were delivered late."""
    late = [fall for fall in found if fall.at not in reboots and len(fall.names) > 1]
    if len(late) > SINGLY:
        text = "falls of the boot clock by messages that came late, dropped"
        notes.append(Note(text, len(late), doubt=True))
        return
    for fall in late:
        before = base.t[base.at < fall.at]
        seconds = (int(before.max()) - int(base.t[0])) / SECOND if len(before) else 0.0
        text = f"the boot clock fell back by {fall.depth / SECOND:.1f} s at {seconds:.1f} s as in "
        notes.append(Note(text + "a reboot and came back: messages that came late, dropped"))


def sound_rows(name: str, times: Times, total: int, notes: list[Note]) -> tuple[Ints, Ints]:
    """Drop what does not belong or does not advance."""
    sound = times.sound()
    later = clock.advancing(sound.t)
    for count, what in (
        (total - len(times), "without a usable time"),
        (len(times) - len(sound), "with a stray time"),
        (int((~later).sum()), "with a repeated or earlier time"),
    ):
        if count:
            notes.append(Note(f"{name} {what} dropped", count, doubt=count > 0.01 * total))
    return sound.t[later], sound.row[later]
