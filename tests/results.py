"""A synthetic run: a minute of flight, an estimate that settles, and a reference."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from attest.estimates import Estimates
from attest.geometry import quaternion
from attest.metrics import Metrics, Statistics
from attest.recording import Clock, Note, Recording, Reference, Signal
from attest.result import Result
from attest.samples import Samples

SECOND = 1_000_000_000
UTC = 1_700_000_000 * SECOND + 123_456_789
GRAVITY = np.array([0.0, 0.0, -1.0])
"""Specific force at rest, north-east-down."""
MAGNETIC = np.array([0.45, 0.03, 0.89])
FIELD = 48e-6


def result(n=3000, *, rate=50.0, reference=True, mag=True, accel=True, utc=UTC, start=5 * SECOND):
    """Make a run of n estimates, with a gap of two seconds in its second half."""
    rng = np.random.default_rng(7)
    t = start + (np.arange(n) * SECOND / rate).astype(np.int64)
    t[(2 * n) // 3 :] += 2 * SECOND
    seconds = (t - start) * 1e-9
    q_true = true_attitude(seconds)
    estimates = made_estimates(rng, t, seconds, q_true)
    signals = {"gyro": Signal(t, estimates.angular_velocity + estimates.gyro_bias, "RAW_IMU")}
    if accel:
        signals["accel"] = measured(rng, t, q_true, 9.81 * GRAVITY, 0.3)
    if mag:
        every = slice(None, None, 5)
        world = FIELD * MAGNETIC / np.linalg.norm(MAGNETIC)
        signals["mag"] = measured(rng, t[every], q_true[every], world, 4e-7)
    known = Reference("SIMSTATE", "truth", t, q_true)
    recording = Recording(
        path=Path("flight.tlog"),
        format="tlog",
        signals=signals,
        references={known.name: known} if reference else {},
        clock=Clock("autopilot boot clock", utc),
        vehicle="system 1, quadrotor, ArduPilot",
    )
    metrics = made_metrics(known.name, estimates, q_true) if reference else None
    return Result(
        recording=recording,
        samples=made_samples(estimates, q_true),
        estimates=estimates,
        reference=known if reference else None,
        metrics=metrics,
        configuration={"observer": "fts", "gains": {"k_p": 2.0, "p": 1.1}, "weights": [3.0, 2.0]},
        notes=(Note("frames with a bad CRC skipped", 12), Note("gap over 1 s", 1, doubt=True)),
        summary=made_summary(metrics),
    )


def with_reference_kind(made, kind):
    """Turn the reference to another kind."""
    return replace(
        made,
        reference=replace(made.reference, kind=kind),
        metrics=replace(made.metrics, kind=kind),
    )


def true_attitude(seconds):
    """Roll, pitch and turn slowly."""
    roll = 0.35 * np.sin(0.8 * seconds)
    pitch = 0.2 * np.sin(0.5 * seconds + 1.0)
    return quaternion.continuous(quaternion.from_euler(roll, pitch, 0.12 * seconds))


def made_estimates(rng, t, seconds, q_true):
    """Start 25 degrees off, settle within seconds, and stay a degree off."""
    n = len(t)
    axis = np.array([0.6, -0.3, 0.74])
    wander = 0.012 * np.stack([np.sin(0.3 * seconds + k) for k in range(3)], axis=1)
    off = 0.44 * np.exp(-0.7 * seconds)[:, np.newaxis] * axis + wander
    noise = np.abs(rng.normal(size=n))
    bias = np.array([0.01, -0.02, 0.005]) * (1 - np.exp(-0.2 * seconds))[:, np.newaxis]
    updated = np.ones((n, 2), bool)
    updated[n // 4 : n // 3, 1] = False
    return Estimates(
        observer="fts",
        t=t,
        q=quaternion.multiply(quaternion.exp(off), q_true),
        angular_velocity=np.gradient(
            np.unwrap(quaternion.to_euler(q_true), axis=0), seconds, axis=0
        ),
        gyro_bias=bias,
        s_norm=0.9 * np.exp(-0.7 * seconds) + 0.01 * noise,
        cost=0.4 * np.exp(-1.4 * seconds) + 1e-4 * noise,
        updated=updated,
        states={"disturbance_torque": 0.01 * wander, "step_size": np.full(n, 0.02)},
    )


def measured(rng, t, q, world, sigma):
    """Turn a vector of the world to the body, with noise."""
    body = quaternion.rotate(quaternion.conjugate(q), world)
    return Signal(t, body + sigma * rng.normal(size=body.shape), "RAW_IMU")


def made_samples(estimates, q_true):
    """Lay the two directions on the estimate's own times."""
    inertial = np.stack([GRAVITY, MAGNETIC / np.linalg.norm(MAGNETIC)])[np.newaxis]
    body = quaternion.rotate(quaternion.conjugate(q_true)[:, np.newaxis], inertial)
    restart = np.r_[True, np.diff(estimates.t) > SECOND]
    return Samples(
        t=estimates.t,
        gyro=estimates.angular_velocity + estimates.gyro_bias,
        body=body * estimates.updated[:, :, np.newaxis],
        inertial=inertial,
        valid=estimates.updated,
        names=("accel", "mag"),
        substeps=np.ones(len(estimates.t), np.int64),
        restart=restart,
    )


def made_metrics(name, estimates, q_true):
    """Score the estimate, but for the last tenth, where the reference has ended."""
    q_ref = q_true.copy()
    q_ref[int(0.9 * len(q_ref)) :] = np.nan
    w, x, y, z = quaternion.multiply(estimates.q, quaternion.conjugate(q_ref)).T
    angles = [
        2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), np.abs(w)),
        2.0 * np.arctan2(np.abs(z), np.abs(w)),
        2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z)),
    ]
    error = np.degrees(np.stack(angles, axis=1))
    scored = error[np.isfinite(error[:, 0])]
    total, heading, inclination = (statistics(column) for column in scored.T)
    return Metrics(
        reference=name,
        kind="truth",
        q_ref=q_ref,
        error_deg=error,
        scored=len(scored),
        total=total,
        heading=heading,
        inclination=inclination,
        heading_offset_deg=0.4,
        without_heading_offset=total,
        settling_bound_deg=3.0,
        settling_time_s=3.5,
        after_settling=total,
        time_offset_s=0.012,
        misalignment_deg=0.3,
        misalignment=(1.0, 0.0, 0.0, 0.0),
        bias_true=(0.01, -0.02, 0.005),
        bias_error=0.0004,
    )


def statistics(e):
    """Summarise one error."""
    if not len(e):
        return Statistics(*[float("nan")] * 5)
    rmse = float(np.sqrt(np.mean(e * e)))
    return Statistics(
        rmse, float(e.mean()), float(np.median(e)), float(np.percentile(e, 95)), e.max()
    )


def made_summary(metrics):
    """Make a summary of the shape that a run gives, with a NaN in it."""
    return {
        "schema": 1,
        "log": {"path": "flight.tlog", "sha256": "ab" * 32, "format": "tlog", "duration_s": 62.0},
        "observer": "fts",
        "metrics": metrics and {"total": {"rmse_deg": metrics.total.rmse}, "dip": float("nan")},
        "versions": {"attest": "0.1.0", "python": "3.11"},
    }
