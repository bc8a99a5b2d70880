"""Feature points of another body: their differences are what an observer of points steps over.

[REL]  Wang, Hamrah, Sanyal, finite-time stable observer for relative attitude: section 2.

Symbols: p_j place of point j in the object's frame; a_j measured in the observer's frame S; D, L
the pairwise differences p_l - p_m and a_l - a_m, so that D = R L.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from attest.conditioning.timeline import restarts, substeps_of
from attest.config import PointsConfiguration
from attest.errors import ReadError
from attest.recording import Note, Recording, Signal, seconds
from attest.samples import Samples

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

FURTHEST = 1e6
"""m; no camera measures a point as far."""
MOST = 20
"""Points; their pairs grow as the square."""


def apply(recording: Recording, config: PointsConfiguration) -> bool:
    """Tell whether points stand alone, or vectors of known places without a gyroscope."""
    if config.points is not None:
        return True
    known = [isinstance(vector.reference, tuple) for vector in config.vectors or ()]
    return "gyro" not in recording.signals and bool(known) and all(known)


def condition(
    recording: Recording, config: PointsConfiguration
) -> tuple[Samples, tuple[Note, ...]]:
    """Take the differences of the points, or the vectors, at the stamps of any of them.

    Raises
    ------
    ReadError
        The log lacks a point of the model, or has no two stamps in the time that is asked for.
    """
    if config.points is not None and len(config.points) > MOST:
        raise ReadError(f"{recording.path}: {len(config.points)} points. Name {MOST} at most.")
    model = _model(config)
    signals = [_sane(recording.require(name)) for name in model]
    t = _stamps(recording, config, signals)
    places, seen = _measured(t, signals)
    restart, notes = restarts(recording, t, config.conditioning)
    substeps, slow = substeps_of(t, restart, config.conditioning.max_step_s, "points")
    columns = _Columns(tuple(model), np.array(list(model.values())), places, seen)
    if config.points is not None:
        notes += [*_hidden(seen, columns.known), *_not_named(recording, model)]
        columns = _differences(columns)
    scale = float(np.linalg.norm(columns.known, axis=1).max())  # the weights do not feel it
    samples = Samples(
        t=t,
        gyro=np.full((len(t), 3), np.nan),
        body=columns.measured / scale,
        inertial=columns.known[np.newaxis] / scale,
        valid=columns.seen,
        names=columns.names,
        substeps=substeps,
        restart=restart,
    )
    return samples, (*notes, *slow)


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """D and L by columns: names, D (k, 3), L (n, k, 3), and which are seen (n, k)."""

    names: tuple[str, ...]
    known: Array
    measured: Array
    seen: NDArray[np.bool_]


def _model(config: PointsConfiguration) -> Mapping[str, tuple[float, float, float]]:
    """Return the points' places, or the vectors' references, by signal."""
    if config.points is not None:
        return config.points
    vectors = config.vectors or ()
    return {v.signal: v.reference for v in vectors if isinstance(v.reference, tuple)}


def _differences(points: _Columns) -> _Columns:
    pairs = list(combinations(range(len(points.names)), 2))
    first, second = np.array(pairs).T
    return _Columns(
        names=tuple(f"{points.names[i]}-{points.names[j]}" for i, j in pairs),
        known=points.known[first] - points.known[second],
        measured=points.measured[:, first] - points.measured[:, second],
        seen=points.seen[:, first] & points.seen[:, second],
    )


def _sane(signal: Signal) -> Signal:
    sane = np.abs(signal.y).max(axis=1) < FURTHEST
    return Signal(signal.t[sane], signal.y[sane], signal.source)


def _stamps(recording: Recording, config: PointsConfiguration, signals: list[Signal]) -> Stamps:
    t = np.unique(np.concatenate([signal.t for signal in signals]))
    at = seconds(t, int(t[0])) if len(t) else np.empty(0)
    wanted = at >= (config.input.start_s or 0.0)
    if config.input.end_s is not None:
        wanted &= at <= config.input.end_s
    if wanted.sum() < 2:
        raise ReadError(
            f"{recording.path}: feature points at {wanted.sum()} times between start and end; two "
            "are needed."
        )
    return t[wanted]


def _measured(t: Stamps, signals: list[Signal]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the places of the points, shape (n, j, 3), and which are seen, (n, j)."""
    places = np.zeros((len(t), len(signals), 3))
    seen = np.zeros((len(t), len(signals)), np.bool_)
    for j, signal in enumerate(signals):
        at = np.searchsorted(t, signal.t)
        inside = (at < len(t)) & (t[np.minimum(at, len(t) - 1)] == signal.t)
        places[at[inside], j] = signal.y[inside]
        seen[at[inside], j] = True
    return places, seen


def _hidden(seen: NDArray[np.bool_], known: Array) -> list[Note]:
    """Say how often points were hidden, and how often too few or only collinear ones were seen."""
    notes = []
    hidden = int((~seen.all(axis=1)).sum())
    if hidden:
        notes.append(Note("step with a point hidden: the others are used", hidden))
    few = seen.sum(axis=1) < 3
    if few.any():
        text = (
            "step with fewer than three points: the turn that they leave open goes on at its last "
            "rate"
        )
        notes.append(Note(text, int(few.sum()), doubt=True))
    sets, which = np.unique(seen, axis=0, return_inverse=True)
    flat = np.array([_on_a_line(known[visible]) for visible in sets])[which.reshape(-1)] & ~few
    if flat.any():
        text = "step whose visible points lie on one line: the turn about it is not observable"
        notes.append(Note(text, int(flat.sum()), doubt=True))
    return notes


def _on_a_line(places: Array) -> bool:
    if len(places) < 3:
        return False
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(spread[1] < 1e-3 * spread[0])


def _not_named(recording: Recording, model: Mapping[str, object]) -> list[Note]:
    others = [n for n in recording.signals if n.startswith("point") and n not in model]
    text = f"feature points without a place in the model, not used: {', '.join(others)[:200]}"
    return [Note(text, len(others), doubt=True)] if others else []
