"""Restarts of a sender's clock: where they are, and how the parts between them lie in time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from attest.readers.mavlink import Ints
from attest.readers.mavlink_clock import LATEST, SAME, SECOND, Times, least_latency

REBOOT = SECOND // 2
"""A clock that falls by less was not restarted."""
MOST_RESTARTS = 100


@dataclass(frozen=True, slots=True)
class Segment:
    """What was sent between two restarts of the sender's clock."""

    at: int
    """Place in the file where it begins."""
    offset: int
    """What to add to the sender's time to reach the recording's clock."""
    fall: int
    """How far the sender's clock fell at its beginning."""


def segments(
    now: Mapping[str, Times], base: str, system_time: tuple[Ints, Ints] | None
) -> list[Segment]:
    """Split a log at the restarts of the sender's clock and lay the parts one behind another.

    Parameters
    ----------
    now
        Sound times of the messages that are stamped when sent, by name.
    base
        The one among them that counts most: the inertial message.
    system_time
        Place in the file and UTC less the sender's time, where the log has it.
    """
    cuts = [cut for cut in falls(now) if base in cut.names or len(cut.names) > 1]
    found = [Segment(-1, 0, 0)]
    if len(cuts) > MOST_RESTARTS:
        return found  # a clock in disorder: what does not advance is dropped
    period = int(np.median(np.diff(now[base].t))) if len(now[base]) > 1 else SECOND // 100
    stops = [*(cut.at for cut in cuts), int(np.iinfo(np.int64).max)][1:]
    for cut, stop in zip(cuts, stops, strict=True):
        earlier, later = _part(now, found[-1].at, cut.at), _part(now, cut.at, stop)
        shift = _shift(earlier, later, system_time)
        # at the earliest one sample after what was before
        last = max(int(times.t.max()) for times in earlier)
        least = last + max(period, 1) - min(int(times.t.min()) for times in later)
        offset = found[-1].offset + (least if shift is None else max(shift, least))
        if abs(offset) > LATEST:
            return found[:1]  # no sum of flights is that long: a clock in disorder
        found.append(Segment(cut.at, offset, cut.depth))
    return found


@dataclass(frozen=True, slots=True)
class Fall:
    """A fall of the sender's clock."""

    at: int
    """Place in the file of the first message after it."""
    depth: int
    names: frozenset[str]
    """The messages that show it."""


def falls(now: Mapping[str, Times]) -> list[Fall]:
    """Find the fewest falls of one clock that explain the falls of all messages."""
    single = sorted(
        (int(times.at[i]), int(times.at[i - 1]), name, int(times.t[i - 1] - times.t[i]))
        for name, times in now.items()
        for i in (np.flatnonzero(np.diff(times.t) < 0) + 1).tolist()
    )
    found: list[Fall] = []
    first = 0
    while first < len(single):
        cut, stop = single[first][0], first + 1
        # each fell somewhere between two of its messages: one cut can lie in all these intervals
        while stop < len(single) and single[stop][1] < cut:
            stop += 1
        same, first = single[first:stop], stop
        depth = max(fall[3] for fall in same)
        if depth > REBOOT:
            found.append(Fall(cut, depth, frozenset(fall[2] for fall in same)))
    return found


def _part(now: Mapping[str, Times], first: int, stop: int) -> list[Times]:
    """Everything between two places in the file, by message."""
    parts = []
    for times in now.values():
        rows = slice(*np.searchsorted(times.at, [first, stop]).tolist())
        if rows.stop > rows.start:
            parts.append(times[rows])
    return parts


def _shift(
    earlier: list[Times], later: list[Times], system_time: tuple[Ints, Ints] | None
) -> int | None:
    """How much further the later part lies than its stamps say; None where nothing tells."""
    by_arrival = None
    late = [[least_latency(times) for times in part] for part in (earlier, later)]
    known = [[latency for latency in part if latency is not None] for part in late]
    if known[0] and known[1]:
        by_arrival = min(known[1]) - min(known[0])
    if system_time is not None:
        medians = [_median_within(system_time, part) for part in (earlier, later)]
        if medians[0] is not None and medians[1] is not None:
            by_unix = medians[1] - medians[0]
            if by_arrival is None or abs(by_unix - by_arrival) < SAME:
                return by_unix
    return by_arrival


def _median_within(system_time: tuple[Ints, Ints], part: list[Times]) -> int | None:
    at, unix_less_boot = system_time
    first, last = min(int(times.at[0]) for times in part), max(int(times.at[-1]) for times in part)
    within = unix_less_boot[(at >= first) & (at <= last)]
    return int(np.median(within)) if len(within) else None


def mapped(times: Times, parts: Sequence[Segment]) -> Times:
    """Bring a sender's times to the recording's clock."""
    if len(parts) == 1:
        return times
    index = np.searchsorted([part.at for part in parts], times.at, side="right") - 1
    offset = np.array([part.offset for part in parts], np.int64)[index]
    return times.moved(offset)
