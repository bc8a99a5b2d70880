"""``attest fleet``."""

from datetime import datetime
from pathlib import Path
from typing import Any

import click

from attest.cli.options import output_option, quiet_option

DAY = click.DateTime(["%Y-%m-%d"])


@click.command(
    epilog="""\b
Examples:
  attest fleet attest_out
  attest fleet 2025/summary.parquet 2026/summary.parquet -o fts --since 2025-07-01
  attest fleet results --by folder --json
"""
)
@click.argument(
    "summaries",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
    metavar="SUMMARY...",
)
@click.option(
    "--by",
    type=click.Choice(["vehicle", "folder"]),
    default="vehicle",
    help="What is one vehicle: its number or name in the log, or the folder of the log.",
)
@click.option("--observer", "-o", "observers", multiple=True, metavar="NAME", help="These only.")
@click.option("--since", type=DAY, metavar="DAY", help="Flights of this day, UTC, and later.")
@click.option("--until", type=DAY, metavar="DAY", help="Flights of this day, UTC, and earlier.")
@output_option
@quiet_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def fleet(
    *,
    summaries: tuple[Path, ...],
    observers: tuple[str, ...],
    since: datetime | None,
    until: datetime | None,
    output: Path,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Follow bias, calibration and error of each vehicle from flight to flight.

    SUMMARY is what `attest batch` writes, summary.parquet or summary.csv, or its folder. Changes
    and odd flights are flagged, as far as they are no chance among so many.
    """
    from attest import fleet as fleets
    from attest.writers.json import to_json

    choice = fleets.Choice(
        by=choices["by"],
        observers=observers,
        since=since.date() if since else None,
        until=until.date() if until else None,
    )
    document = fleets.fleet(summaries, choice)
    written = fleets.write_results(document, output)
    if as_json:
        click.echo(to_json(document))
    elif not quiet:
        click.echo(fleets.text_of_fleet(document, written))
