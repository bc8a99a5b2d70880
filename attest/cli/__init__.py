"""The command line. Data on stdout, everything else on stderr; one line per expected error.

Nothing heavy is imported before a command runs: ``attest --help`` is quick.
"""

import os
import sys
import warnings
from typing import NoReturn

import click

import attest
from attest.cli.batch import batch
from attest.cli.calibrate import calibrate
from attest.cli.compare import compare
from attest.cli.config import configuration
from attest.cli.fleet import fleet
from attest.cli.info import info
from attest.cli.observers import list_observers
from attest.cli.reproduce import reproduce
from attest.cli.run import run
from attest.cli.simulate import simulate
from attest.cli.tune import tune
from attest.errors import AttestError, ConfigError, printable

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
    click.echo(f"attest: {printable(' '.join(text.split()))}", err=True)


COMMANDS = (
    run,
    compare,
    batch,
    fleet,
    tune,
    calibrate,
    info,
    simulate,
    reproduce,
    list_observers,
    configuration,
)

for command in COMMANDS:
    cli.add_command(command)
