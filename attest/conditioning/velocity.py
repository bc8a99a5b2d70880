"""Which of the log's velocity can be: beside what the accelerometer adds up to, without attitude.

Over any stretch dv - g dt is the specific force summed up in the world, and its turn to the frame
that the gyroscope integrates is the same for some seconds. So lengths agree, and those of
differences from one moment to another, whatever the attitude is. What does not agree is not used,
and nothing is differenced across it, nor across a gap.
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import specific_force
from attest.recording import Note, Signal, seconds

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

SECOND = 1_000_000_000
GAP = 2 * SECOND
"""Longest time between two samples across which there is a slope, ns."""
APART = 200 * SECOND
"""Between stretches; no smoothing reaches that far."""
JUMP = 1.5
"""By which velocity and accelerometer may differ from a sample to the next, be it not usual, m/s:
a velocity that is late by 0.1 s differs so much as 15 m/s² set in."""
BACK = 0.5
"""Share of a jump that is left where the next sample is back."""
AROUND = 3 * SECOND
"""Before and after a second, what tells how the frames are turned, ns."""
OFTEN = 0.75
"""Share of the changes that differ by what is usual, at the most."""
STUCK = SECOND
"""A value that stays the same for so long is looked at, ns."""
PIECE = 5 * SECOND
"""So much of it at once, ns: the gyroscope's drift must not show."""
MOVED = 0.5
"""A vehicle whose velocity stays the same must not change it by more, m/s."""
LAGS = (1.5, 3.0, 4.5, 6.0)
"""Over which changes of the acceleration are compared, s."""
USUAL = 5.0
"""Times the usual difference by which a change may differ, be it more than that."""
LEAST, MOST = 2.0, 5.0
"""And an acceleration in any case by the one, and not by more than the other, m/s²."""


class Compared(NamedTuple):
    """Velocity, and what the accelerometer adds up to, at the same times."""

    t: Stamps
    """Stamps of the velocity, (k,)."""
    v: Array
    """Velocity less that of free fall, in the world, m/s, (k, 3)."""
    u: Array
    """Specific force summed up in the gyroscope's frame, as late as the velocity, m/s, (k, 3)."""


def compared(velocity: Signal, accel: Stamps, fixed: Array, g: Array, late: int) -> Compared:
    """Put both side by side, as far as there is an accelerometer.

    Parameters
    ----------
    accel, fixed
        Stamps of the accelerometer, and its values in the gyroscope's frame, (j,) and (j, 3).
    late
        How late the velocity is, ns.
    """
    t = velocity.t - late
    some = (t >= accel[0]) & (t <= accel[-1])
    origin = int(accel[0])
    at, x = seconds(t[some], origin), seconds(accel, origin)
    mean = 0.5 * (fixed[1:] + fixed[:-1]) * np.diff(x)[:, np.newaxis]
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(mean, axis=0)])
    before = np.searchsorted(x, at, side="right") - 1
    then = np.stack([np.interp(at, x, column) for column in fixed.T], axis=1)
    u = total[before] + 0.5 * (fixed[before] + then) * (at - x[before])[:, np.newaxis]
    return Compared(velocity.t[some], velocity.y[some] - np.outer(at, g), u)


def unstuck(velocity: Signal, pair: Compared) -> tuple[Signal, list[Note]]:
    """Leave out what stands still while the vehicle does not."""
    y = velocity.y[np.isin(velocity.t, pair.t)]
    same = np.all(np.diff(y, axis=0) == 0.0, axis=1)
    kept = np.ones(len(y), np.bool_)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    for first, last in edges.reshape(-1, 2):
        if pair.t[last] - pair.t[first] >= STUCK:
            for begin, end in _pieces(pair.t, int(first), int(last)):
                kept[begin : end + 1] &= not _moves(pair, begin, end)
    notes = _counted("that stands still while the vehicle does not: left out", kept)
    kept[1:] &= ~_held(pair.t, same, edges.reshape(-1, 2))
    rest = np.isin(velocity.t, pair.t[~kept], invert=True)
    return replace(velocity, t=velocity.t[rest], y=velocity.y[rest]), notes


