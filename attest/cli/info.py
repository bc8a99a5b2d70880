"""``attest info``."""

import json
from typing import Any

import click

from attest.cli.logs import logs as find_logs
from attest.cli.options import json_option, vehicle_option, world_option


@click.command(epilog="\b\nExample:\n  attest info flight.tlog --json\n")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@vehicle_option
@world_option
@json_option
def info(*, logs: tuple[str, ...], vehicle: str | None, world: Any, as_json: bool) -> None:
    """Tell what is in a log: vehicles, signals, rates, gaps, clocks, references, doubts."""
    from attest import readers, report
    from attest.readers.options import ReadOptions

    for i, log in enumerate(find_logs(logs)):
        described = report.describe(readers.read(log, ReadOptions(vehicle=vehicle, world=world)))
        if as_json:
            click.echo(json.dumps(described, ensure_ascii=False, allow_nan=False))
        else:
            click.echo(("\n" if i else "") + report.text_of_info(described))
