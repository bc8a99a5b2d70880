"""How far an observer with candidate gains is from the references of the logs.

Each log is read once. Conditioned samples are kept as well, unless keys of conditioning are tuned.

A log's samples are of a block each; a part is a union of blocks: all of them, all but one, or one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest import conditioning, evaluation, observers, pipeline
from attest.config import Configuration
from attest.errors import ConfigError, ReadError
from attest.recording import Recording, Reference
from attest.samples import Samples

Array = NDArray[np.float64]

METRICS = ("total", "heading", "inclination")
NOWHERE = -1
"""The block of a sample that is not scored."""
ALIKE = 0.1
"""Share of the spread of the angular speed by which one flight may differ from log to log."""


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """A log, ready for an observer."""

    path: Path
    recording: Recording | None
    """None where its conditioning never changes."""
    samples: Samples
    reference: Reference
    q_ref: Array
    """The reference at the samples, NaN where it has none, shape (n, 4)."""
    scored: NDArray[np.bool_]
    """Which samples are scored, shape (n,)."""
    doubts: tuple[str, ...]
    """What is doubtful about its data."""
    vehicle: tuple[str, str]
    """The log's format, and how that names its vehicle."""
    utc: tuple[int, int] | None
    """When it begins and ends, nanoseconds since 1970; None where that is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What candidates are scored by."""

    logs: tuple[Log, ...]
    blocks: tuple[NDArray[np.int64], ...]
    """The block of each sample of each log, `NOWHERE` where it is not scored."""
    parts: NDArray[np.bool_]
    """Which blocks each part has, shape (parts, blocks)."""
    metric: str


def prepare(path: Path, configuration: Configuration, skip_s: float, *, reconditioned: bool) -> Log:
    """Read and condition a log, and bring its reference to its samples.

    The recording is kept where candidates differ in their conditioning.

    Raises
    ------
    ReadError
        It cannot be used, has no reference, or no direction that gains could weigh.
    """
    recording, reference = pipeline.referenced(path, configuration, {}, None)
    if reference is None:
        raise ReadError(
            f"{path}: no reference to tune towards. Name a file that has it with --reference."
        )
    samples, notes = conditioning.condition(recording, configuration)
    if not samples.valid.any():
        raise ReadError(
            f"{path}: no direction beside the gyroscope, so that no gain matters. Leave it out."
        )
    if configuration.evaluation.apply_time_offset:
        estimates = observers.get(configuration.observer).estimate(samples, configuration)
        _, reference, _ = evaluation.in_time(estimates, reference, configuration.evaluation)
    q_ref = evaluation.interpolated(reference, samples.t, configuration.evaluation)
    told = [*recording.notes, *notes]
    return Log(
        path=path,
        recording=recording if reconditioned else None,
        samples=samples,
        reference=reference,
        q_ref=q_ref,
        scored=_scored(path, samples, q_ref, skip_s),
        doubts=tuple(note.text for note in told if note.doubt),
        vehicle=(recording.format, recording.vehicle),
        utc=_utc(recording, samples),
    )


def _utc(recording: Recording, samples: Samples) -> tuple[int, int] | None:
    offset = recording.clock.utc_offset
    if offset is None:
        return None
    return int(samples.t[0]) + offset, int(samples.t[-1]) + offset


def _scored(path: Path, samples: Samples, q_ref: Array, skip_s: float) -> NDArray[np.bool_]:
    told = np.isfinite(q_ref).all(axis=1)
    if not told.any():
        raise ReadError(
            f"{path}: its reference shares no time with the gyroscope. Name one with --reference, "
            "or set evaluation.reference_shift_s to auto or to seconds."
        )
    scored: NDArray[np.bool_] = told & (samples.t - samples.t[0] >= skip_s * 1e9)
    if not scored.any():
        raise ReadError(f"{path}: no reference after the first {skip_s:g} s. Lower --skip.")
    return scored


def doubted_copies(logs: Sequence[Log], folds: int) -> tuple[Log, ...]:
    """Add to the doubts of a log that it is of the same flight as one of another fold before it.

    Those of one fold are held back together.
    """
    return tuple(
        _doubted(log, [other for j, other in enumerate(logs[:i]) if (i - j) % folds])
        for i, log in enumerate(logs)
    )


def _doubted(log: Log, others: Sequence[Log]) -> Log:
    told = {
        "the same flight as {}: held back, it is known by that one": _same_flight,
        "its time overlaps that of {}: if that is the same flight, it is known by it": _overlap,
    }
    for doubt, alike in told.items():
        same = next((other for other in others if alike(other, log)), None)
        if same is not None:
            return replace(log, doubts=(*log.doubts, doubt.format(same.path.name)))
    return log


