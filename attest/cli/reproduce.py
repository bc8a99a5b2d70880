"""``attest reproduce``."""

from pathlib import Path

import click

from attest.cli.options import quiet_option
from attest.cli.progress import progress


@click.command(
    epilog="""\b
Examples:
  attest reproduce fts-7.1
  attest reproduce all --output reproduced
"""
)
@click.argument("experiment")
@click.option("--output", default="reproduced", type=click.Path(path_type=Path), help="Folder.")
@click.option(
    "--seeds", default=50, type=click.IntRange(1, 10_000), help="Runs where it is random."
)
@quiet_option
def reproduce(*, experiment: str, output: Path, seeds: int, quiet: bool) -> None:
    """Run the papers' experiments again: figures, and a table of each claim and what came out.

    EXPERIMENT is fts-7.1, fts-7.2-high, fts-7.2-low, vae-6, rel-4, eso-6 or all.
    """
    from attest import reproduction

    for name in reproduction.NAMES if experiment == "all" else (experiment,):
        with progress(name, quiet=quiet) as on_stage:
            if on_stage:
                on_stage("running")
            done = reproduction.reproduce(name, seeds)
            written = list(reproduction.write(done, output))
        if not quiet:
            click.echo(reproduction.text(done))
            click.echo(f"  written {output}/  {' '.join(path.name for path in written)}\n")
