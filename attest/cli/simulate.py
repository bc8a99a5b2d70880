"""``attest simulate``."""

from collections.abc import Sequence
from pathlib import Path

import click

from attest.errors import ConfigError

EPILOG = """\b
Scenarios:
  quadcopter, fixed-wing, handheld, spacecraft, docking, and the papers'
  fts-7.1, fts-7.2-high, fts-7.2-low, vae-6, rel-4, rel-4-noise, eso-6, eso-6-noise
\b
Formats, by the output's suffix:
  .tlog, .BIN (ArduPilot), .ulg (PX4), .csv, .bag (ROS 1), .mcap, .db3 (ROS 2);
  a name without suffix is a folder of ROS 2. ROS logs are in its own axes
\b
Examples:
  attest simulate quadcopter -o quadcopter.tlog
  attest simulate quadcopter -o quadcopter_ros2
  attest simulate handheld -o slow.csv --rate gyro=20 --gap 10:15 --bias gyro=0.1,0,0
"""


@click.command(epilog=EPILOG)
@click.argument("scenario")
@click.option(
    "--output",
    "-o",
    required=True,
    type=click.Path(path_type=Path),
    help="File, or folder of ROS 2.",
)
@click.option("--truth", type=click.Path(path_type=Path), help="True attitude, as CSV.")
@click.option(
    "--seed",
    default=0,
    type=click.IntRange(min=0),
    help="Draws the noise; the same seed gives the same bytes.",
)
@click.option("--rate", "rates", multiple=True, metavar="SIGNAL=HZ", help="Sample it so often.")
@click.option("--bias", "biases", multiple=True, metavar="SIGNAL=X,Y,Z", help="Add a constant.")
@click.option("--noise", "noises", multiple=True, metavar="SIGNAL=STD", help="Add normal noise.")
@click.option("--quantum", "quanta", multiple=True, metavar="SIGNAL=STEP", help="Round to steps.")
@click.option("--drop", default=0.0, metavar="SHARE", help="Lose so many samples at random.")
@click.option("--gap", "gaps", multiple=True, metavar="FROM:TO", help="Receive nothing, s.")
def simulate(
    *,
    scenario: str,
    output: Path,
    truth: Path | None,
    seed: int,
    rates: Sequence[str],
    biases: Sequence[str],
    noises: Sequence[str],
    quanta: Sequence[str],
    drop: float,
    gaps: Sequence[str],
) -> None:
    """Make a log with known truth; with worse sensors or links, if asked for.

    Amounts are in a signal's own units: SI, but degrees for latitude and longitude.
    """
    from attest import simulation
    from attest.simulation.degrade import Degradation, degrade

    if truth is not None and truth.resolve() == output.resolve():
        raise ConfigError(f"{truth}: both the log and its truth. Give --truth another name.")
    how = Degradation(
        rate={name: _number("--rate", text) for name, text in _named("--rate", rates)},
        bias={name: _numbers("--bias", text, ",") for name, text in _named("--bias", biases)},
        noise={name: _number("--noise", text) for name, text in _named("--noise", noises)},
        quantum={name: _number("--quantum", text) for name, text in _named("--quantum", quanta)},
        drop=drop,
        gaps=tuple(_gap(text) for text in gaps),
    )
    flight = degrade(simulation.simulate(scenario, seed), how)
    simulation.write(output, flight)
    if truth is not None:
        simulation.write_truth(truth, flight)


def _named(option: str, values: Sequence[str]) -> list[tuple[str, str]]:
    """Split SIGNAL=VALUE."""
    for value in values:
        if "=" not in value:
            raise ConfigError(f"{option} {value}: not of the form SIGNAL=VALUE. See -h.")
    return [(name, text) for name, _, text in (value.partition("=") for value in values)]


def _number(option: str, text: str) -> float:
    return _numbers(option, text, None)[0]


def _numbers(option: str, text: str, separator: str | None) -> tuple[float, ...]:
    parts = [text] if separator is None else text.split(separator)
    try:
        return tuple(float(part) for part in parts)
    except ValueError as error:
        raise ConfigError(f"{option} {text}: not a number. See -h.") from error


def _gap(text: str) -> tuple[float, float]:
    ends = _numbers("--gap", text, ":")
    if len(ends) != 2:
        raise ConfigError(f"--gap {text}: not of the form FROM:TO. See -h.")
    return ends[0], ends[1]
