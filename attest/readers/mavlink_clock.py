"""One clock for a vehicle's messages: wraps, stray stamps, and the way to UTC.

Times here are int64 nanoseconds. Each message type carries its own clock reading; what they say
together is decided once, from the messages that are stamped when they are sent.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from attest.readers.mavlink import Ints, Mask
from attest.readers.mavlink_scan import Table

SECOND = 1_000_000_000
MICROS_WRAP = 2**32 * 1_000
"""Nanoseconds after which a 32-bit count of microseconds begins anew."""
SAME = 10 * SECOND
"""Clocks whose readings differ by less are the same clock."""
SANE_UNIX = 1_200_000_000 * SECOND
"""UTC before this (2008) is a receiver without a fix, or no UTC at all."""
LATEST = 4_100_000_000 * SECOND
"""UTC after this (2099) is no time."""
UNITS = {"time_boot_ms": 1_000_000, "time_usec": 1_000, "usec": 1_000}
"""Nanoseconds per count of the fields that hold a message's time."""


@dataclass(frozen=True, slots=True, eq=False)
class Times:
    """When the messages of one type were true, by the sender's clock."""

    at: Ints
    """Place in the file."""
    t: Ints
    """The message's own time, wraps undone."""
    arrival: Ints
    """Receiver's clock as written; nothing checks it."""
    row: Ints
    """Which rows of the table these are."""
    stray: Mask
    """Whether a reading is a moment's excursion to an older or a later time."""

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, chosen: Ints | Mask | slice) -> "Times":
        return Times(*(getattr(self, name)[chosen] for name in self.__slots__))

    def moved(self, by: int | Ints) -> "Times":
        """Return the same readings by another clock."""
        return replace(self, t=self.t + by)

    def sound(self) -> "Times":
        """Return the readings that are not stray."""
        return self[~self.stray] if self.stray.any() else self


def own_times(table: Table) -> Times | None:
    """Return the times that the messages carry themselves; None where they carry none."""
    field = next((name for name in UNITS if name in (table.rows.dtype.names or ())), None)
    if field is None:
        return None
    raw, unit = table.rows[field], UNITS[field]
    sane = np.flatnonzero(raw <= LATEST // unit)
    t = _unwrapped(raw[sane].astype(np.int64), raw.dtype.itemsize == 4) * unit
    if len(t) > 2 and not np.any(t != t[0]):
        return None  # a field that was never filled in
    return Times(table.at[sane], t, table.arrival[sane] * 1_000, sane, ~not_stray(t))


def _unwrapped(raw: Ints, narrow: bool) -> Ints:
    """Undo the wrap of 32-bit counts, also where they travel in a 64-bit field."""
    if not len(raw) or (not narrow and int(raw.max()) >= 2**32):
        return raw
    step = np.diff(raw, prepend=raw[:1])
    # a minute of microseconds or 17 hours of milliseconds may be missing around the wrap
    turn = 2**32 - 60_000_000
    turns = np.cumsum((step < -turn).astype(np.int64) - (step > turn))
    unwrapped: Ints = raw + np.maximum(turns, 0) * 2**32
    return unwrapped


def _trusted(arrival: Ints) -> Ints:
    """Find the receiver's stamps that are UTC and fit their neighbours."""
    sane = np.flatnonzero((arrival > SANE_UNIX) & (arrival < LATEST))
    if len(sane) < 3:
        return sane
    now = arrival[sane]
    before, after = np.concatenate([now[:1], now[:-1]]), np.concatenate([now[1:], now[-1:]])
    median = np.maximum(np.minimum(before, after), np.minimum(np.maximum(before, after), now))
    trusted: Ints = sane[np.abs(now - median) < 5 * SECOND]
    return trusted


def not_stray(t: Ints) -> Mask:
    """Mark the readings that are not a moment's excursion to an older or a later time."""
    kept = np.ones(len(t), np.bool_)
    for lone in (_lone_old, _lone_late):
        rows = np.flatnonzero(kept)
        kept[rows[lone(t[rows])]] = False
    rows = np.flatnonzero(kept)
    for first, stop in _excursions(t[rows]):
        kept[rows[first:stop]] = False
    return kept


def _lone_old(t: Ints) -> Mask:
    before = np.concatenate([t[:1], t[:-1]])
    after = np.concatenate([t[1:], t[-1:]])
    return (t < before) & (after >= before)


def _lone_late(t: Ints) -> Mask:
    if len(t) < 3:
        return np.zeros(len(t), np.bool_)
    before = np.concatenate([[np.iinfo(np.int64).min], t[:-1]])
    after = np.concatenate([t[1:], t[-2:-1]])
    late = (t > after + SECOND) & (after >= before)
    late[-1] = t[-1] - t[-2] > 3600 * SECOND
    return late


def _excursions(t: Ints) -> list[tuple[int, int]]:
    """Short runs that leave the clock's course by a jump and return to it by another."""
    found = []
    falls = np.flatnonzero(np.diff(t) < 0) + 1
    for i in falls[:1000].tolist():  # more falls than that have no course to return to
        fall = int(t[i - 1] - t[i])
        ahead = t[i : i + 50]
        back = int(np.argmax(ahead > t[i - 1]))
        if back and 2 * (ahead[back] - ahead[back - 1]) > fall > 0:
            found.append((i, i + back))
            continue
        behind = t[max(0, i - 50) : i][::-1]
        left = int(np.argmax(behind < t[i]))
        if left and 2 * (behind[left - 1] - behind[left]) > fall:
            found.append((i - left, i))
    return found


def least_latency(times: Times) -> int | None:
    """Arrival less sending of the message that took least; arrivals come late, never early."""
    known = _trusted(times.arrival)
    return int((times.arrival[known] - times.t[known]).min()) if len(known) else None


def advancing(t: Ints) -> Mask:
    """Mark the stamps that are later than all before them."""
    if not len(t):
        return np.zeros(0, np.bool_)
    latest = np.maximum.accumulate(t)
    return np.concatenate([[True], t[1:] > latest[:-1]])


def difference(times: Times, base: Times) -> int | None:
    """How far a clock is ahead of another one, by what each read around the same place."""
    times = times[:: max(1, len(times) // 1000)]  # plenty for a median
    before = np.searchsorted(base.at, times.at) - 1
    there = before >= 0
    if not there.any():
        return None
    return int(np.median(times.t[there] - base.t[before[there]]))


def together(parts: Sequence[Times]) -> Times:
    """Return the readings of several message types in file order."""
    order = np.argsort(np.concatenate([times.at for times in parts]), kind="stable")
    return Times(
        *(
            np.concatenate([getattr(part, name) for part in parts])[order]
            for name in Times.__slots__
        )
    )


def of_message_before(at: Ints, now: Times) -> Times:
    """Give the times of the messages before these places in the file, where there are any."""
    index = np.searchsorted(now.at, at) - 1
    rows = np.flatnonzero(index >= 0)
    index = index[rows]
    return Times(at[rows], now.t[index], np.zeros(len(rows), np.int64), rows, now.stray[index])
