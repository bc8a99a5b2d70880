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
        shown = (p for p in sorted(path.rglob("[!.]*")) if p.is_file() and not _hidden(p, path))
        inside = [p for p in shown if readers.is_log(p)]
        if not inside:
            raise ReadError(f"{path}: no log in this folder. Name a log, or a folder with logs.")
        found += inside
    return found


def _hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)
