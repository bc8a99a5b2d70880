"""Options that several commands share, and what stands for their values."""

import json
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

import click

from attest.errors import ConfigError

F = TypeVar("F", bound=Callable[..., Any])

quiet_option = click.option("--quiet", "-q", is_flag=True, help="Print errors only.")
json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print JSON instead of text; of several logs, a line each.",
)

observer_option = click.option(
    "--observer", "-o", default="fts", metavar="NAME|FILE.yaml", help="Observer, or YAML."
)
assignments_option = click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="Override a YAML key."
)
output_option = click.option(
    "--output", default="attest_out", type=click.Path(path_type=Path), help="Folder."
)
open_option = click.option(
    "--open", "open_viewer", is_flag=True, help="Open the result in the Rerun viewer."
)
vehicle_option = click.option(
    "--vehicle", metavar="SYS[/COMP]", help="MAVLink system.  [default: the autopilot]"
)
world_option = click.option(
    "--world",
    type=click.Choice(["ned", "enu"]),
    help="World axes of a CSV or a ROS log.  [default: ned; enu for ROS]",
)


def log_options(command: F) -> F:
    """Add the options that choose what of a log is used; `chosen` makes assignments of them."""
    for option in (
        vehicle_option,
        click.option("--end", type=float, metavar="S", help="Leave out what is later, s."),
        click.option("--start", type=float, metavar="S", help="Leave out what is earlier, s."),
        world_option,
        click.option(
            "--reference",
            metavar="NAME|FILE|smoother|none",
            help="Compare with this one, of the log or of a file, or with attest's own smoother.  "
            "[default: the log's best]",
        ),
    ):
        command = option(command)
    return command


def finite(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    """Refuse what is no number, which a range lets pass."""
    if value is not None and not isfinite(value):
        raise click.BadParameter(f"{value} is no number.")
    return value


def chosen(choices: Mapping[str, Any]) -> Iterator[str]:
    """Yield `log_options` as the assignments to keys of the configuration that they stand for."""
    keys = {
        "reference": "evaluation.reference",
        "world": "input.world",
        "start": "input.start_s",
        "end": "input.end_s",
        "vehicle": "input.vehicle",
    }
    for name, key in keys.items():
        if choices[name] is not None:
            yield f"{key}={json.dumps(choices[name])}"


def refuse_no_yaml(output: Path | None) -> None:
    """Refuse a file for a configuration that ``--observer`` would not take."""
    if output is not None and output.suffix.lower() not in {".yaml", ".yml"}:
        raise ConfigError(f"--output {output}: name a .yaml file, such as --observer takes.")
