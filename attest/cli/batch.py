"""``attest batch``."""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from attest.cli.labels import labelled
from attest.cli.options import (
    assignments_option,
    chosen,
    finite,
    json_option,
    log_options,
    quiet_option,
)
from attest.errors import ConfigError, ReadError, printable

if TYPE_CHECKING:
    from attest.batch import Found, Plan

F = TypeVar("F", bound=Callable[..., Any])
Row = dict[str, Any]

OPTIONS: dict[str, dict[str, Any]] = {
    "--observer": {
        "multiple": True,
        "default": ("fts",),
        "metavar": "NAME|FILE.yaml",
        "help": "Observer, or YAML; as many as you like.",
    },
    "--jobs": {
        "default": 0,
        "type": click.IntRange(0, 1024),
        "help": "Logs that run at the same time here; 0: one for each processor.",
    },
    "--timeout": {
        "default": 3600.0,
        "type": click.FloatRange(0.0, 1e6),
        "callback": finite,
        "metavar": "S",
        "help": "Give a log up after so long; 0: never.",
    },
    "--memory": {
        "type": click.FloatRange(0.0, 1e6, min_open=True),
        "callback": finite,
        "metavar": "GB",
        "help": "Give a log up that takes more, beside the program itself.  [default: no bound]",
    },
    "--write": {
        "multiple": True,
        "default": ("mcap", "rrd"),
        "type": click.Choice(["mcap", "rrd", "json"]),
        "help": "What to write of each log; JSON always is.",
    },
}


def batch_options(command: F) -> F:
    """Add the options that say how to run a batch."""
    for name, option in reversed(OPTIONS.items()):
        names = (name, "-o", "observers") if name == "--observer" else (name,)
        command = click.option(*names, **option)(command)
    return command


@click.command(
    epilog="""\b
Examples:
  attest batch flights/
  attest batch flights/ -o fts -o mekf --output results --jobs 4
  attest batch 'flights/**/*.BIN' --write json --timeout 60
  find /logs -name '*.ulg' -print0 | attest batch - --json
  attest batch @logs.txt --retry
  attest batch s3://flights/2026/ --output s3://results/2026 --cluster tcp://scheduler:8786
"""
)
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@batch_options
@click.option("--force", is_flag=True, help="Do again what is done.")
@click.option("--retry", is_flag=True, help="Do again what did not end well.")
@assignments_option
@log_options
@click.option(
    "--output", default="attest_out", metavar="DIR|URL", help="Folder, or s3://, gs://, sftp://."
)
@click.option(
    "--journal",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Folder for the journal and the summary of an output at a URL.  "
    "[default: one in attest_out/]",
)
@click.option(
    "--cluster",
    metavar="URL",
    help="Run on this Dask scheduler's workers, such as tcp://host:8786.",
)
@quiet_option
@json_option
def batch(
    *,
    paths: tuple[str, ...],
    observers: tuple[str, ...],
    assignments: tuple[str, ...],
    output: str,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Run observers over many logs: each once, in parallel, whatever happens to one of them.

    PATH is a log, a folder, a pattern, @FILE with a path a line (or a zero byte after each), or -
    for such a list on stdin; each may be a URL (s3://, gs://, sftp://, file://). What an earlier
    call has done is not done again.
    """
    from attest import batch as batches
    from attest import pipeline

    wanted = [*chosen(choices), *assignments]
    plan = batches.Plan(
        configurations={
            label: pipeline.configure(name, wanted) for label, name in labelled(observers).items()
        },
        **batches.place(output, choices["journal"]),
        cluster=choices["cluster"],
        kinds=tuple(kind for kind in ("mcap", "rrd") if kind in choices["write"]),
        jobs=choices["jobs"],
        limits=batches.Limits(
            timeout_s=choices["timeout"] or None, memory_gb=choices["memory"] or None
        ),
        force=choices["force"],
        retry=choices["retry"],
    )
    run_batch(paths, plan, quiet=quiet, as_json=as_json)


def run_batch(paths: tuple[str, ...], plan: "Plan", *, quiet: bool, as_json: bool) -> None:
    """Run a batch, tell what comes of it, and write the summary."""
    from attest import batch as batches

    named = [name for path in paths for name in _listed(path)]
    if not named:
        click.echo("attest: the list is empty: no log to run.", err=True)
        return
    csv = next(iter(plan.configurations.values())).input.csv
    lists = set(named) - set(paths)
    found = batches.find(named, plan.output, csv, plan.results, lists)
    for folder in found.closed:
        click.echo(f"attest: {printable(folder)}: cannot look into this folder", err=True)
    counts: Counter[str] = Counter()
    with batches.Journal(plan.output) as journal:
        expected = len(found.logs) * len(plan.configurations)
        with _bar(expected, quiet=quiet) as advance:
            for row, before in batches.run(found.logs, plan, journal):
                counts[row["status"]] += 1
                counts["done before"] += before
                advance()
                _tell(row, before=before, as_json=as_json)
        written = batches.write_results(journal, plan.output, plan.results)
    if journal.damaged:
        click.echo(
            f"attest: {journal.path}: {journal.damaged} lines are no rows and left out: what they "
            "told of is done again when it is named.",
            err=True,
        )
    if not (quiet or as_json):
        click.echo(_text(found, counts, plan.results or f"{plan.output}", written))
    failed = expected - counts["ok"]
    if failed:
        raise ReadError(f"{failed} of {expected} runs did not end well. See {written[0]}.")
    if found.closed:
        raise ReadError(f"{len(found.closed)} folders cannot be looked into; see above.")


def _listed(path: str) -> list[str]:
    """Return the paths that a list names, or the path itself."""
    from attest import batch as batches

    if path == "-":
        return batches.names_in(sys.stdin.buffer.read())
    if not path.startswith("@"):
        return [path]
    try:
        return batches.names_in(Path(path[1:]).read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}. Name a file with a path a line.") from error


@contextmanager
def _bar(total: int, *, quiet: bool) -> Iterator[Callable[[], None]]:
    """Show how many are done on stderr where that is a terminal; yield what tells of one more."""
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"))
    with Progress(
        *columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("batch", total=total)
        yield lambda: bar.update(task, advance=1)


def _tell(row: Row, *, before: bool, as_json: bool) -> None:
    """Tell of a row: all of it on stdout, or what went wrong on stderr."""
    if as_json:
        click.echo(json.dumps(row))
    elif row["status"] != "ok" and not before:
        who = f"{row['path']}: {row['observer']} {row['status']}: "
        error = str(row["error"]).removeprefix(f"{row['path']}: ")
        click.echo(f"attest: {printable(' '.join((who + error).split()))}", err=True)


def _text(found: "Found", counts: Counter[str], output: str, written: "list[Path]") -> str:
    """Return what came of a batch."""
    statuses = [
        f"{counts[status]:,} {status}"
        for status in ("ok", "failed", "crashed", "timeout", "memory")
        if counts[status]
    ]
    lines = [f"{len(found.logs):,} logs: {', '.join(statuses)}"]
    if counts["done before"]:
        lines[0] += f"; {counts['done before']:,} of them done before"
    if found.left_out:
        what = "that are no logs, results of attest, or links to folders"
        lines.append(f"  left out    {found.left_out:,} {what}")
    names = " ".join(path.name for path in written)
    return "\n".join([*lines, f"  written     {output.rstrip('/')}/  {names}"])
