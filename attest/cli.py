"""The command line. Data on stdout, everything else on stderr; one line per expected error.

Nothing heavy is imported before a command runs: ``attest --help`` is quick.
"""

import json
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

import attest
from attest.errors import AttestError, ConfigError, ReadError

if TYPE_CHECKING:
    from attest.config import Configuration

INTERRUPTED = 130

EXAMPLES = """\b
Examples:
  attest run flight.tlog --observer fts
  attest run flight.tlog --set gains.k_p=0.5 --reference ATTITUDE
  attest info flight.tlog
  attest config show fts > mine.yaml
"""


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog=EXAMPLES,
    no_args_is_help=True,
)
@click.version_option(attest.__version__, prog_name="attest")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(*, debug: bool) -> None:
    """Tell whether the attitude was right.

    Runs an attitude observer on SO(3) over a log, compares it with a reference, and writes MCAP,
    Rerun and JSON.
    """


def main() -> NoReturn:
    """Run the command, and turn what goes wrong into one line and an exit code."""
    debug = "--debug" in sys.argv[1:]
    if not debug:  # an overflow in a hostile log is dealt with, and no news to the user
        warnings.simplefilter("ignore", RuntimeWarning)
    try:
        code = cli.main(standalone_mode=False)
    except AttestError as error:
        _complain(error, str(error), debug=debug)
        code = error.exit_code
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "attest"
        click.echo(f"attest: {error.format_message()} See `{command} -h`.", err=True)
        code = ConfigError.exit_code
    except click.ClickException as error:
        click.echo(f"attest: {error.format_message()}", err=True)
        code = ConfigError.exit_code
    except MemoryError as error:
        _complain(
            error, "not enough memory for this log. Cut it, or use a larger machine.", debug=debug
        )
        code = 1
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except (KeyboardInterrupt, click.exceptions.Abort):
        click.echo("attest: interrupted.", err=True)
        code = INTERRUPTED
    sys.exit(code or 0)


def _complain(error: Exception, text: str, *, debug: bool) -> None:
    if debug:
        import traceback

        traceback.print_exception(error)
    click.echo(f"attest: {' '.join(text.split())}", err=True)


quiet_option = click.option("--quiet", "-q", is_flag=True, help="Print errors only.")
json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print JSON instead of text; of several logs, a line each.",
)


@cli.command(
    epilog="""\b
Examples:
  attest run flight.tlog
  attest run flight.tlog --observer mine.yaml --output results
  attest run flight.csv --world enu --reference none
  attest run flights/ --quiet
"""
)
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@click.option(
    "--observer", "-o", default="fts", metavar="NAME|FILE.yaml", help="Observer, or YAML."
)
@click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="Override a YAML key."
)
@click.option(
    "--reference", metavar="NAME|none", help="Compare with this one.  [default: the best]"
)
@click.option(
    "--world", type=click.Choice(["ned", "enu"]), help="World axes of a CSV.  [default: ned]"
)
@click.option("--start", type=float, metavar="S", help="Leave out what is earlier, s.")
@click.option("--end", type=float, metavar="S", help="Leave out what is later, s.")
@click.option("--vehicle", metavar="SYS[/COMP]", help="MAVLink system.  [default: the autopilot]")
@click.option("--output", default="attest_out", type=click.Path(path_type=Path), help="Folder.")
@click.option("--open", "open_viewer", is_flag=True, help="Open the result in the Rerun viewer.")
@quiet_option
@json_option
def run(
    *,
    logs: tuple[str, ...],
    observer: str,
    assignments: tuple[str, ...],
    output: Path,
    open_viewer: bool,
    quiet: bool,
    as_json: bool,
    **choices: Any,
) -> None:
    """Run an observer over logs, or folders of them: MCAP, Rerun, JSON, and a table."""
    from attest import pipeline

    configuration = pipeline.configure(observer, [*_chosen(choices), *assignments])
    found = _logs(logs)
    failed = 0
    for log in found:
        try:
            rrd = _run_one(log, configuration, output, found, quiet=quiet, as_json=as_json)
        except AttestError as error:
            if len(found) == 1:
                raise
            failed += 1
            click.echo(f"attest: {error}", err=True)
            continue
        if open_viewer:
            _open(rrd)
    if failed:
        raise ReadError(f"{failed} of {len(found)} logs could not be used; see above.")


