"""What is shown while one waits."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def progress(title: str, *, quiet: bool, stages: int = 5) -> Iterator[Any]:
    """Show the stages on stderr where that is a terminal; yield what tells of the next one."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=stages)

        def on_stage(stage: str) -> None:
            bar.update(task, description=f"{title}  {stage}", advance=1)

        yield on_stage
