"""Canonical CSV: one row per moment, empty cells where a signal has no sample then.

Stamps are decimal and exact, seconds of UTC since 1970 where the flight has a date.
"""

from collections.abc import Mapping

import numpy as np

from attest.simulation.flight import Array, Flight, Times

Table = Mapping[str, tuple[Times, Array]]
"""Times and values of each group of columns."""

_COLUMNS = {
    "ref": ("ref_qw", "ref_qx", "ref_qy", "ref_qz"),
    "position": ("lat_deg", "lon_deg", "alt_m"),
    "velocity": ("vel_x", "vel_y", "vel_z"),
}
_FACTORS = {"mag": 1e6}  # from SI: the file has µT


def encode(flight: Flight) -> bytes:
    """Serialise signals and truth; every float reads back as it was (the field within rounding)."""
    table = {name: (signal.t, signal.y) for name, signal in flight.truth.items()}
    for name, signal in flight.signals.items():
        heard = flight.received(signal.t)
        table[name] = (signal.t[heard], signal.y[heard] * _FACTORS.get(name, 1.0))
    return _encode(table | {"ref": (flight.t, flight.q)}, flight.utc_offset)


def encode_truth(flight: Flight) -> bytes:
    """Serialise true attitude, as ``gyro`` true angular velocity, and other truth, to 1e-9."""
    table = {"gyro": (flight.t, flight.omega), "ref": (flight.t, flight.q)}
    others = {name: (signal.t, signal.y) for name, signal in flight.truth.items()}
    return _encode(table | others, flight.utc_offset, 9)


def _encode(table: Table, utc_offset: int | None, decimals: int | None = None) -> bytes:
    """Merge the columns on their times; decimals None is the shortest exact text."""
    clock = np.unique(np.concatenate([t for t, _ in table.values()]))
    header = [column for name in table for column in _columns(name)]
    cells = [_cells(clock, t, y, decimals) for t, y in table.values()]
    stamps = [_seconds(t + (utc_offset or 0)) for t in clock.tolist()]
    lines = [",".join(("time_s", *header)), *map(",".join, zip(stamps, *cells, strict=True))]
    return ("\n".join(lines) + "\n").encode()


def _columns(name: str) -> tuple[str, ...]:
    return _COLUMNS.get(name, tuple(f"{name}_{axis}" for axis in "xyz"))


def _cells(clock: Times, t: Times, y: Array, decimals: int | None) -> list[str]:
    """Text of one group for every row, empty where it has no sample."""
    digits = "" if decimals is None else f".{decimals}f"
    y = y if decimals is None else np.round(y, decimals) + 0.0  # and no -0.0
    cells = ["," * (y.shape[1] - 1)] * len(clock)
    for row, values in zip(np.searchsorted(clock, t).tolist(), y.tolist(), strict=True):
        cells[row] = ",".join(format(value, digits) for value in values)
    return cells


def _seconds(t: int) -> str:
    """Decimal seconds of nanoseconds, exact."""
    return f"{t // 10**9}.{t % 10**9:09d}"
