"""``attest config``."""

import json

import click

from attest.cli.options import assignments_option


@click.group(name="config", epilog="\b\nExample:\n  attest config show fts > mine.yaml\n")
def configuration() -> None:
    """Check and print configurations."""


@configuration.command(epilog="\b\nExample:\n  attest config check mine.yaml\n")
@click.argument("file")
def check(*, file: str) -> None:
    """Check a YAML file, and say so where it is right."""
    from attest import pipeline

    checked = pipeline.configure(file)
    click.echo(f"{file}: right, for observer {checked.observer!r}.")


@configuration.command(epilog="\b\nExample:\n  attest config show fts --set gains.k_p=0.5\n")
@click.argument("name")
@assignments_option
def show(*, name: str, assignments: tuple[str, ...]) -> None:
    """Print the whole configuration of a name or a file, defaults included, as YAML."""
    from attest import config, pipeline

    click.echo(config.dump(pipeline.configure(name, assignments)), nl=False)


@configuration.command(epilog="\b\nExample:\n  attest config schema fts > fts.schema.json\n")
@click.argument("name")
def schema(*, name: str) -> None:
    """Print the JSON Schema of an observer's configuration, for editors."""
    from attest import observers

    click.echo(json.dumps(observers.get(name).config.model_json_schema(), indent=2))
