"""Choose a reference, and score an estimate against it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.config import Evaluation
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.evaluation import errors, rates
from attest.geometry import quaternion
from attest.metrics import Metrics
from attest.recording import Note, Recording, Reference
from attest.samples import Samples

Array = NDArray[np.float64]

SECOND = 1_000_000_000


def choose(recording: Recording, name: str | None) -> Reference | None:
    """Return the reference of a name, the best one for None, and none for ``none``.

    Raises
    ------
    ConfigError
        The log has no reference of this name.
    """
    if name == "none" or (name is None and not recording.references):
        return None
    if name is None:
        return next(iter(recording.references.values()))
    if name not in recording.references:
        held = ", ".join(recording.references) or "none"
        raise ConfigError(f"{recording.path}: no reference {name!r}. The log has: {held}.")
    return recording.references[name]


def evaluate(
    samples: Samples, estimates: Estimates, reference: Reference | None, config: Evaluation
) -> tuple[Metrics | None, tuple[Note, ...]]:
    """Score an estimate; None without a reference, or where the two share no time.

    The reference is interpolated at the estimate's times, never across a gap.
    """
    if reference is None:
        return None, ()
    offset, reference, notes = _in_time(estimates, reference, config)
    q_ref = _interpolated(estimates, reference, config)
    scored = np.isfinite(q_ref).all(axis=1)
    if not scored.any():
        text = f"reference {reference.name!r} shares no time with the estimate: nothing to score"
        return None, (*notes, Note(text, doubt=True))
    q, r = estimates.q[scored], q_ref[scored]
    misalignment = errors.mean_rotation(quaternion.multiply(quaternion.conjugate(r), q))
    if config.apply_misalignment:
        q = quaternion.multiply(q, quaternion.conjugate(misalignment))
    q_e = errors.attitude_error(q, r)
    psi = errors.heading_offset(q_e)
    flat = errors.angles(errors.turned(q_e, psi))[:, 0]
    if config.apply_heading_offset:
        q_e = errors.turned(q_e, psi)
    error_deg = np.full((len(q_ref), 3), np.nan)
    error_deg[scored] = np.rad2deg(errors.angles(q_e))
    total, heading, inclination = (
        errors.statistics(error_deg[scored, column]) for column in range(3)
    )
    settled = errors.settling(error_deg[scored, 0], config.settling_bound_deg)
    measured = reference.kind == "truth" and bool(np.isfinite(samples.gyro).all())
    true = _true_bias(samples, q_ref) if measured else None
    metrics = Metrics(
        reference=reference.name,
        kind=reference.kind,
        q_ref=q_ref,
        error_deg=error_deg,
        scored=int(scored.sum()),
        total=total,
        heading=heading,
        inclination=inclination,
        heading_offset_deg=float(np.rad2deg(psi)),
        without_heading_offset=errors.statistics(np.rad2deg(flat)),
        settling_bound_deg=config.settling_bound_deg,
        settling_time_s=None if settled is None else _seconds(estimates.t[scored], settled),
        after_settling=None
        if settled is None
        else errors.statistics(error_deg[scored, 0][settled:]),
        time_offset_s=offset,
        misalignment_deg=float(np.rad2deg(errors.angles(misalignment)[0])),
        misalignment=(*misalignment.tolist(),),
        bias_true=None if true is None else (*true.tolist(),),
        bias_error=None
        if true is None or estimates.gyro_bias is None
        else float(np.linalg.norm(estimates.gyro_bias[-1] - true)),
    )
    return metrics, notes


def _in_time(
    estimates: Estimates, reference: Reference, config: Evaluation
) -> tuple[float | None, Reference, tuple[Note, ...]]:
    """Find the time offset of the reference, and shift it if that is asked for."""
    speed = np.linalg.norm(estimates.angular_velocity, axis=1)
    offset = rates.time_offset(estimates.t, speed, reference.t, reference.q, config.longest_gap_s)
    if not config.apply_time_offset or offset is None:
        return offset, reference, ()
    note = Note(f"reference {reference.name!r} shifted by {-offset:+.3f} s, as asked")
    return offset, replace(reference, t=reference.t - round(offset * SECOND)), (note,)


def _interpolated(estimates: Estimates, reference: Reference, config: Evaluation) -> Array:
    gap = round(min(config.longest_gap_s, 1e9) * SECOND)
    return quaternion.slerp(reference.t, reference.q, estimates.t, gap)


def _seconds(t: NDArray[np.int64], i: int) -> float:
    return float(t[i] - t[0]) * 1e-9


def _true_bias(samples: Samples, q_ref: Array) -> Array | None:
    """Return the constant gyroscope bias that truth implies, rad/s, shape (3,)."""
    # what the observers integrate: the gyroscope held, or the mean of two ends if sub-stepped
    ends = np.concatenate([samples.gyro[1:], samples.gyro[-1:]])
    divided = samples.substeps[:, np.newaxis] > 1
    held = np.where(divided, 0.5 * (samples.gyro + ends), samples.gyro)
    return rates.constant_bias(samples.t, held, q_ref)
