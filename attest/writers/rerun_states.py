"""The state timeline: gaps, convergence, rest, and which vectors are used."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from attest.result import Result
from attest.writers.rerun_scene import Color
from attest.writers.rerun_target import Target, recent
from attest.writers.topics import topic_name

GOOD: Color = (34, 197, 94)
MIDDLING: Color = (245, 158, 11)
BAD: Color = (239, 68, 68)
QUIET: Color = (100, 116, 139)

WINDOW = 1_000_000_000
"""A vector is in use until so long after, nanoseconds, so that slow sensors do not flicker."""
REST = np.radians(2.0)
"""Slower than this, rad/s, for …"""
REST_AFTER = 3_000_000_000
"""… so long, nanoseconds, is rest."""

RUN = {"converged": GOOD, "error": MIDDLING, "no reference": QUIET, "gap": BAD}
"""``converged`` is a total error within the settling bound."""

Lane = tuple[str, NDArray[np.str_], Mapping[str, Color]]
"""Its name, its state at each estimate, and the colours of the states."""


def log_states(target: Target, results: Sequence[Result]) -> None:
    """Log each lane's changes; of several observers, each has its own for the run."""
    for result in results[1:]:
        _log_lanes(target, result.estimates.t, [_of_run(result, results)])
    first = results[0]
    _log_lanes(target, first.estimates.t, [_of_run(first, results), *_shared(first)])


def _of_run(result: Result, results: Sequence[Result]) -> Lane:
    name = "run" if len(results) == 1 else f"run/{topic_name(result.estimates.observer)}"
    return name, _run(result), RUN


def _log_lanes(target: Target, t: NDArray[np.int64], lanes: Iterable[Lane]) -> None:
    for name, states, colors in lanes:
        entity = f"state/{name}"
        values = list(colors)
        target.static(
            entity,
            rr.StateConfiguration(values=values, labels=values, colors=list(colors.values())),
        )
        _log_changes(target, entity, t, states)


def _log_changes(
    target: Target, entity: str, t: NDArray[np.int64], states: NDArray[np.str_]
) -> None:
    changes = np.flatnonzero(np.r_[True, states[1:] != states[:-1]][: len(states)])
    at, values = t[changes], states[changes]
    target.rows(entity, at, lambda part: rr.StateChange.columns(state=values[part].tolist()))


def _shared(result: Result) -> Iterator[Lane]:
    """Yield what is the same for every observer."""
    estimates = result.estimates
    turning = np.linalg.norm(estimates.angular_velocity, axis=1) > REST
    moving = recent(estimates.t, turning, REST_AFTER)
    yield "motion", np.where(moving, "moving", "rest"), {"moving": QUIET, "rest": GOOD}
    for name, used in zip(result.samples.names, estimates.updated.T, strict=True):
        words = np.where(recent(estimates.t, used, WINDOW), "used", "not used")
        yield f"vectors/{topic_name(name)}", words, {"used": GOOD, "not used": MIDDLING}


def _run(result: Result) -> NDArray[np.str_]:
    """Tell of each estimate how far off it is, and of the last before a gap that one follows."""
    t, samples, metrics = result.estimates.t, result.samples, result.metrics
    states = np.full(len(t), "no reference")
    if metrics is not None:
        total = metrics.error_deg[:, 0]
        states[np.isfinite(total)] = "error"
        states[total < metrics.settling_bound_deg] = "converged"
    at = np.searchsorted(t, samples.t[samples.restart])
    states[at[at > 0] - 1] = "gap"
    return states
