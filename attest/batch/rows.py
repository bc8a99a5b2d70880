"""What is told of one log and one observer: a flat row, JSON-like."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import attest

if TYPE_CHECKING:
    from attest.batch.task import Task

Row = dict[str, Any]

ERRORS = tuple(
    f"{error}_{figure}_deg"
    for error in ("total", "heading", "inclination")
    for figure in ("rmse", "mean", "median", "p95", "max")
)
TEXTS = (
    "path",
    "observer",
    "sha256",
    "status",
    "error",
    "format",
    "vehicle",
    "vehicle_id",
    "began_utc",
)
VECTORS: Mapping[str, tuple[str, ...]] = {
    "gyro_bias": ("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
    "hard_iron_ut": ("hard_iron_x_ut", "hard_iron_y_ut", "hard_iron_z_ut"),
    "gyro_scale": ("gyro_scale_x", "gyro_scale_y", "gyro_scale_z"),
}
"""The columns of what has axes."""
RATES = ("gyro_hz", "accel_hz", "mag_hz")
FIGURES = (
    *ERRORS,
    "heading_offset_deg",
    "without_heading_offset_rmse_deg",
    "settling_time_s",
    "after_settling_rmse_deg",
    "time_offset_s",
    "misalignment_deg",
    *VECTORS["gyro_bias"],
    "bias_error",
    "s_norm_rms",
    "cost_mean",
    "field_ut_median",
    "field_ut_model",
    *VECTORS["hard_iron_ut"],
    "soft_iron",
    "mag_latency_s",
    *VECTORS["gyro_scale"],
)
STAGES = ("reading_s", "smoothing_s", "conditioning_s", "observing_s", "evaluating_s")
DURATIONS = (*STAGES, "writing_s", "total_s")
TIMING = ("ran_utc", *DURATIONS)
"""What differs between equal runs."""

COLUMNS: Mapping[str, str] = {
    **dict.fromkeys(TEXTS, "text"),
    "duration_s": "float",
    **dict.fromkeys(RATES, "float"),
    "reference": "text",
    "reference_kind": "text",
    "scored": "int",
    **dict.fromkeys(FIGURES, "float"),
    "iron": "text",
    "promises_kept": "int",
    "promises_broken": "int",
    "warnings_count": "int",
    "warnings": "text",
    "folder": "text",
    "outputs": "text",
    "version": "text",
    "digest": "text",
    "ran_utc": "text",
    **dict.fromkeys(DURATIONS, "float"),
}
"""The columns of the summary, and what is in them."""


def finished(
    task: "Task", label: str, summary: Mapping[str, Any], outputs: Sequence[str], writing_s: float
) -> Row:
    """Return the row of a run that came to its end."""
    timing = summary["timing"] | {"writing_s": round(writing_s, 4)}
    return _stub(task, label) | {
        "status": "ok",
        "error": None,
        "final": True,
        "outputs": list(outputs),
        **_log(summary),
        **_figures(summary),
        **{key: timing.get(key) for key in DURATIONS},
    }


def unfinished(task: "Task", label: str, status: str, error: str) -> Row:
    """Return the row of a run that did not come to its end."""
    return _stub(task, label) | {"status": status, "error": error, "outputs": [], "final": True}


def _stub(task: "Task", label: str) -> Row:
    """Return what is known of a run before it begins."""
    return {
        "path": task.log,
        "observer": label,
        "folder": task.folder,
        "size": task.size,
        "mtime_ns": task.mtime_ns,
        "etag": task.etag,
        "digest": task.digests[label],
        "version": attest.__version__,
        "kinds": list(task.kinds),
        "ran_utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
    }


def _log(summary: Mapping[str, Any]) -> Row:
    log = summary["log"]
    signals = log["signals"]
    warnings = [str(warning["text"]) for warning in summary["warnings"]]
    return {
        "format": log["format"],
        "vehicle": log["vehicle"],
        "vehicle_id": log["vehicle_id"],
        "began_utc": _utc(summary["estimates"]["first_ns"], log["clock"]["utc_offset_ns"]),
        "duration_s": round(log["duration_s"], 6),
        **{key: signals.get(key.removesuffix("_hz"), {}).get("rate_hz") for key in RATES},
        "warnings_count": len(warnings),
        "warnings": "; ".join(warnings),
    }


def _utc(first_ns: int, offset_ns: int | None) -> str | None:
    """Return when the first estimate is, in UTC to the second; None where the log does not tell."""
    if offset_ns is None:
        return None
    try:
        return datetime.fromtimestamp((first_ns + offset_ns) // 10**9, UTC).isoformat()
    except (ValueError, OverflowError, OSError):  # a clock that was never set
        return None


def _figures(summary: Mapping[str, Any]) -> Row:
    """Return reference, errors and what holds without one."""
    metrics, consistency = summary["metrics"] or {}, summary["consistency"]
    reference = summary["reference"] or {}
    sensors = summary["sensors"] | {"gyro_bias": summary["estimates"]["gyro_bias"]}
    soft = sensors["soft_iron"]
    held = [claim["holds"] for claim in summary["attestation"]]
    figures = {**metrics, **consistency, **dict(_flat(metrics))}
    figures["mag_latency_s"] = sensors["mag_latency_s"]
    for name, columns in VECTORS.items():
        figures |= dict(zip(columns, sensors[name] or (None, None, None), strict=True))
    figures["soft_iron"] = None if soft is None else _most_of(soft)
    return {
        "reference": reference.get("name"),
        "reference_kind": reference.get("kind"),
        "scored": metrics.get("scored"),
        **{key: figures.get(key) for key in FIGURES},
        "iron": sensors["iron"],
        "promises_kept": held.count(True),
        "promises_broken": held.count(False),
    }


def _most_of(soft: Sequence[Sequence[float]]) -> float:
    """Return the most by which soft iron is not the identity."""
    return max(abs(soft[i][j] - (i == j)) for i in range(3) for j in range(3))


def _flat(metrics: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the figures of each error, such as ``total_rmse_deg``."""
    for name, statistics in metrics.items():
        if isinstance(statistics, Mapping):
            for figure, value in statistics.items():
                yield f"{name}_{figure}_deg", value
