"""Where the results of a log are written."""

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from attest.result import Result


def folder_for(result: Result, output: Path, logs: Sequence[Path]) -> Path:
    """Return where a run is written: ``OUTPUT/<log stem>``, and for another log's, its digest too.

    A folder is another log's when two logs of this call share a stem, or when what is in it was
    made from a log at another path.
    """
    log = result.recording.path
    stem = log.stem.strip(".") or "log"  # a stem of dots would lead out of the folder
    folder = output / stem
    first = next(other for other in logs if (other.stem.strip(".") or "log") == stem)
    if first == log and owners(folder) <= {str(log.resolve())}:
        return folder
    return output / f"{stem}-{str(result.summary['log']['sha256'])[:8]}"


def owners(folder: Path) -> set[str]:
    """Return the logs that the results in a folder were made from."""
    owners: set[str] = set()
    try:
        found = list(folder.glob("*.json"))
    except OSError:  # a name that is too long, or no right to look: writing will tell
        return owners
    for path in found:
        with suppress(OSError, ValueError, KeyError, TypeError):  # not a run's, so nobody's
            owners.add(str(json.loads(path.read_text(encoding="utf-8"))["log"]["path"]))
    return owners
