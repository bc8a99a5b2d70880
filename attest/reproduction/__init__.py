"""The papers' experiments, run again: figures, and each claim against what came out.

    reproduce(name, seeds) -> Experiment -> write(experiment, folder)

An experiment is one function of the seeds, imported when asked for, and one line in `_EXPERIMENTS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from attest.errors import ConfigError

if TYPE_CHECKING:
    from attest.reproduction.experiment import Experiment

_EXPERIMENTS = {
    "fts-7.1": "fts_noise_free.reproduce",
    "fts-7.2-high": "fts_noisy.high",
    "fts-7.2-low": "fts_noisy.low",
    "vae-6": "vae.reproduce",
    "rel-4": "rel.reproduce",
    "eso-6": "eso.reproduce",
}

NAMES = tuple(_EXPERIMENTS)
"""The experiments."""


def reproduce(name: str, seeds: int = 50) -> Experiment:
    """Run an experiment, over so many seeds where it is random.

    Raises
    ------
    ConfigError
        There is no such experiment.
    """
    if name not in _EXPERIMENTS:
        raise ConfigError(f"{name}: unknown experiment. Choose one of: {', '.join(NAMES)}, all.")
    module, function = _EXPERIMENTS[name].split(".")
    run = getattr(import_module(f"attest.reproduction.{module}"), function)
    experiment: Experiment = run(range(seeds))
    return experiment


def text(experiment: Experiment) -> str:
    """Return the table of claims for a terminal."""
    from attest.reproduction import table

    return table.text(experiment)


def write(experiment: Experiment, folder: Path) -> Iterator[Path]:
    """Write figures (PNG) and the table of claims (Markdown, JSON), and yield their paths.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    from attest.reproduction import figures, table

    yield from figures.write(experiment, folder)
    yield from table.write(experiment, folder)