def _held(t: Stamps, same: Mask, runs: NDArray[np.intp]) -> Mask:
    """Mark repeats (k - 1,) where most values, those that stand still aside, repeat the last."""
    brief = same.copy()
    for first, last in runs:
        if t[last] - t[first] >= STUCK:
            brief[first:last] = False
    often = 2 * int(brief.sum()) > len(same) - int(same.sum()) + int(brief.sum())
    return brief if often else np.zeros(len(same), np.bool_)


def _pieces(t: Stamps, first: int, last: int) -> list[tuple[int, int]]:
    """Divide samples from first to last where `PIECE` is full."""
    cuts = np.flatnonzero(np.diff((t[first : last + 1] - t[first]) // PIECE)) + 1 + first
    edges = [first, *cuts.tolist(), last]
    return [(a, b) for a, b in pairwise(edges) if b > a]


def _moves(pair: Compared, first: int, last: int) -> bool:
    """Whether the accelerometer has more than gravity in it from one sample to another."""
    x = seconds(pair.t[first : last + 1], int(pair.t[first]))
    u, v = pair.u[first : last + 1], pair.v[first : last + 1]
    share = (x / x[-1])[:, np.newaxis]
    bent = np.linalg.norm(u - u[0] - share * (u[-1] - u[0]), axis=1).max()
    longer = abs(np.linalg.norm(u[-1] - u[0]) - np.linalg.norm(v[-1] - v[0]))
    return bool(max(bent, longer) > MOVED)


def breaks(pair: Compared) -> tuple[Mask, Mask]:
    """Mark the gaps (k - 1,) that are too long for a slope, and jumps that cannot be."""
    dt = np.diff(pair.t)
    if not len(dt):
        return np.zeros(0, np.bool_), np.zeros(0, np.bool_)
    dv, du = np.diff(pair.v, axis=0), np.diff(pair.u, axis=0)
    # what adds up for longer than usual is less certain
    longer = np.sqrt(np.maximum(dt / np.median(dt), 1.0))
    shorter = np.abs(np.linalg.norm(dv, axis=1) - np.linalg.norm(du, axis=1))
    R = _turns(pair.t, dv, du, shorter <= _most(shorter) * longer)
    off = _off(R, dv, du)
    long, most = dt > GAP, _most(off) * longer
    jumps = ~long & (off > most)
    # where two changes together are off by far less it is the sample between them that is off
    two = _off(R[:-1], dv[1:] + dv[:-1], du[1:] + du[:-1])
    back = two < BACK * np.maximum(off[1:], off[:-1])
    spikes = np.flatnonzero(back & (jumps[1:] | jumps[:-1]))
    jumps[spikes] = jumps[spikes + 1] = True
    return long, jumps & ~long


def _most(off: Array) -> float:
    """Return by how much sound changes may differ."""
    return max(JUMP, USUAL * float(np.quantile(off, OFTEN)))


def _turns(t: Stamps, dv: Array, du: Array, like: Mask) -> Array:
    """Return how the gyroscope's frame is turned in the world at each change, (k - 1, 3, 3).

    What turns the changes of the seconds around best into each other. What they leave open, in
    hover the heading, does not matter to them.

    Parameters
    ----------
    t, dv, du : shapes (k,), (k - 1, 3) and (k - 1, 3)
        Stamps, and the changes from each to the next, m/s.
    like : shape (k - 1,)
        Changes that are like each other: others are left out.
    """
    cells, cell = np.unique((t[:-1] - t[0]) // SECOND, return_inverse=True)
    begin = np.searchsorted(t, t[0] + cells * SECOND - AROUND)
    end = np.searchsorted(t, t[0] + (cells + 1) * SECOND + AROUND, side="right") - 1
    pairs = (dv * like[:, np.newaxis])[:, :, np.newaxis] * du[:, np.newaxis, :]
    total = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(pairs, axis=0)])
    U, _, Vt = np.linalg.svd(total[end] - total[begin])
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, np.newaxis]
    R: Array = (U @ Vt)[cell]
    return R


def _off(R: Array, dv: Array, du: Array) -> Array:
    """Return how far changes of the velocity are from those that are felt, m/s."""
    off: Array = np.linalg.norm(dv - np.einsum("nij,nj->ni", R, du), axis=1)
    return off


