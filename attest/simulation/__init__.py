"""Logs with known truth, made to order and the same bytes again for the same seed.

    simulate(scenario, seed) -> Flight [-> degrade(flight, degradation)] -> write(path, flight)

A scenario is one function of a seed, imported when asked for, and one line in `_SCENARIOS`. A
format is one function of a flight that returns its bytes, or the bytes of a folder's files by name,
and one line in `_ENCODERS`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
_ENCODERS = {
    ".tlog": "tlog.encode",
    ".csv": "csv.encode",
    ".bin": "dataflash.encode",
    ".ulg": "ulog.encode",
    ".bag": "ros_files.encode_bag",
    ".mcap": "ros_files.encode_mcap",
    ".db3": "ros_files.encode_db3",
    "": "ros_files.encode_folder",
}

NAMES = tuple(_SCENARIOS)
"""The scenarios."""

SUFFIXES = tuple(filter(None, _ENCODERS))
"""The files that `write` knows; a name without suffix is a folder of ROS 2."""


def simulate(scenario: str, seed: int = 0) -> Flight:
    """Fly a scenario; the seed draws its noise.

    Raises
    ------
    ConfigError
        There is no such scenario.
    """
    if scenario not in _SCENARIOS:
        raise ConfigError(f"{scenario}: unknown scenario. Choose one of: {', '.join(NAMES)}.")
    flight: Flight = _function(_SCENARIOS[scenario])(seed)
    return flight


def write(path: Path, flight: Flight) -> None:
    """Write a flight in the format that the suffix of the path names.

    A ``.tlog`` is what a ground station would have recorded, MAVLink 2 frames behind receiver
    stamps; a ``.csv`` has the signals and the true attitude. Without a suffix it is a folder of
    ROS 2.

    Raises
    ------
    ConfigError
        The suffix is not one of `SUFFIXES`, the flight lacks what the format carries, or the folder
        holds other files.
    WriteError
        The file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in _ENCODERS:
        known = ", ".join(SUFFIXES)
        raise ConfigError(
            f"{path}: unknown format. Name it with one of: {known}, or none for a ROS 2 folder."
        )
    _write(path, _function(_ENCODERS[suffix]), flight)


def write_truth(path: Path, flight: Flight) -> None:
    """Write the truth alone, as canonical CSV: attitude, angular velocity, what else there is."""
    _write(path, _function("csv.encode_truth"), flight)


def _function(name: str) -> Callable[..., Any]:
    """Import ``module.function`` of this package."""
    module, function = name.split(".")
    found: Callable[..., Any] = getattr(import_module(f"attest.simulation.{module}"), function)
    return found


def _write(
    path: Path, encode: Callable[[Flight], bytes | dict[str, bytes]], flight: Flight
) -> None:
    try:
        data = encode(flight)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    files = {path: data} if isinstance(data, bytes) else _in_folder(path, data)
    for name, content in files.items():
        with replacing(name) as part:
            part.write_bytes(content)


def _in_folder(path: Path, files: dict[str, bytes]) -> dict[Path, bytes]:
    """Return the files of a folder; one that holds others would be a log of two flights."""
    if path.is_dir() and {other.name for other in path.iterdir()} - files.keys():
        raise ConfigError(f"{path}: a folder that holds other files. Give a new name.")
    return {path / name: data for name, data in files.items()}
