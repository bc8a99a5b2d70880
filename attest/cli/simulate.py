"""``attest simulate``."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from attest.errors import ConfigError

if TYPE_CHECKING:
    from attest.simulation.degrade import Degradation

T = TypeVar("T")
_Several = dict[str, tuple[T, ...]]

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
  attest simulate fixed-wing -o bad_gps.ulg --jump velocity=20:40:5,0,0 --silent position=50:60
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
@click.option("--rate", multiple=True, metavar="SIGNAL=HZ", help="Sample it so often.")
@click.option("--bias", multiple=True, metavar="SIGNAL=X,Y,Z", help="Add a constant.")
@click.option("--noise", multiple=True, metavar="SIGNAL=STD", help="Add normal noise.")
@click.option("--quantum", multiple=True, metavar="SIGNAL=STEP", help="Round to steps.")
@click.option(
    "--jump",
    multiple=True,
    metavar="SIGNAL=FROM:TO:X,Y,Z",
    help="Add a constant for a while, s.",
)
@click.option("--stuck", multiple=True, metavar="SIGNAL=FROM:TO", help="Stay what it was, s.")
@click.option("--silent", multiple=True, metavar="SIGNAL=FROM:TO", help="Leave it out, s.")
@click.option("--drop", default=0.0, metavar="SHARE", help="Lose so many samples at random.")
@click.option("--gap", multiple=True, metavar="FROM:TO", help="Receive nothing, s.")
def simulate(
    *,
    scenario: str,
    output: Path,
    truth: Path | None,
    seed: int,
    **worse: Any,
) -> None:
    """Make a log with known truth; with worse sensors or links, if asked for.

    Amounts are in a signal's own units: SI, but degrees for latitude and longitude.
    """
    from attest import simulation
    from attest.simulation.degrade import degrade

    if truth is not None and truth.resolve() == output.resolve():
        raise ConfigError(f"{truth}: both the log and its truth. Give --truth another name.")
    flight = degrade(simulation.simulate(scenario, seed), _degradation(worse))
    simulation.write(output, flight)
    if truth is not None:
        simulation.write_truth(truth, flight)


def _degradation(worse: Mapping[str, Any]) -> "Degradation":
    """Return what the options ask for."""
    from attest.simulation.degrade import Degradation

    def numbers(key: str) -> dict[str, float]:
        return {name: _number(f"--{key}", text) for name, text in _named(f"--{key}", worse[key])}

    return Degradation(
        rate=numbers("rate"),
        bias={
            name: _numbers("--bias", text, ",") for name, text in _named("--bias", worse["bias"])
        },
        noise=numbers("noise"),
        quantum=numbers("quantum"),
        jump=_together("--jump", worse["jump"], _jump),
        stuck=_together("--stuck", worse["stuck"], _span),
        silent=_together("--silent", worse["silent"], _span),
        drop=worse["drop"],
        gaps=tuple(_span("--gap", text) for text in worse["gap"]),
    )


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


def _together(option: str, values: Sequence[str], read: Callable[[str, str], T]) -> _Several[T]:
    """Read SIGNAL=VALUE, which may be given several times for one signal."""
    found: _Several[T] = {}
    for name, text in _named(option, values):
        found[name] = (*found.get(name, ()), read(option, text))
    return found


def _span(option: str, text: str) -> tuple[float, float]:
    ends = _numbers(option, text, ":")
    if len(ends) != 2:
        raise ConfigError(f"{option} {text}: not of the form FROM:TO. See -h.")
    return ends[0], ends[1]


def _jump(option: str, text: str) -> tuple[float, float, tuple[float, ...]]:
    if text.count(":") != 2:
        raise ConfigError(f"{option} {text}: not of the form FROM:TO:X,Y,Z. See -h.")
    span, _, offset = text.rpartition(":")
    return *_span(option, span), _numbers(option, offset, ",")