def _overlap(one: Log, other: Log) -> bool:
    """Whether two logs are of one time, and not of two vehicles as far as that is known."""
    if one.utc is None or other.utc is None:
        return False
    (a, b), (c, d) = one.utc, other.utc
    # how vehicles are named tells them apart within one format only
    apart = one.vehicle != other.vehicle and one.vehicle[0] == other.vehicle[0]
    return a < d and c < b and not apart


def _same_flight(one: Log, other: Log) -> bool:
    """Whether two logs, on whatever clocks and axes, last equally long and turn alike."""
    a, b = one.samples, other.samples
    length = int(np.ptp(a.t))
    if len(a.t) != len(b.t) or abs(int(np.ptp(b.t)) - length) * len(a.t) > length:
        return False
    speed = np.linalg.norm(a.gyro, axis=1)
    apart = np.std(speed - np.linalg.norm(b.gyro, axis=1))
    return bool(apart < ALIKE * np.std(speed))


def in_time(log: Log, count: int) -> NDArray[np.int64]:
    """Return the blocks of a log's samples, `count` of them of equal length one after another."""
    t = log.samples.t
    first, last = (int(x) for x in t[log.scored][[0, -1]])
    block = np.minimum((t - first) * count // max(last - first, 1), count - 1)
    return np.where(log.scored, block, NOWHERE)


def as_one(log: Log, block: int) -> NDArray[np.int64]:
    """Return the blocks of a log's samples, all of them the same."""
    return np.where(log.scored, block, NOWHERE)


def counts(task: Task) -> Array:
    """Return how many samples are scored, shape (logs, parts)."""
    each = [np.bincount(b[b != NOWHERE], minlength=task.parts.shape[1]) for b in task.blocks]
    return np.array(each, float) @ task.parts.T


def squares(task: Task, configuration: Configuration) -> Array:
    """Return the sums of squared errors, degrees², shape (logs, parts).

    Raises
    ------
    AttestError
        The observer does not run with this configuration, or its estimates are no numbers.
    """
    with np.errstate(all="ignore"):  # a candidate may well diverge
        found = np.stack(
            [
                _of_log(task, log, block, configuration)
                for log, block in zip(task.logs, task.blocks, strict=True)
            ]
        )
    if not np.isfinite(found).all():
        raise ConfigError(f"{configuration.observer}: the errors are no numbers. Lower the gains.")
    return found


def _of_log(task: Task, log: Log, block: NDArray[np.int64], configuration: Configuration) -> Array:
    """Return a log's sums, shape (parts,).

    Constants that the evaluation takes out are those of each part, so that no part tells another.
    """
    samples = log.samples
    if log.recording is not None:
        samples, _ = conditioning.condition(log.recording, configuration)
        if not np.array_equal(samples.t, log.samples.t):
            raise ConfigError("the candidate's conditioning changes the times that are scored.")
    q = observers.get(configuration.observer).estimate(samples, configuration).q
    scored, column = block != NOWHERE, METRICS.index(task.metric)
    if not _takes_out(configuration):
        square = _square(q, log, scored, configuration, column)
        return np.bincount(block[scored], square, task.parts.shape[1]).astype(float) @ task.parts.T
    # parts that have the same blocks of this log are scored once
    there = np.unique(block[scored])
    kinds, which = np.unique(task.parts[:, there], axis=0, return_inverse=True)
    sums = np.zeros(len(kinds))
    for i, kind in enumerate(kinds):
        at = scored & np.isin(block, there[kind])
        sums[i] = _square(q, log, at, configuration, column).sum()
    return sums[which.reshape(-1)]


def _takes_out(configuration: Configuration) -> bool:
    evaluated = configuration.evaluation
    return evaluated.apply_heading_offset or evaluated.apply_misalignment


def _square(
    q: Array, log: Log, at: NDArray[np.bool_], configuration: Configuration, column: int
) -> Array:
    if not at.any():
        return np.zeros(0)
    error = evaluation.errors_deg(q[at], log.q_ref[at], configuration.evaluation)[:, column]
    return error**2


def mean_rmse(sums: Array, number: Array) -> float:
    """Return the mean over logs of the root mean square, degrees, of sums and counts (logs,)."""
    there = number > 0
    return float(np.mean(np.sqrt(sums[there] / number[there]))) if there.any() else np.nan
