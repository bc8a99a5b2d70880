"""One clock for all topics: the messages' stamps, or the recorder's where those are no use."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.readers.ros_decode import Array, Ints
from attest.readers.ros_offers import Offer
from attest.readers.values import any_of
from attest.recording import Note

SECOND = 1_000_000_000
FAR = 60 * SECOND
"""Between a message's stamp and its recording: no transport takes that long."""
STEADY = SECOND
"""Stamps that keep their distance from the recorder's by this much tell time, if not the date."""
MOST = 100_000
"""Messages from which the distance is taken, evenly from all."""
LARGEST = 1e9
"""Of any value in any unit; squares of more may overflow, and no sensor measures it."""
LATEST = 1 << 62
"""Nanoseconds, the year 2116: differences of such stamps do not overflow."""


@dataclass(frozen=True, slots=True)
class Lag:
    """How far the recorder's clock is ahead of a topic's stamps, ns."""

    median: int
    steady: bool

    @property
    def far(self) -> bool:
        """Whether the stamps are of another clock."""
        return abs(self.median) > FAR


def lag(offer: Offer) -> Lag | None:
    """Return how far the stamps are from the recorder's; None where there are none."""
    told = _told(offer)
    if not told.any():
        return None
    late = offer.record[told] - offer.stamp[told]
    some = late[:: max(1, len(late) // MOST)] - late[0]
    low, median, high = np.percentile(some, [5.0, 50.0, 95.0])
    return Lag(int(late[0]) + round(float(median)), bool(high - low < STEADY))


def times(offer: Offer, clock: Lag | None, notes: list[Note]) -> tuple[Ints, NDArray[np.int64]]:
    """Return when an offer's values were measured, and which of them have a time, in order.

    Parameters
    ----------
    clock
        Of the gyroscope's topic: another whose stamps are as far from the recorder's is on the
        same clock, be it a strange one.
    """
    t = _moved(offer, clock, notes)
    if len(t) and t[0] >= 0 and t[-1] < LATEST and (t[1:] > t[:-1]).all():
        return t, np.arange(len(t))
    sane = (t >= 0) & (t < LATEST)
    if wild := int((~sane).sum()):
        notes.append(Note(f"{offer.topic} message with an impossible time dropped", wild))
    rows = np.flatnonzero(sane)
    rows = rows[np.argsort(t[rows], kind="stable")]
    if late := int((np.diff(t[sane]) < 0).sum()):
        notes.append(Note(f"{offer.topic} message out of order, put in order", late))
    again = np.concatenate([[False], np.diff(t[rows]) == 0])[: len(rows)]
    if twins := int(again.sum()):
        notes.append(Note(f"{offer.topic} message with the stamp of another dropped", twins))
    return t[rows[~again]], rows[~again]


def _told(offer: Offer) -> NDArray[np.bool_]:
    told = (offer.stamp > 0) & (offer.stamp < LATEST)
    return told & (offer.record >= 0) & (offer.record < LATEST)


def _moved(offer: Offer, clock: Lag | None, notes: list[Note]) -> Ints:
    """Return the stamps on the recording's clock, and the recorder's where they are no use."""
    own = lag(offer)
    if own is None:
        notes.append(Note(f"{offer.topic} without stamps: recorder's time taken", len(offer.stamp)))
        return offer.record
    shift = 0
    if own.far:
        away = f"{offer.topic} stamped {_span(own.median)} from the recorder's time"
        if clock is None or not own.steady or abs(own.median - clock.median) > STEADY:
            notes.append(Note(f"{away}: recorder's time taken", len(offer.stamp), doubt=True))
            return offer.record
        shift = clock.median
        notes.append(Note(f"{away}, steadily: moved by that"))
    t = offer.stamp + shift
    stray = _astray(offer, t)
    if count := int(stray.sum()):
        text = f"{offer.topic} stamp zero or over {FAR // SECOND} s from the recorder's time, "
        notes.append(Note(text + "which was taken", count))
        t[stray] = offer.record[stray]
    return t


def _astray(offer: Offer, t: Ints) -> NDArray[np.bool_]:
    """Mark the stamps that are none, or too far from the recorder's time."""
    far = np.abs(offer.record - t) > FAR
    astray: NDArray[np.bool_] = np.logical_or(~_told(offer), far)
    return astray


def _span(ns: int) -> str:
    """Return a long time in words."""
    seconds = abs(ns) / SECOND
    return f"{seconds:.0f} s" if seconds < 2 * 86400 else f"{seconds / 86400:.0f} days"


def finite(offer: Offer, y: Array, notes: list[Note]) -> NDArray[np.bool_]:
    """Mark the values that are numbers of a size that something has, and count the others."""
    good: NDArray[np.bool_] = ~any_of(~np.isfinite(y))
    if lost := int((~good).sum()):
        notes.append(Note(f"{offer.topic} {offer.role} not finite dropped", lost))
    wild = good & any_of(np.abs(y) > LARGEST)
    if lost := int(wild.sum()):
        notes.append(Note(f"{offer.topic} {offer.role} beyond {LARGEST:g} dropped", lost))
    good &= ~wild
    return good
