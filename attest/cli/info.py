"""``attest info``."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import click

from attest.cli.logs import logs as find_logs
from attest.cli.options import (
    assignments_option,
    json_option,
    observer_option,
    vehicle_option,
    world_option,
)
from attest.errors import AttestError, ConfigError, ReadError

EPILOG = """\b
Examples:
  attest info flight.tlog --json
  attest info flight.bin --imu IMU[1] --plot signals.png
  attest info flight.bag --set input.topics.mag=/mag
  attest info flight.csv --observer mine.yaml
"""


@click.command(epilog=EPILOG)
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@observer_option
@vehicle_option
@world_option
@click.option("--imu", metavar="NAME", help="Message or topic of the IMU.  [default: the best]")
@assignments_option
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE.png", help="Plot signals.")
@json_option
def info(
    *,
    logs: tuple[str, ...],
    observer: str,
    vehicle: str | None,
    world: str | None,
    imu: str | None,
    assignments: tuple[str, ...],
    plot: Path | None,
    as_json: bool,
) -> None:
    """Tell whether a log can answer: signals, what they are worth, clocks, references, doubts."""
    from attest import pipeline, preview, report
    from attest.writers.json import to_json

    configuration = pipeline.configure(observer, [*_chosen(vehicle, world, imu), *assignments])
    found = find_logs(logs, configuration.input.csv)
    if plot is not None:
        _check_plot(plot, found)
    options = {"--observer": observer, "--vehicle": vehicle, "--world": world}
    needed = [*_options(options), *_assigned([*_chosen(None, None, imu), *assignments])]
    shown = 0
    for log in found:
        try:
            recording, described = preview.describe(log, configuration, needed)
        except AttestError as error:
            if len(found) == 1:
                raise
            click.echo(f"attest: {error}", err=True)
            continue
        if plot is not None:
            report.plot(recording, plot)
        text = to_json(described) if as_json else report.text_of_info(described)
        click.echo(text if as_json or not shown else f"\n{text}")
        shown += 1
    if shown < len(found):
        raise ReadError(f"{len(found) - shown} of {len(found)} logs could not be used; see above.")


def _check_plot(plot: Path, logs: Sequence[Path]) -> None:
    """Refuse what cannot be a picture's name, before the logs are read."""
    if len(logs) > 1:
        raise ConfigError(f"--plot {plot}: one picture for {len(logs)} logs. Name one log.")
    if plot.suffix.lower() != ".png":
        raise ConfigError(f"--plot {plot}: the picture is a PNG. Give it a name that ends in .png.")
    if plot.is_dir():
        raise ConfigError(f"--plot {plot}: a folder. Name a file in it.")
    if not plot.parent.is_dir():
        raise ConfigError(f"--plot {plot}: no folder {plot.parent}. Make it, or choose another.")


def _chosen(vehicle: str | None, world: str | None, imu: str | None) -> Iterator[str]:
    """Yield the options as the keys of the configuration that they stand for."""
    for key, value in (("vehicle", vehicle), ("world", world), ("imu", imu)):
        if value is not None:
            yield f"input.{key}={json.dumps(value)}"


def _options(given: Mapping[str, str | None]) -> Iterator[str]:
    """Yield the options as `run` takes them, and leaves them out."""
    for name, value in given.items():
        if value is not None and (name, value) != ("--observer", "fts"):
            yield from (name, value)


def _assigned(assignments: Iterable[str]) -> Iterator[str]:
    for assignment in assignments:
        yield from ("--set", assignment)
