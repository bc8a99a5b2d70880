"""One timeline at the gyroscope's stamps: its gaps, and how each step is divided."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame
from attest.conditioning.rows import count_between, largest, shortest_and_longest
from attest.config import Conditioning, Configuration
from attest.errors import ReadError
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

SECOND = 1_000_000_000
BREAK = 10_000 * SECOND
"""Between stretches; no setting lets a vector or a smoothing reach that far."""
MOST_SUBSTEPS = 500, 20_000_000
"""In one step, and in a log unless it has more steps than a fiftieth of that: work must grow with
the log's size and not with the time that it spans."""
FAR, TRIED = 2.0, 9
"""Lengths of a gap that are looked away from it, and in how many places."""
LOST = 1.0
"""Deviation of the turn over a gap, rad, from which a new start knows the attitude better."""
FASTEST = 1e3
"""rad/s; no gyroscope measures a tenth of this."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """The gyroscope's stamps, its values there, and the frame that it integrates."""

    t: Stamps
    gyro: Array
    D: Array


def gyroscope(recording: Recording, config: Configuration) -> tuple[Signal, list[Note]]:
    """Cut the gyroscope to the time that is asked for, and leave out what it cannot measure."""
    points = [name for name in recording.signals if name.startswith("point")]
    if points and "gyro" not in recording.signals:
        raise ReadError(
            f"{recording.path}: {len(points)} feature points and no gyroscope. Use relative_fts "
            "with their places in its 'points'."
        )
    gyro = recording.require("gyro")
    first, last = _wanted(gyro.t, config)
    t, y = gyro.t[first:last], gyro.y[first:last]
    if len(t) < 2:
        raise ReadError(
            f"{recording.path}: {len(t)} gyroscope samples between start and end; two are "
            f"needed. The log has {len(gyro.t)} over {(gyro.t[-1] - gyro.t[0]) * 1e-9:.1f} s."
        )
    wild = len(t) - count_between(y, -1.0, FASTEST)
    if len(t) - wild < 2:
        raise ReadError(
            f"{recording.path}: the gyroscope reads over {FASTEST:g} rad/s. Check its unit."
        )
    if not wild:
        return Signal(t, y, gyro.source), []
    note = Note(f"gyroscope sample of over {FASTEST:g} rad/s left out", wild, doubt=True)
    sane = largest(y) < FASTEST
    return Signal(t[sane], y[sane], gyro.source), [note]


def _wanted(t: Stamps, config: Configuration) -> tuple[int, int]:
    """Return the first sample of the time that is asked for, and the first one behind it."""
    if not config.input.start_s and config.input.end_s is None:
        return 0, len(t)
    at = seconds(t, int(t[0]))
    end_s = np.inf if config.input.end_s is None else config.input.end_s
    first = np.searchsorted(at, config.input.start_s or 0.0)
    return int(first), int(np.searchsorted(at, end_s, side="right"))


def apart(
    recording: Recording, gyro: Signal, mean: Array, restart: NDArray[np.bool_]
) -> tuple[Recording, Timeline]:
    """Set the stretches between restarts far apart, so that nothing reaches from one to another.

    Neither smoothing nor interpolation nor a vector's age goes across a restart then; the clock of
    what is returned is for conditioning only. ``mean`` is the rate over each step.
    """
    D = frame.integrate(gyro.t, mean, restart)
    edges = gyro.t[restart][1:]
    if not len(edges):
        return recording, Timeline(gyro.t, gyro.y, D)

    def moved(t: Stamps) -> Stamps:
        return t + np.searchsorted(edges, t, side="right") * BREAK

    signals = {name: replace(s, t=moved(s.t)) for name, s in recording.signals.items()}
    return replace(recording, signals=signals), Timeline(moved(gyro.t), gyro.y, D)


