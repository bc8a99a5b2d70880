"""Logs with known truth, made to order and the same bytes again for the same seed.

    simulate(scenario, seed) -> Flight [-> degrade(flight, degradation)] -> write(path, flight)

A scenario is one function of a seed, imported when asked for, and one line in `_SCENARIOS`. A
format is one module with ``encode(flight)``, and one line in `_ENCODERS`.
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

_SCENARIOS = {
    "quadcopter": "quadcopter.simulate",
    "fixed-wing": "fixed_wing.simulate",
    "handheld": "handheld.simulate",
    "spacecraft": "spacecraft.simulate",
    "docking": "docking.simulate",
    "fts-7.1": "fts.noise_free",
    "fts-7.2-high": "fts.high_noise",
    "fts-7.2-low": "fts.low_noise",
    "vae-6": "vae.simulate",
    "rel-4": "rel.noise_free",
    "rel-4-noise": "rel.noisy",
    "eso-6": "eso.noise_free",
    "eso-6-noise": "eso.noisy",
}
_ENCODERS = {".tlog": "tlog", ".csv": "csv", ".bin": "dataflash", ".ulg": "ulog"}

NAMES = tuple(_SCENARIOS)
"""The scenarios."""

SUFFIXES = tuple(_ENCODERS)
"""The formats that `write` knows."""


def simulate(scenario: str, seed: int = 0) -> Flight:
    """Fly a scenario; the seed draws its noise.

    Raises
    ------
    ConfigError
        There is no such scenario.
    """
    if scenario not in _SCENARIOS:
        raise ConfigError(f"{scenario}: unknown scenario. Choose one of: {', '.join(NAMES)}.")
    module, function = _SCENARIOS[scenario].split(".")
    flight: Flight = getattr(import_module(f"attest.simulation.{module}"), function)(seed)
    return flight


def write(path: Path, flight: Flight) -> None:
    """Write a flight in the format that the suffix of the path names.

    A ``.tlog`` is what a ground station would have recorded, MAVLink 2 frames behind receiver
    stamps; a ``.csv`` has the signals and the true attitude.

    Raises
    ------
    ConfigError
        The suffix is not one of `SUFFIXES`, or the flight lacks what the format carries.
    WriteError
        The file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in _ENCODERS:
        raise ConfigError(f"{path}: unknown format. Name it with one of: {', '.join(SUFFIXES)}.")
    _write(path, import_module(f"attest.simulation.{_ENCODERS[suffix]}").encode, flight)


def write_truth(path: Path, flight: Flight) -> None:
    """Write the truth alone, as canonical CSV: attitude, angular velocity, what else there is."""
    from attest.simulation import csv

    _write(path, csv.encode_truth, flight)


def _write(path: Path, encode: Callable[[Flight], bytes], flight: Flight) -> None:
    try:
        data = encode(flight)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    with replacing(path) as part:
        part.write_bytes(data)
