"""The logs that a command line names."""

from collections.abc import Sequence
from pathlib import Path

from attest.errors import ConfigError, ReadError


def logs(named: Sequence[str]) -> list[Path]:
    """Return the logs, folders replaced by those in them, by content.

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
        inside = readers.logs_in(path)
        if not inside:
            raise ReadError(f"{path}: no log in this folder. Name a log, or a folder with logs.")
        found += inside
    return found
