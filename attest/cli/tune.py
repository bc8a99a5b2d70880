"""``attest tune``."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import click

from attest.cli.logs import logs as find_logs
from attest.cli.options import (
    assignments_option,
    chosen,
    finite,
    json_option,
    log_options,
    observer_option,
    quiet_option,
    refuse_no_yaml,
)
from attest.cli.progress import progress
from attest.errors import ReadError

F = TypeVar("F", bound=Callable[..., Any])


OPTIONS: dict[str, dict[str, Any]] = {
    "--key": {
        "multiple": True,
        "metavar": "KEY",
        "help": "Tune this one too: conditioning.smoothing.accel_s, or weights.k.2, its third.",
    },
    "--factor": {
        "default": 30.0,
        "type": click.FloatRange(1.0, 1e6, min_open=True),
        "callback": finite,
        "help": "How far a key may go from its start, either way.",
    },
    "--metric": {
        "default": "total",
        "type": click.Choice(["total", "heading", "inclination"]),
        "help": "The error to make least.",
    },
    "--folds": {
        "default": 4,
        "type": click.IntRange(2, 100),
        "help": "Parts, each held back in turn: logs, or blocks in time of one log.",
    },
    "--skip": {
        "default": 0.0,
        "type": click.FloatRange(min=0.0),
        "callback": finite,
        "metavar": "S",
        "help": "Leave the beginning of each log out of the score, s.",
    },
    "--generations": {
        "default": 25,
        "type": click.IntRange(1, 1000),
        "help": "Of 16 candidates, for each fold, at the most.",
    },
    "--seed": {
        "default": 0,
        "type": click.IntRange(min=0),
        "help": "Draws the candidates; the same seed gives the same gains.",
    },
    "--jobs": {
        "default": 0,
        "type": click.IntRange(0, 256),
        "help": "Candidates that run at the same time; 0: one for each processor.",
    },
}
"""How to tune: the fields of `attest.tuning.Plan`."""


def tuning_options(command: F) -> F:
    """Add the options that say how to tune."""
    for name, option in reversed(OPTIONS.items()):
        command = click.option(name, **option)(command)
    return command


@click.command(
    epilog="""\b
Examples:
  attest tune flight.tlog --observer mekf > tuned.yaml
  attest tune flights/ -o cgo --output tuned.yaml
  attest tune flight.ulg -o fts --key conditioning.smoothing.accel_s --skip 10
"""
)
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@observer_option
@tuning_options
@assignments_option
@log_options
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE.yaml",
    help="Write the configuration here.  [default: stdout]",
)
@quiet_option
@json_option
def tune(
    *,
    logs: tuple[str, ...],
    observer: str,
    assignments: tuple[str, ...],
    output: Path | None,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Find the gains that bring an observer nearest to a reference, and what they are worth.

    They are tuned on all logs, or a folder of them. What they are worth is told by data that were
    held back: tuned without one log, or one block of time, and scored on it, each in its turn.
    """
    from attest import pipeline, tuning
    from attest.files import replacing
    from attest.writers.json import to_json

    refuse_no_yaml(output)
    configuration = pipeline.configure(observer, [*chosen(choices), *assignments])
    plan = tuning.Plan(**{field.name: choices[field.name] for field in fields(tuning.Plan)})
    found = find_logs(logs, configuration.input.csv)
    stages = len(found) + (plan.folds + 1) * plan.generations
    with progress(f"tune {observer}", quiet=quiet, stages=stages) as on_stage:
        tuned = tuning.tune(found, configuration, plan, on_stage)
    # what chooses the data is left out of what is written: another log has other names
    kept = pipeline.configure(observer, assignments)
    text = tuning.yaml_of_tuning(tuned, kept)
    if output is not None:
        with replacing(output) as part:
            part.write_text(text, encoding="utf-8")
    if as_json:
        click.echo(to_json(tuning.describe(tuned, kept), indent=2))
    elif output is None:
        click.echo(text, nl=False)
    if not (as_json or quiet):
        click.echo(tuning.text_of_tuning(tuned, kept), err=output is None)
    if tuned.failed:
        first = next(iter(tuned.failed.values()))
        raise ReadError(f"{len(tuned.failed)} of {len(found)} logs could not be used. {first}")
