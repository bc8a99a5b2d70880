"""``attest simulate``."""

from pathlib import Path

import click

from attest.errors import ConfigError


@click.command(epilog="\b\nExample:\n  attest simulate quadcopter -o quadcopter.tlog\n")
@click.argument("scenario")
@click.option("--output", "-o", required=True, type=click.Path(path_type=Path), help="File.")
@click.option("--truth", type=click.Path(path_type=Path), help="True attitude, as CSV.")
@click.option(
    "--seed",
    default=0,
    type=click.IntRange(min=0),
    help="Draws the noise; the same seed gives the same bytes.",
)
def simulate(*, scenario: str, output: Path, truth: Path | None, seed: int) -> None:
    """Make a log with known truth, noise, bias and gaps: quadcopter, fts-7.1."""
    from attest import simulation

    if truth is not None and truth.resolve() == output.resolve():
        raise ConfigError(f"{truth}: both the log and its truth. Give --truth another name.")
    flight = simulation.simulate(scenario, seed)
    simulation.write(output, flight)
    if truth is not None:
        simulation.write_truth(truth, flight)