def _chosen(choices: dict[str, Any]) -> Iterator[str]:
    """Yield the options that stand for keys of the configuration, as ``--set`` would have them."""
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


def _logs(named: Sequence[str]) -> list[Path]:
    """Return the logs, folders replaced by those in them, by content.

    Raises
    ------
    ReadError
        A folder holds none.
    ConfigError
        A name is empty, which would stand for the working folder.
    """
    from attest import readers

    logs = []
    if "" in named:
        raise ConfigError("an empty name for a log. Name a log, or a folder with logs.")
    for path in map(Path, named):
        if not path.is_dir():
            logs.append(path)
            continue
        shown = (p for p in sorted(path.rglob("[!.]*")) if p.is_file() and not _hidden(p, path))
        inside = [p for p in shown if readers.is_log(p)]
        if not inside:
            raise ReadError(f"{path}: no log in this folder. Name a log, or a folder with logs.")
        logs += inside
    return logs


def _hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _run_one(
    log: Path,
    configuration: "Configuration",
    output: Path,
    logs: Sequence[Path],
    *,
    quiet: bool,
    as_json: bool,
) -> Path:
    """Run one log, print what came out, and return the path of the .rrd."""
    from attest import pipeline, report

    with _progress(log.name, quiet=quiet) as on_stage:
        result = pipeline.run(log, configuration, on_stage)
        folder = pipeline.folder_for(result, output, logs)
        written = pipeline.write(result, folder, on_stage)
    if as_json:
        text = written[-1].read_text(encoding="utf-8")
        # of several logs, a line each
        click.echo(text if len(logs) == 1 else json.dumps(json.loads(text)) + "\n", nl=False)
    elif not quiet:
        click.echo(report.text_of_run(result.summary, written))
    return written[1]


@contextmanager
def _progress(title: str, *, quiet: bool) -> Iterator[Any]:
    """Show the stages on stderr where that is a terminal; yield what tells of the next one."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=5)

        def on_stage(stage: str) -> None:
            bar.update(task, description=f"{title}  {stage}", advance=1)

        yield on_stage


def _open(rrd: Path) -> None:
    import subprocess

    try:
        subprocess.Popen([sys.executable, "-m", "rerun", str(rrd)])  # noqa: S603  our own file
    except OSError as error:
        raise ReadError(f"{rrd}: the Rerun viewer does not start: {error.strerror}.") from error


@cli.command(epilog="\b\nExample:\n  attest info flight.tlog --json\n")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...")
@click.option("--vehicle", metavar="SYS[/COMP]", help="MAVLink system.  [default: the autopilot]")
@click.option(
    "--world", type=click.Choice(["ned", "enu"]), help="World axes of a CSV.  [default: ned]"
)
@json_option
def info(*, logs: tuple[str, ...], vehicle: str | None, world: Any, as_json: bool) -> None:
    """Tell what is in a log: vehicles, signals, rates, gaps, clocks, references, doubts."""
    from attest import readers, report
    from attest.readers.options import ReadOptions

    for i, log in enumerate(_logs(logs)):
        described = report.describe(readers.read(log, ReadOptions(vehicle=vehicle, world=world)))
        if as_json:
            click.echo(json.dumps(described, ensure_ascii=False, allow_nan=False))
        else:
            click.echo(("\n" if i else "") + report.text_of_info(described))


@cli.command(epilog="\b\nExample:\n  attest simulate quadcopter -o quadcopter.tlog\n")
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


@cli.command(name="observers", epilog="\b\nExample:\n  attest observers fts\n")
@click.argument("name", required=False)
def list_observers(*, name: str | None) -> None:
    """List the observers, or tell one's paper, gains and YAML."""
    from attest import observers, pipeline, report

    if name is None:
        for each in observers.NAMES:
            click.echo(f"{each:12s}{observers.get(each).title}")
    else:
        observer = observers.get(name)
        click.echo(
            report.text_of_observer(observer.title, observer.paper, pipeline.configure(name))
        )


@cli.group(name="config", epilog="\b\nExample:\n  attest config show fts > mine.yaml\n")
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
@click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="Override a YAML key."
)
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
