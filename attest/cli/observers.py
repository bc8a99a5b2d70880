"""``attest observers``."""

import click


@click.command(name="observers", epilog="\b\nExample:\n  attest observers fts\n")
@click.argument("name", required=False)
def list_observers(*, name: str | None) -> None:
    """List the observers, or tell one's paper, gains and YAML."""
    from attest import observers, pipeline, report

    if name is None:
        for each in observers.NAMES:
            click.echo(f"{each:14s}{observers.get(each).title}")
    else:
        observer = observers.get(name)
        click.echo(
            report.text_of_observer(observer.title, observer.paper, pipeline.configure(name))
        )
