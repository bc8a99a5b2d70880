"""What runs over one log leave behind: MCAP, Rerun and JSON, each whole or not there."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from attest.result import Result


def write(
    results: Sequence[Result], folder: Path, document: Mapping[str, object] | None = None
) -> Iterator[Path]:
    """Write every output, each as the iterator reaches it, and yield its path.

    One run is named for its observer, several are ``compare``. The JSON, a run's summary or the
    document given, comes last: where it is, the others are.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    # Rerun's library takes most of a second to import: nothing before this needs it
    from attest.writers.json import write_json
    from attest.writers.mcap import write_mcap
    from attest.writers.rerun import write_rerun

    name = results[0].estimates.observer if document is None else "compare"
    path = folder / f"{name}.mcap"
    write_mcap(path, results)
    yield path
    path = folder / f"{name}.rrd"
    write_rerun(path, results)
    yield path
    path = folder / f"{name}.json"
    write_json(path, results[0].summary if document is None else document)
    yield path
