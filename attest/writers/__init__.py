"""What runs over one log leave behind: MCAP, Rerun and JSON, each whole or not there."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from attest.result import Result

KINDS = ("mcap", "rrd")
"""What can be written beside the JSON."""


def write(
    results: Sequence[Result],
    folder: Path,
    document: Mapping[str, object] | None = None,
    kinds: Collection[str] = KINDS,
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

    name = results[0].estimates.observer if document is None else "compare"
    if "mcap" in kinds:
        from attest.writers.mcap import write_mcap

        write_mcap(path := folder / f"{name}.mcap", results)
        yield path
    if "rrd" in kinds:
        from attest.writers.rerun import write_rerun

        write_rerun(path := folder / f"{name}.rrd", results)
        yield path
    write_json(
        path := folder / f"{name}.json", results[0].summary if document is None else document
    )
    yield path
