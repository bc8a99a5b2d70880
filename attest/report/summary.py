"""The JSON document of a run, ``schema: 1``: the contract for scripts."""

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import attest
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.metrics import Metrics, Statistics
from attest.report.info import describe, notes
from attest.result import Result
from attest.samples import Samples

Array = NDArray[np.float64]

LIBRARIES = ("numpy", "numba", "pymavlink", "mcap", "rerun-sdk")


def summarise(result: Result, timing: Mapping[str, float]) -> dict[str, Any]:
    """Return the document; only ``timing`` differs between equal runs."""
    recording = result.recording
    info = describe(recording)
    estimates = result.estimates
    return {
        "schema": 1,
        "log": {"sha256": sha256(recording.path)}
        | {key: value for key, value in info.items() if key not in {"notes", "warnings"}},
        "observer": estimates.observer,
        "configuration": result.configuration,
        "reference": _reference(result),
        "estimates": {
            "count": len(estimates.t),
            "first_ns": int(estimates.t[0]),
            "last_ns": int(estimates.t[-1]),
            "gyro_bias": None if estimates.gyro_bias is None else estimates.gyro_bias[-1].tolist(),
            "lyapunov_growth": _growth(result),
        },
        "metrics": None if result.metrics is None else _metrics(result.metrics),
        "consistency": _consistency(result),
        "sensors": _sensors(result),
        "disturbance_torque": _disturbance(result),
        "attestation": [asdict(claim) for claim in result.claims],
        **notes(result.notes),
        "timing": {f"{stage}_s": round(seconds, 4) for stage, seconds in timing.items()},
        "versions": versions(),
    }


def sha256(path: Path) -> str:
    """Return the digest of a file, or of a folder's files in name order.

    Raises
    ------
    ReadError
        The file cannot be read any more.
    """
    try:
        if path.is_dir():
            return _digest_of_folder(path)
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ReadError(f"{path}: {error.strerror}. It was there when the run began.") from error


def _digest_of_folder(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.iterdir() if path.is_file()):
        digest.update(path.name.encode("utf-8", "surrogateescape") + b"\0")
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Return what the numbers depend on."""
    libraries = {name: version(name) for name in LIBRARIES}
    return {"attest": attest.__version__, "python": platform.python_version(), **libraries}


def _reference(result: Result) -> dict[str, Any] | None:
    if result.reference is None:
        return None
    name, kind = result.reference.name, result.reference.kind
    return {"name": name, "kind": kind, "independent": kind == "truth"}


def _metrics(metrics: Metrics) -> dict[str, Any]:
    """Return the figures of `Metrics`, without its series."""
    series = {"q_ref", "error_deg"}
    figures = {name: getattr(metrics, name) for name in Metrics.__slots__ if name not in series}
    return {
        name: asdict(value) if isinstance(value, Statistics) else value
        for name, value in figures.items()
    }


def _consistency(result: Result) -> dict[str, Any]:
    """Return what can be said without a reference."""
    estimates, samples = result.estimates, result.samples
    used = estimates.updated.mean(axis=0).tolist() if estimates.updated.size else []
    figures: dict[str, Any] = {
        "s_norm_rms": float(np.sqrt(np.mean(estimates.s_norm**2))),
        "cost_mean": float(np.mean(estimates.cost)),
        "used": dict(zip(samples.names, used, strict=True)),
    }
    if "mag" in result.recording.signals:
        norm = np.linalg.norm(result.recording.signals["mag"].y, axis=1) * 1e6
        spread = float(np.percentile(norm, 95) - np.percentile(norm, 5))
        alone = result.recording.tells("field strength")  # a direction, whose length tells nothing
        figures["field_ut_median"] = None if alone else float(np.median(norm))
        figures["field_ut_spread"] = None if alone else spread
    return figures | _against_model(result)


def _sensors(result: Result) -> dict[str, Any]:
    """Return the sensors' own errors, with those that the observer found besides."""
    found, constants = result.samples.sensors, result.estimates.constants
    scale, hard, iron = found.gyro_scale, found.hard_iron, found.iron
    if scale is None and "gyro_scale" in constants:
        scale = np.diag(constants["gyro_scale"])
    if "hard_iron" in constants:
        left = _usual(result.samples) * constants["hard_iron"]
        hard = left if hard is None or iron == "found" else _together(hard, found.soft_iron, left)
        iron = "given" if iron == "given" else "applied"
    return {
        "gyro_scale": _numbers(scale),
        "mag_latency_s": found.mag_latency_s,
        "hard_iron_ut": None if hard is None else _numbers(1e6 * hard),
        "soft_iron": None if found.soft_iron is None else found.soft_iron.tolist(),
        "iron": None if hard is None else iron,
    }


def _together(hard: Array, soft: Array | None, left: Array) -> Array:
    """Return the hard iron, tesla, (3,), of what was taken off before and of what that left."""
    return hard + (left if soft is None else np.linalg.solve(soft, left))


def _usual(samples: Samples) -> float:
    """Return the field's usual length, tesla; NaN where the log has none."""
    if samples.length is None or "mag" not in samples.names:
        return np.nan
    column = samples.names.index("mag")
    seen = samples.length[samples.valid[:, column], column]
    return float(np.median(seen)) if len(seen) else np.nan


def _numbers(values: Array | None) -> list[float | None] | None:
    """Return numbers as JSON has them, or None where there is none."""
    if values is None or not np.isfinite(values).any():
        return None
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _disturbance(result: Result) -> dict[str, Any] | None:
    """Return the disturbance torque at the end, N·m, and its error where the log has the truth."""
    estimates, recording = result.estimates, result.recording
    found = estimates.states.get("disturbance_torque")
    if found is None:
        return None
    figures: dict[str, Any] = {"last_nm": found[-1].tolist(), "rmse_nm": None}
    true = recording.signals.get("disturbance_torque")
    plant = result.configuration.get("plant")
    known = isinstance(plant, Mapping) and plant.get("inertia") is not None
    if true is not None and known:
        at, told = (t - true.t[0] for t in (estimates.t, true.t))
        off = found - np.stack([np.interp(at, told, column) for column in true.y.T], axis=1)
        within = (at >= 0) & (at <= told[-1])
        if within.any():
            figures["rmse_nm"] = float(np.sqrt(np.mean(np.sum(off[within] ** 2, axis=1))))
    return figures


def _against_model(result: Result) -> dict[str, Any]:
    """Return strength and dip of the field by the model, and the dip that the estimate gives."""
    samples = result.samples
    if samples.field is None or "mag" not in samples.names:
        return {}
    column = samples.names.index("mag")
    body = samples.body if samples.measured is None else samples.measured
    seen = quaternion.rotate(result.estimates.q, body[:, column])[samples.valid[:, column]]
    down = 1.0 if result.recording.world == "ned" else -1.0
    strength = float(np.linalg.norm(samples.field))
    return {
        "field_ut_model": strength * 1e6,
        "dip_deg_model": float(np.rad2deg(np.arcsin(down * samples.field[2] / strength))),
        "dip_deg_median": float(np.rad2deg(np.arcsin(np.clip(down * np.median(seen[:, 2]), -1, 1))))
        if len(seen)
        else None,
    }


def _growth(result: Result) -> float | None:
    """Return the most that the Lyapunov function grew in one step; rounding is right."""
    V, within = result.estimates.lyapunov, ~result.samples.restart[1:]
    return None if V is None or not within.any() else float(np.diff(V)[within].max())
