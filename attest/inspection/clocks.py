"""The reference on the clock of the log, by the shift that is told or that its turns tell."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.config import Evaluation
from attest.errors import ReadError
from attest.inspection import compared, references, turning
from attest.recording import Note, Recording, Reference, Signal

Array = NDArray[np.float64]

MOST_CELLS = 200_000
"""Of each of the two, the first ones."""
SHORTEST = 20.0
"""Time that the two must share at a shift, s, and of the shorter one half."""
CORRELATION = 0.8
"""Of the two speeds of turning, at which a shift is believed."""
AS_GOOD = 0.95
"""A correlation of this share of the best is as good."""
APART = 2.0
"""Shifts that differ by more are two, s."""


def in_time(recording: Recording, config: Evaluation) -> Recording:
    """Return a recording whose chosen reference is shifted as it is told.

    Raises
    ------
    ReadError
        The shift is to be found, and no single one stands out.
    """
    name = config.reference
    default = references.default(recording)
    chosen = default if name is None else recording.references.get(name)
    if chosen is None or not len(chosen.t) or config.reference_shift_s == 0.0:
        return recording
    found = config.reference_shift_s
    why = "as evaluation.reference_shift_s says"
    if found == "auto":
        found, why = _found(recording, chosen), "where it turns as the gyroscope does"
    note = Note(f"reference {chosen.name}: taken {found:+.3f} s later, {why}")
    moved = replace(chosen, t=chosen.t + np.int64(round(found * 1e9)))
    held = {key: moved if ref is chosen else ref for key, ref in recording.references.items()}
    return replace(
        recording,
        references=held,
        notes=(*recording.notes, note),
        details={**recording.details, "reference_shift_s": found},
    )


def _found(recording: Recording, reference: Reference) -> float:
    gyro = recording.require("gyro")
    found = find(turning.thinned(gyro), reference) if len(gyro.t) > 2 else None
    if found is None:
        raise ReadError(
            f"{recording.path}: at no one shift does the reference {reference.name} turn as the "
            "gyroscope does. Give evaluation.reference_shift_s in seconds."
        )
    return found


@np.errstate(all="ignore")  # a hostile log's values overflow when squared
def find(gyro: Signal, reference: Reference) -> float | None:
    """Return how much later a reference must be taken to turn as fast, s, whatever its clock.

    By the speeds alone, which no axes of a body change. None where no single shift stands out.
    """
    if len(reference.t) < 3:
        return None
    width = max(compared.CELL, *(2.0 * turning.period(t) for t in (gyro.t, reference.t)))
    if width > compared.LONGEST_CELL:
        return None
    step = round(width * 1e9)
    ours, theirs = _edges(gyro.t, step), _edges(reference.t, step)
    if min(len(ours), len(theirs)) * width < SHORTEST:
        return None
    g = np.linalg.norm(compared.means(gyro, ours), axis=1)
    r = np.linalg.norm(compared.turns(reference, theirs), axis=1)
    shorter = min(np.isfinite(g).sum(), np.isfinite(r).sum())
    least = max(SHORTEST / width, 0.5 * shorter)
    if shorter < least:
        return None
    lag = _best(_correlation(g, r, least), APART / width)
    return None if lag is None else (int(ours[0]) - int(theirs[0])) * 1e-9 + (lag - len(r)) * width


def _edges(t: NDArray[np.int64], step: int) -> NDArray[np.int64]:
    count = min(int(t[-1] - t[0]) // step, MOST_CELLS)
    edges: NDArray[np.int64] = t[0] + np.arange(count + 1, dtype=np.int64) * step
    return edges


def _correlation(g: Array, r: Array, least: float) -> Array:
    """Return the correlation of g with r taken i - len(r) cells later, by i; 0 of a short overlap.

    NaN stands for what is not known.
    """
    size = 1 << (len(g) + len(r)).bit_length()
    order = np.arange(-len(r), len(g) + 1)

    def sums(a: Array, b: Array) -> Array:
        product = np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size))
        whole: Array = np.fft.irfft(product, size)[order]
        return whole

    known = np.isfinite(g).astype(float), np.isfinite(r).astype(float)
    u, v = (np.where(k > 0.0, x - np.nanmean(x), 0.0) for x, k in zip((g, r), known, strict=True))
    count = np.maximum(sums(*known), 1.0)
    mean_u, mean_v = sums(u, known[1]) / count, sums(known[0], v) / count
    power = (sums(u**2, known[1]) / count - mean_u**2) * (sums(known[0], v**2) / count - mean_v**2)
    both = sums(u, v) / count - mean_u * mean_v
    told = (count >= least) & (power > 0.0)
    return np.where(told, both / np.sqrt(np.where(told, power, 1.0)), 0.0)


def _best(match: Array, apart: float) -> float | None:
    """Return where the greatest correlation is, if it is great enough and no other is as great."""
    best = int(np.argmax(match))
    if not np.isfinite(match).all() or match[best] < CORRELATION:
        return None
    others = np.abs(np.arange(len(match)) - best) > apart
    if best in {0, len(match) - 1} or (match[others] > AS_GOOD * match[best]).any():
        return None
    left, top, right = match[best - 1 : best + 2]
    bend = left - 2.0 * top + right
    return float(best + (0.5 * (left - right) / bend if bend < 0.0 else 0.0))
