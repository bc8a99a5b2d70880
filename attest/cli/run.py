"""``attest run``."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from attest.cli.batch import run_batch
from attest.cli.logs import logs as find_logs
from attest.cli.options import (
    assignments_option,
    chosen,
    json_option,
    log_options,
    observer_option,
    open_option,
    output_option,
    quiet_option,
)
from attest.cli.progress import progress
from attest.errors import AttestError, ConfigError, ReadError

if TYPE_CHECKING:
    from attest.config import Configuration


@click.command(
    epilog="""\b
Examples:
  attest run flight.tlog
  attest run flight.tlog --observer mine.yaml --output results
  attest run flight.csv --world enu --reference none
  attest run flights/ --quiet
"""
)
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@observer_option
@assignments_option
@log_options
@output_option
@open_option
@quiet_option
@json_option
def run(
    *,
    logs: tuple[str, ...],
    observer: str,
    assignments: tuple[str, ...],
    output: Path,
    open_viewer: bool,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Run an observer over logs: MCAP, Rerun, JSON, and a table; a folder is as with `batch`."""
    from attest import pipeline
    from attest.batch import Plan

    configuration = pipeline.configure(observer, [*chosen(choices), *assignments])
    if any(map(_holds_logs, logs)):
        if open_viewer:
            raise ConfigError("--open: a folder has many results. Name a log.")
        plan = Plan(configurations={configuration.observer: configuration}, output=output)
        run_batch(logs, plan, quiet=quiet, as_json=as_json)
        return
    found = find_logs(logs, configuration.input.csv)
    failed = 0
    for log in found:
        try:
            rrd = _run_one(log, configuration, output, found, quiet=quiet, as_json=as_json)
        except AttestError as error:
            if len(found) == 1:
                raise
            failed += 1
            click.echo(f"attest: {error}", err=True)
            continue
        if open_viewer:
            open_rrd(rrd)
    if failed:
        raise ReadError(f"{failed} of {len(found)} logs could not be used; see above.")


def _holds_logs(name: str) -> bool:
    """Whether it is a folder, and not a log that is one."""
    from attest import readers

    return name != "" and Path(name).is_dir() and not readers.is_log(Path(name))


def _run_one(
    log: Path,
    configuration: "Configuration",
    output: Path,
    logs: Sequence[Path],
    *,
    quiet: bool,
    as_json: bool,
) -> Path:
    """Run one log, print what came out, and return the path of the .rrd."""
    from attest import pipeline, report
    from attest.writers import folders

    with progress(log.name, quiet=quiet) as on_stage:
        result = pipeline.run(log, configuration, on_stage)
        folder = folders.folder_for(result, output, logs)
        written = pipeline.write([result], folder, on_stage)
    if as_json:
        text = written[-1].read_text(encoding="utf-8")
        # of several logs, a line each
        click.echo(text if len(logs) == 1 else json.dumps(json.loads(text)) + "\n", nl=False)
    elif not quiet:
        click.echo(report.text_of_run(result.summary, written))
    return written[1]


def open_rrd(rrd: Path) -> None:
    """Open a recording in the viewer."""
    import subprocess

    try:
        subprocess.Popen([sys.executable, "-m", "rerun", str(rrd)])  # noqa: S603  our own file
    except OSError as error:
        raise ReadError(f"{rrd}: the Rerun viewer does not start: {error.strerror}.") from error
