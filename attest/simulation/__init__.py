"""Logs with known truth, made to order and the same bytes again for the same seed.

    simulate(scenario, seed) -> Flight -> write(path, flight)

A scenario is one module with ``simulate(seed)``, imported when asked for, and one line in
`_MODULES`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from attest.errors import ConfigError
from attest.files import replacing

if TYPE_CHECKING:
    from attest.simulation.flight import Flight

_MODULES = {"quadcopter": "quadcopter", "fts-7.1": "fts"}

NAMES = tuple(_MODULES)
"""The scenarios."""

SUFFIXES = (".tlog", ".csv")
"""The formats that `write` knows."""


def simulate(scenario: str, seed: int = 0) -> Flight:
    """Fly a scenario; the seed draws its noise.

    Raises
    ------
    ConfigError
        There is no such scenario.
    """
    if scenario not in _MODULES:
        raise ConfigError(f"{scenario}: unknown scenario. Choose one of: {', '.join(NAMES)}.")
    flight: Flight = import_module(f"attest.simulation.{_MODULES[scenario]}").simulate(seed)
    return flight


def write(path: Path, flight: Flight) -> None:
    """Write a flight in the format that the suffix of the path names.

    Raises
    ------
    ConfigError
        The suffix is not one of `SUFFIXES`, or the flight lacks what the format carries.
    WriteError
        The file cannot be written.
    """
    formats = {".tlog": write_tlog, ".csv": write_csv}
    suffix = path.suffix.lower()
    if suffix not in formats:
        raise ConfigError(f"{path}: unknown format. Name it with one of: {', '.join(SUFFIXES)}.")
    formats[suffix](path, flight)


def write_tlog(path: Path, flight: Flight) -> None:
    """Write what a ground station would have recorded: MAVLink 2 frames behind receiver stamps."""
    from attest.simulation import tlog

    _write(path, tlog.encode, flight)


def write_csv(path: Path, flight: Flight) -> None:
    """Write the signals and the truth as canonical CSV."""
    from attest.simulation import csv

    _write(path, csv.encode, flight)


def write_truth(path: Path, flight: Flight) -> None:
    """Write true attitude and angular velocity alone, as canonical CSV."""
    from attest.simulation import csv

    _write(path, csv.encode_truth, flight)


def _write(path: Path, encode: Callable[[Flight], bytes], flight: Flight) -> None:
    try:
        data = encode(flight)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    with replacing(path) as part:
        part.write_bytes(data)
