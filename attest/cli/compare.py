"""``attest compare``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from attest.cli.options import (
    assignments_option,
    chosen,
    json_option,
    log_options,
    open_option,
    output_option,
    quiet_option,
)
from attest.cli.progress import progress
from attest.cli.run import open_rrd
from attest.errors import ConfigError

USUAL = ("fts", "vae", "game", "cgo", "mekf")


@click.command(
    epilog="""\b
Examples:
  attest compare flight.tlog
  attest compare flight.tlog -o fts -o vqf -o mine.yaml --reference ATTITUDE
"""
)
@click.argument("log", type=click.Path(path_type=Path))
@click.option(
    "--observer",
    "-o",
    "observers",
    multiple=True,
    default=USUAL,
    metavar="NAME|FILE.yaml",
    help="Observer, or YAML; two at least.",
)
@assignments_option
@log_options
@output_option
@open_option
@quiet_option
@json_option
def compare(
    *,
    log: Path,
    observers: Sequence[str],
    assignments: tuple[str, ...],
    output: Path,
    open_viewer: bool,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Run several observers over one log: one MCAP, one Rerun recording, one ranked table."""
    from attest import pipeline, report
    from attest.writers.json import to_json

    if len(observers) < 2:
        raise ConfigError("one observer: nothing to compare with. Name two with -o, or use run.")
    wanted = [*chosen(choices), *assignments]
    configurations = {
        label: pipeline.configure(name, wanted) for label, name in _labels(observers).items()
    }
    with progress(log.name, quiet=quiet, stages=4 * len(configurations) + 1) as on_stage:
        results, failed = pipeline.compare(log, configurations, on_stage)
        document = report.rank(results, failed)
        folder = pipeline.folder_for(results[0], output, [log])
        written = pipeline.write(results, folder, on_stage, document)
    if as_json:
        click.echo(to_json(document, indent=2))
    elif not quiet:
        click.echo(report.text_of_ranking(document, written))
    if open_viewer:
        open_rrd(written[1])


def _labels(names: Sequence[str]) -> dict[str, str]:
    """Name each configuration: by its name, or its file's stem; of twins the second is NAME-2."""
    labels: dict[str, str] = {}
    for name in names:
        stem = Path(name).stem or name
        label, count = stem, 1
        while label in labels:
            count += 1
            label = f"{stem}-{count}"
        labels[label] = name
    return labels
