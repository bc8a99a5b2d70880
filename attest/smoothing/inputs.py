"""From samples to what is smoothed: the log by kinds of vectors, and where its nodes are."""

from math import comb

import numpy as np
from numpy.typing import NDArray

from attest.geometry.earth import GRAVITY
from attest.samples import Samples, segments
from attest.smoothing.path import Nodes
from attest.smoothing.stretch import Log

Array = NDArray[np.float64]

ORDER = 4
"""Of the differences that noise is told by; second ones are of a hand's motion too, at 57 Hz."""
AROUND = 17
"""Steps over which noise is taken as the same."""


def nodes(samples: Samples, apart: float) -> Nodes:
    """Put a node at the first and last step of each stretch, and every so far between."""
    at: list[int] = []
    broken: list[int] = []
    for part in segments(samples):
        s = (samples.t[part] - samples.t[part][0]) * 1e-9
        chosen = np.unique(np.floor(s / apart), return_index=True)[1]
        at += (part.start + np.unique(np.append(chosen, len(s) - 1))).tolist()
        broken.append(len(at) - 1)
    steps = np.array(at, np.int64)
    ends = np.isin(np.arange(len(steps)), broken[:-1])
    gap = np.where(ends, np.diff(samples.t[steps], append=samples.t[-1]) * 1e-9, 0.0)
    return Nodes(steps, ends, gap, _rests(samples, steps, ends), _moving(samples, steps))


def _rests(samples: Samples, at: NDArray[np.int64], broken: NDArray[np.bool_]) -> Array:
    """Return how long the rest lasts that the stretch after each node is in, s; 0 in motion."""
    rests = np.zeros(len(at))
    if samples.rest is None or len(at) < 2:
        return rests
    moved = np.concatenate([[0], np.cumsum(~samples.rest)])
    rested = (moved[at[1:]] == moved[at[:-1]]) & ~broken[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rested, [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        rests[begin:end] = (samples.t[at[end]] - samples.t[at[begin]]) * 1e-9
    return rests


def _moving(samples: Samples, at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell at which nodes the log's velocity is in what the accelerometer should measure."""
    if "accel" not in samples.names or len(samples.inertial) == 1:
        return np.zeros(len(at), np.bool_)
    return _aided(samples.inertial[at, samples.names.index("accel")])


def _aided(expected: Array) -> NDArray[np.bool_]:
    """Tell where (n,) a velocity is in what the accelerometer should measure: it leans."""
    return np.asarray(np.abs(expected[:, :2]).max(axis=1) > 1e-9)


def log(samples: Samples, least: tuple[float, float]) -> Log:
    """Sort the vectors by what they are.

    The least noise is that of gyroscope and accelerometer, rad/√s and m/s/√s.
    """
    n = len(samples.t)
    h = np.diff(samples.t, append=samples.t[-1]) * 1e-9
    h[:-1][samples.restart[1:]] = 0.0
    names = samples.names
    others = [i for i, name in enumerate(names) if name not in {"accel", "mag"}]
    none, never = np.zeros((n, 3)), np.zeros(n, np.bool_)
    rough = none
    force, expected, force_valid, field, field_valid = none, none[:1], never, none, never
    if "accel" in names:
        i = names.index("accel")
        length = np.full(n, GRAVITY) if samples.length is None else samples.length[:, i]
        force, force_valid = length[:, np.newaxis] * samples.body[:, i], samples.valid[:, i]
        rough = force
        expected = GRAVITY * samples.inertial[:, i]
        if len(expected) > 1:  # directions, of which neither has the length
            rough = length[:, np.newaxis]
            # without a velocity there, what is expected is gravity, and the force is as measured
            force = np.where(_aided(expected)[:, np.newaxis], GRAVITY * samples.body[:, i], force)
    if "mag" in names:
        i = names.index("mag")
        length = np.ones(n) if samples.length is None else samples.length[:, i]
        field = length[:, np.newaxis] / usual(samples) * samples.body[:, i]
        field_valid = samples.valid[:, i]
    held = np.maximum.accumulate(np.where(force_valid, np.arange(n), 0))
    return Log(
        h=h,
        gyro=np.ascontiguousarray(samples.gyro),
        turn_noise=variance(h, samples.gyro, least[0], ORDER),
        force=force,
        push_noise=variance(h, rough[held], least[1], ORDER),
        expected=np.ascontiguousarray(expected),
        force_valid=np.append(force_valid[:-1] & force_valid[1:], force_valid[-1:]),
        field=field,
        field_valid=np.ascontiguousarray(field_valid),
        measured=np.ascontiguousarray(samples.body[:, others]),
        known=np.ascontiguousarray(samples.inertial[:, others]),
        valid=np.ascontiguousarray(samples.valid[:, others]),
    )


def usual(samples: Samples) -> float:
    """Return the field's usual length, which it is counted in."""
    i = samples.names.index("mag")
    if samples.length is None:
        return 1.0
    seen = samples.length[samples.valid[:, i] & (samples.length[:, i] > 0.0), i]
    return float(np.median(seen)) if len(seen) else 1.0


def variance(h: Array, y: Array, least: float, order: int) -> Array:
    """Return the variance of what each step of y (n, j) adds up to, (n,), by least per second.

    By differences of an even order, which are of noise, and of motion that is too quick for the
    log: those of the whole log, and those around the step where they are more. Between samples that
    are further apart than usual, what is measured has wandered off, like a random walk.
    """
    if len(h) <= order:
        return least**2 * h
    rough = np.mean(np.diff(y, n=order, axis=0) ** 2, axis=1) / comb(2 * order, order)
    padded = np.pad(rough, order // 2, mode="edge")  # variance of an axis
    around = np.convolve(padded, np.full(AROUND, 1.0 / AROUND))[AROUND // 2 :][: len(h)]
    step = float(np.median(h[h > 0.0])) if (h > 0.0).any() else 0.0
    intensity = step * np.maximum(around, float(np.median(rough)))
    apart = np.maximum(1.0, h / max(step, 1e-9)) ** 2
    variance: Array = h * np.maximum(least**2, intensity * apart)
    return variance
