"""``attest compare``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from attest.cli.labels import labelled
from attest.cli.logs import logs as find_logs
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

if TYPE_CHECKING:
    from attest.config import Csv

USUAL = ("fts", "vae", "game", "cgo", "mekf")


@click.command(
    epilog="""\b
Examples:
  attest compare flight.tlog
  attest compare flight.tlog -o fts -o vqf -o mine.yaml --reference ATTITUDE
"""
)
@click.argument("log")
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
    log: str,
    observers: Sequence[str],
    assignments: tuple[str, ...],
    output: Path,
    open_viewer: bool,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Run several observers over one log: one MCAP, one Rerun recording, one ranked table."""
    from attest import comparison, pipeline, report
    from attest.writers import folders

    if len(observers) < 2:
        raise ConfigError("one observer: nothing to compare with. Name two with -o, or use run.")
    wanted = [*chosen(choices), *assignments]
    configurations = {
        label: pipeline.configure(name, wanted) for label, name in labelled(observers).items()
    }
    path = _only(log, next(iter(configurations.values())).input.csv)
    with progress(path.name, quiet=quiet, stages=3 * len(configurations) + 2) as on_stage:
        results, failed = comparison.compare(path, configurations, on_stage)
        document = report.rank(results, failed)
        folder = folders.folder_for(results[0], output, [path])
        written = pipeline.write(results, folder, on_stage, document)
    if as_json:
        click.echo(written[-1].read_text(encoding="utf-8"), nl=False)
    elif not quiet:
        click.echo(report.text_of_ranking(document, written))
    else:
        for label, reason in failed.items():
            click.echo(f"attest: {label}: {reason}", err=True)
    if open_viewer:
        open_rrd(written[1])


def _only(named: str, csv: "Csv | None") -> Path:
    found = find_logs([named], csv)
    if len(found) > 1:
        raise ConfigError(f"{named}: {len(found)} logs in this folder. Name one of them.")
    return found[0]
