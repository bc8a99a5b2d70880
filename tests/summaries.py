"""Summaries of batches that were never run."""

from datetime import UTC, datetime, timedelta
from hashlib import sha256

import numpy as np

from attest.batch.summary import write_summary

BEGAN = datetime(2026, 1, 1, 12, tzinfo=UTC)


def row(flight, vehicle="one", **more):
    """Return the row of a flight, one a day."""
    path = f"/flights/{vehicle}/{flight:04d}.BIN"
    return {
        "path": path,
        "observer": "fts",
        "sha256": sha256(path.encode()).hexdigest(),
        "status": "ok",
        "vehicle": vehicle,
        "began_utc": (BEGAN + timedelta(days=flight)).isoformat(),
        "reference": "SIM",
        "version": "1.0.0",
    } | more


def steady(count, vehicle="one", seed=0, **more):
    """Return the rows of a vehicle with nothing wrong."""
    rng = np.random.default_rng([seed, *vehicle.encode()])
    draws = rng.normal(size=(count, 8))
    return [
        row(
            i,
            vehicle,
            gyro_bias_x=0.01 + 0.001 * z[0],
            gyro_bias_y=0.001 * z[1],
            hard_iron_x_ut=3.0 + z[2],
            hard_iron_z_ut=z[3],
            field_ut_median=48.0 + z[4],
            field_ut_model=49.0,
            total_rmse_deg=2.0 * np.exp(0.2 * z[5]),
            heading_offset_deg=z[6],
            mag_latency_s=max(0.0, 0.1 * z[7]),
            **more,
        )
        for i, z in enumerate(draws)
    ]


def write(folder, rows):
    """Write a summary as a batch does, and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_summary(iter(rows), folder)
    return folder
