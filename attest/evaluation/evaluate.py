"""Choose a reference, and score an estimate against it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.config import Evaluation
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.evaluation import errors, rates
from attest.geometry import quaternion
from attest.metrics import Metrics, Statistics
from attest.recording import Note, Recording, Reference
from attest.samples import Samples, mean_rates

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
    offset, reference, notes = in_time(estimates, reference, config)
    q_ref = interpolated(reference, estimates.t, config)
    scored = np.isfinite(q_ref).all(axis=1)
    if not scored.any():
        return None, (*notes, *unshared(estimates.t, reference, config))
    apart = _apart(estimates.q[scored], q_ref[scored], config)
    error_deg = np.full((len(q_ref), 3), np.nan)
    error_deg[scored] = apart.error_deg
    total, heading, inclination = (
        errors.statistics(error_deg[scored, column]) for column in range(3)
    )
    settled, after = _settled(estimates.t[scored], error_deg[scored, 0], config)
    bias, bias_error = (
        _bias(samples, estimates, q_ref) if reference.kind == "truth" else (None, None)
    )
    metrics = Metrics(
        reference=reference.name,
        kind=reference.kind,
        q_ref=q_ref,
        error_deg=error_deg,
        scored=int(scored.sum()),
        total=total,
        heading=heading,
        inclination=inclination,
        heading_offset_deg=apart.heading_offset_deg,
        without_heading_offset=apart.without_heading_offset,
        settling_bound_deg=config.settling_bound_deg,
        settling_time_s=settled,
        after_settling=after,
        time_offset_s=offset,
        misalignment_deg=float(np.rad2deg(errors.angles(apart.misalignment)[0])),
        misalignment=(*apart.misalignment.tolist(),),
        bias_true=bias,
        bias_error=bias_error,
    )
    return metrics, notes


@dataclass(frozen=True, slots=True)
class _Apart:
    """How far two attitudes are apart, and what of it is constant."""

    error_deg: Array
    """Total, heading and inclination, as configured, shape (n, 3)."""
    heading_offset_deg: float
    without_heading_offset: Statistics
    misalignment: Array


def _apart(q: Array, r: Array, config: Evaluation) -> _Apart:
    """Compare the attitudes q with r, shapes (n, 4)."""
    error_deg = errors_deg(q, r, config)
    misalignment = errors.mean_rotation(quaternion.multiply(quaternion.conjugate(r), q))
    if config.apply_misalignment:
        q = quaternion.multiply(q, quaternion.conjugate(misalignment))
    q_e = errors.attitude_error(q, r)
    psi = errors.heading_offset(q_e)
    turned = errors.turned(q_e, psi)
    flat = errors.angles(turned)[:, 0]
    return _Apart(
        error_deg=error_deg,
        heading_offset_deg=float(np.rad2deg(psi)),
        without_heading_offset=errors.statistics(np.rad2deg(flat)),
        misalignment=misalignment,
    )


def _settled(
    t: NDArray[np.int64], total_deg: Array, config: Evaluation
) -> tuple[float | None, Statistics | None]:
    """Return when the total error stays below the bound, s, and what it is from then on."""
    first = errors.settling(total_deg, config.settling_bound_deg)
    if first is None:
        return None, None
    return float(t[first] - t[0]) * 1e-9, errors.statistics(total_deg[first:])


def unshared(
    t: NDArray[np.int64], reference: Reference | None, config: Evaluation
) -> tuple[Note, ...]:
    """Doubt a reference that shares none of the times at which it is to be compared."""
    if reference is None or np.isfinite(interpolated(reference, t, config)).any():
        return ()
    text = (
        f"reference {reference.name!r} shares no time with the estimate: nothing to score. If its "
        "clock is another one: --set evaluation.reference_shift_s=auto, or the seconds to add to it"
    )
    return (Note(text, doubt=True),)


def in_time(
    estimates: Estimates, reference: Reference, config: Evaluation
) -> tuple[float | None, Reference, tuple[Note, ...]]:
    """Find the time offset of the reference, and shift it if that is asked for."""
    speed = np.linalg.norm(estimates.angular_velocity, axis=1)
    offset = rates.time_offset(estimates.t, speed, reference.t, reference.q, config.longest_gap_s)
    if not config.apply_time_offset or offset is None:
        return offset, reference, ()
    note = Note(f"reference {reference.name!r} shifted by {-offset:+.3f} s, as asked")
    return offset, replace(reference, t=reference.t - round(offset * SECOND)), (note,)


def interpolated(reference: Reference, t: NDArray[np.int64], config: Evaluation) -> Array:
    """Return the reference at these times, NaN where it has a gap, shape (n, 4)."""
    gap = round(min(config.longest_gap_s, 1e9) * SECOND)
    return quaternion.slerp(reference.t, reference.q, t, gap)


def errors_deg(q: Array, r: Array, config: Evaluation) -> Array:
    """Return total, heading and inclination error of q against r, as configured, shape (n, 3)."""
    if config.apply_misalignment:
        misalignment = errors.mean_rotation(quaternion.multiply(quaternion.conjugate(r), q))
        q = quaternion.multiply(q, quaternion.conjugate(misalignment))
    q_e = errors.attitude_error(q, r)
    if config.apply_heading_offset:
        q_e = errors.turned(q_e, errors.heading_offset(q_e))
    found: Array = np.rad2deg(errors.angles(q_e))
    return found


def _bias(
    samples: Samples, estimates: Estimates, q_ref: Array
) -> tuple[tuple[float, float, float] | None, float | None]:
    """Return the gyroscope's bias that truth implies, and the estimate's error at the end."""
    true = _true_bias(samples, q_ref) if np.isfinite(samples.gyro).all() else None
    if true is None:
        return None, None
    found = estimates.gyro_bias
    error = None if found is None else float(np.linalg.norm(found[-1] - true))
    return (*true.tolist(),), error


def _true_bias(samples: Samples, q_ref: Array) -> Array | None:
    """Return the constant gyroscope bias that truth implies, rad/s, shape (3,)."""
    # what the observers integrate: the gyroscope held, or the mean of two ends if sub-stepped
    divided = samples.substeps[:, np.newaxis] > 1
    held = np.where(divided, mean_rates(samples), samples.gyro)
    found = rates.constant_bias(samples.t, held, q_ref)
    if found is None or samples.bias is None:
        return found
    whole: Array = found + samples.bias.mean(axis=0)
    return whole
