"""What a run leaves behind: MCAP, Rerun and JSON, each whole or not there."""

from collections.abc import Iterator
from pathlib import Path

from attest.result import Result


def write(result: Result, folder: Path) -> Iterator[Path]:
    """Write every output of a run, each as the iterator reaches it, and yield its path.

    The JSON comes last: where it is, the others are.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    # Rerun's library takes most of a second to import: nothing before this needs it
    from attest.writers.json import write_json
    from attest.writers.mcap import write_mcap
    from attest.writers.rerun import write_rerun

    name = result.estimates.observer
    for ending, write_one in (("mcap", write_mcap), ("rrd", write_rerun), ("json", write_json)):
        path = folder / f"{name}.{ending}"
        write_one(path, result)
        yield path