def lasting(t: Stamps, broken: Mask, shortest: int) -> Mask:
    """Mark samples (k,) of stretches between breaks that are long enough for a slope."""
    which = np.concatenate([[0], np.cumsum(broken)]) if len(t) else np.zeros(0, np.int64)
    first = np.searchsorted(which, which, side="left")
    last = np.searchsorted(which, which, side="right") - 1
    return np.asarray((t[last] - t[first] >= shortest) & (last - first >= 2))


def slopes(when: Stamps, pair: Compared, broken: Mask, sigma: float) -> tuple[Array, Array]:
    """Return a - g in the world, and the specific force in the gyroscope's frame, both (n, 3).

    By the same local line through samples of the same times, so that the two belong together
    however few they are; NaN further than ``sigma`` from a stretch.
    """
    nothing = np.full((len(when), 3), np.nan)
    if not len(pair.t):
        return nothing, nothing
    ends, begins = pair.t[:-1][broken], pair.t[1:][broken]
    # each step belongs to the stretch that is nearest
    which = np.searchsorted(ends + (begins - ends) // 2, when, side="left")
    first, last = np.append(pair.t[0], begins)[which], np.append(ends, pair.t[-1])[which]
    near = np.maximum(first - when, when - last) <= round(sigma * SECOND)
    stamps = pair.t + APART * np.concatenate([[0], np.cumsum(broken)])
    at = when + APART * which
    a, f = (specific_force.smooth(at, stamps, y, sigma)[1] for y in (pair.v, pair.u))
    return np.where(near[:, np.newaxis], a, np.nan), np.where(near[:, np.newaxis], f, np.nan)


def agree(pair: Compared, broken: Mask, sigma: float) -> Mask:
    """Mark samples (k,) whose acceleration changes as the accelerometer has it.

    From most other moments some seconds before and after; sound samples are the most.
    """
    a, f = slopes(pair.t, pair, broken, sigma)
    off = [np.abs(np.linalg.norm(a, axis=1) - np.linalg.norm(f, axis=1))]
    for lag in LAGS:
        late = np.searchsorted(pair.t, pair.t + round(lag * SECOND))
        here = np.flatnonzero(late < len(pair.t))
        there = late[here]
        change, felt = (np.linalg.norm(y[there] - y[here], axis=1) for y in (a, f))
        for end in (here, there):
            off.append(np.full(len(a), np.nan))
            off[-1][end] = np.abs(change - felt)
    difference = _median(np.stack(off))
    known = np.isfinite(difference)
    usual = float(np.median(difference[known])) if known.any() else 0.0
    most = np.clip(USUAL * usual, LEAST, MOST)
    return np.asarray(~known | (np.where(known, difference, 0.0) <= most))


def _median(rows: Array) -> Array:
    """Return the median of what is known in each column of (m, k); NaN where nothing is."""
    ordered = np.sort(rows, axis=0)  # NaN last
    middle = np.maximum(np.isfinite(rows).sum(axis=0) - 1, 0)
    columns = np.arange(rows.shape[1])
    median: Array = 0.5 * (ordered[middle // 2, columns] + ordered[(middle + 1) // 2, columns])
    return median


def kept(pair: Compared, some: Mask) -> Compared:
    """Return some of the samples."""
    return Compared(pair.t[some], pair.v[some], pair.u[some])


def sound(pair: Compared, sigma: float) -> tuple[Compared, Mask, list[Note]]:
    """Leave out what the accelerometer contradicts; return the rest, where it breaks, and notes."""
    shortest = round(sigma * SECOND)
    agreeing = agree(pair, np.logical_or(*breaks(pair)), sigma)
    notes = _counted("whose acceleration the accelerometer contradicts: left out", agreeing)
    pair = kept(pair, agreeing)
    gaps, jumps = breaks(pair)
    long = lasting(pair.t, gaps | jumps, shortest)
    notes += _counted("that stands alone between gaps or jumps: left out", long)
    pair = kept(pair, long)
    gaps, jumps = breaks(pair)
    for broken, what in ((gaps, f"gap of over {GAP // SECOND} s"), (jumps, "jump")):
        if count := int(broken.sum()):
            notes.append(Note(f"{what} of the velocity: no acceleration is taken across it", count))
    return pair, gaps | jumps, notes


def _counted(what: str, kept: Mask) -> list[Note]:
    lost = len(kept) - int(kept.sum())
    return [Note(f"velocity {what}", lost, doubt=lost > 0.1 * len(kept))] if lost else []
