"""Several observers over one log, which is read once."""

from collections.abc import Mapping
from pathlib import Path

from attest import config, pipeline
from attest.config import Configuration
from attest.errors import AttestError, ReadError
from attest.recording import Reference
from attest.result import Result, ranked


def compare(
    log: Path, configurations: Mapping[str, Configuration], on_stage: pipeline.OnStage | None = None
) -> tuple[list[Result], dict[str, str]]:
    """Run several observers, by label, over one log that is read once.

    Returns
    -------
    results
        Of those that could run, the best first; their labels stand for the observers' names.
    failed
        Of the others, why not.

    Raises
    ------
    ReadError
        The log cannot be used, or by none of them.
    ConfigError
        The configurations read or score the log in different ways, or the log lacks the reference.
    """
    config.refuse_unlike(configurations)
    read_once = pipeline.opened(log, _first(configurations), on_stage)
    results: list[Result] = []
    failed: dict[str, str] = {}
    for label, configuration in configurations.items():
        if _is_itself(read_once.reference, configuration):
            failed[label] = "is the reference, and not ranked against itself"
            continue
        try:
            results.append(
                pipeline.observe(read_once, configuration, on_stage, label=label, compiled=False)
            )
        except AttestError as error:
            failed[label] = str(error)
    if not results:
        raise ReadError(f"{log}: no observer could run. {next(iter(failed.values()))}")
    return ranked(results), failed


def _first(configurations: Mapping[str, Configuration]) -> Configuration:
    """Return the first that the smoother may be the reference of, by whose sensors it then goes."""
    every = list(configurations.values())
    return next((each for each in every if each.observer != pipeline.SMOOTHER), every[0])


def _is_itself(reference: Reference | None, configuration: Configuration) -> bool:
    made = reference is not None and reference.kind == pipeline.SMOOTHER
    return made and configuration.observer == pipeline.SMOOTHER
