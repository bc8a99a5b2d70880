"""The logs that a command line names."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from attest.errors import ConfigError, ReadError

if TYPE_CHECKING:
    from attest.config import Csv


def logs(named: Sequence[str], csv: "Csv | None" = None) -> list[Path]:
    """Return the logs, folders replaced by those in them, by content.

    With the columns of a CSV told, files that have them are logs too.

    Raises
    ------
    ReadError
        A folder holds none.
    ConfigError
        A name is empty, which would stand for the working folder.
    """
    from attest import readers

    found = []
    if "" in named:
        raise ConfigError("an empty name for a log. Name a log, or a folder with logs.")
    for path in map(Path, named):
        if not path.is_dir():
            found.append(path)
            continue
        inside = readers.logs_in(path, csv)
        if not inside:
            what = (
                "no log"
                if csv is None or not csv.maps
                else "no log, and no CSV with the columns of input.csv,"
            )
            raise ReadError(f"{path}: {what} in this folder. Name a log, or a folder with logs.")
        found += inside
    return found
