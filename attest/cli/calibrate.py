"""``attest calibrate``."""

from pathlib import Path
from typing import Any

import click

from attest.cli.options import (
    assignments_option,
    chosen,
    refuse_no_yaml,
    vehicle_option,
    world_option,
)

EPILOG = """\b
Examples:
  attest calibrate tumbling.tlog
  attest calibrate tumbling.tlog --output mine.yaml && attest run flight.tlog --observer mine.yaml
  attest calibrate tumbling.tlog --observer own.yaml --output mine.yaml
  attest calibrate flight.bin --start 10 --end 200 --json
"""


@click.command(epilog=EPILOG)
@click.argument("log", metavar="LOG")
@click.option(
    "--observer",
    "-o",
    default="fts",
    metavar="NAME|FILE.yaml",
    help="Observer, or YAML, to go with.",
)
@assignments_option
@world_option
@vehicle_option
@click.option("--start", type=float, metavar="S", help="Leave out what is earlier, s.")
@click.option("--end", type=float, metavar="S", help="Leave out what is later, s.")
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="FILE.yaml", help="Write the YAML here."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of YAML.")
def calibrate(
    *,
    log: str,
    observer: str,
    assignments: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    **choices: Any,
) -> None:
    """Find the sensors' own errors in a log, as YAML for `run`.

    Hard and soft iron of the magnetometer, bias, scale and misalignment of the gyroscope, bias and
    scale of the accelerometer: each as far as the log's motion tells it.
    """
    from attest import conditioning, pipeline, report
    from attest.files import replacing
    from attest.writers.json import to_json

    refuse_no_yaml(output)
    configuration = pipeline.configure(
        observer, [*chosen({"reference": None, **choices}), *assignments]
    )
    recording = pipeline.doubted(pipeline.read(Path(log), configuration))
    found = conditioning.calibrate(recording, configuration)
    # what chooses the data is left out of what is written: another log has other names
    made = conditioning.calibrated(pipeline.configure(observer, assignments), found)
    document = {"log": log, "observer": made.observer, **found}
    text = report.text_of_calibration(document, made)
    if output is not None:
        with replacing(output) as part:
            part.write_text(text, encoding="utf-8", errors="backslashreplace")
    if as_json:
        click.echo(to_json(document))
    else:
        click.echo(text, nl=False)