def restarts(
    recording: Recording, t: Stamps, config: Conditioning, rate: Array | None = None
) -> tuple[NDArray[np.bool_], list[Note]]:
    """Mark the first step, and those after a reboot or a gap that is too long to bridge.

    That is so by its length, or by how the rate, rad/s, (n, 3), varies around it.
    """
    shortest, longest = shortest_and_longest(t)
    restart, notes = np.zeros(len(t), np.bool_), []
    restart[0] = True
    if longest > config.restart_gap_s * SECOND:
        restart[1:] = np.diff(t) > config.restart_gap_s * SECOND
        text = f"gap of over {config.restart_gap_s:g} s: the observer starts anew after it"
        notes.append(Note(text, int(restart[1:].sum()), doubt=True))
    reboots = np.searchsorted(t, np.array(recording.restarts, np.int64))
    restart[reboots[reboots < len(t)]] = True
    if longest <= 5 * shortest:  # the usual case, and no need to look further
        return restart, notes
    h = np.diff(t)
    gaps = np.flatnonzero((h > 5 * np.median(h)) & ~restart[1:])
    lost = np.zeros(len(gaps), np.bool_) if rate is None else _untold(t, rate, gaps) > LOST
    if lost.any():
        restart[1 + gaps[lost]] = True
        text = "gap in quick motion, whose turn is not told: the observer starts anew after it"
        notes.append(Note(text, int(lost.sum()), doubt=True))
    bridged = h[gaps[~lost]]
    if len(bridged):
        widest = bridged.max() * 1e-9
        text = f"gap in the gyroscope bridged by interpolation, the longest {widest:.2f} s"
        notes.append(Note(text, len(bridged)))
    return restart, notes


def _untold(t: Stamps, rate: Array, gaps: NDArray[np.intp]) -> Array:
    """Return the deviation of the turns over gaps from what a line across them has, rad, (j,).

    As it would be over times as long before and after, where the turn is known.
    """
    s, square, count = seconds(t, int(t[0])), np.zeros(len(gaps)), np.zeros(len(gaps))
    mean = 0.5 * (rate[1:] + rate[:-1]) * np.diff(s)[:, np.newaxis]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(mean, axis=0)])

    def at(when: Array, y: Array) -> Array:
        return np.stack([np.interp(when, s, column) for column in y.T], axis=1)

    h = s[gaps + 1] - s[gaps]
    for away in np.linspace(0.0, FAR, TRIED):
        for first in (s[gaps] - (1.0 + away) * h, s[gaps + 1] + away * h):
            last = first + h
            line = 0.5 * h[:, np.newaxis] * (at(first, rate) + at(last, rate))
            off = at(last, turned) - at(first, turned) - line
            known = (first >= 0.0) & (last <= s[-1])
            square += np.where(known, np.sum(off * off, axis=1), 0.0)
            count += known
    return np.asarray(np.sqrt(square / np.maximum(count, 1.0)))


def substeps_of(
    t: Stamps, restart: NDArray[np.bool_], max_step: float, what: str = "gyroscope"
) -> tuple[NDArray[np.int64], list[Note]]:
    """Divide each step so that no part is longer than the gains allow."""
    part = max(1, round(max_step * SECOND))
    if shortest_and_longest(t)[1] <= part:
        return np.ones(len(t), np.int64), []
    h = np.diff(t, append=t[-1])
    most = max(50, min(MOST_SUBSTEPS[0], MOST_SUBSTEPS[1] // len(t)))
    substeps = np.clip(-(-h // part), 1, most)
    substeps[:-1][restart[1:]] = 1  # nothing is stepped across a restart
    rate = 1e9 / np.median(h[:-1])
    if (substeps > 1).mean() < 0.5:
        return substeps, []
    longest = float((h[:-1] / substeps[:-1])[~restart[1:]].max(initial=0)) * 1e-6
    text = (
        f"{what} at {rate:.1f} Hz, interpolated to steps of at most {longest:.3g} ms: motion "
        "faster than the log is not in it"
    )
    return substeps, [Note(text, doubt=bool(rate < 20.0))]
