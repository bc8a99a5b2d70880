"""Each claim of a paper against what came out, as Markdown and JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import attest
from attest.claims import Claim
from attest.files import replacing
from attest.reproduction.experiment import Experiment
from attest.writers.json import to_json

WORDS = {True: "yes", False: "**no**", None: "open"}


def write(experiment: Experiment, folder: Path) -> Iterator[Path]:
    """Write both tables, and yield their paths.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    contents = {"md": markdown(experiment), "json": _json(experiment)}
    for ending, content in contents.items():
        path = folder / f"{experiment.name}.{ending}"
        with replacing(path) as part:
            part.write_text(content, encoding="utf-8")
        yield path


def markdown(experiment: Experiment) -> str:
    """Return the table for people."""
    seeds = f"{experiment.seeds} seeds" if experiment.seeds else "nothing in it is random"
    lines = [
        f"# {experiment.name}: {experiment.title}",
        "",
        f"{experiment.paper}; {seeds}; attest {attest.__version__}.",
        "",
        "| claim | source | reproduced | what came out |",
        "|---|---|---|---|",
        *(_row(claim) for claim in experiment.claims),
        "",
        "Where the paper leaves something open:",
        "",
        *(f"- {note}" for note in experiment.notes),
        "",
        *(f"![{name}]({name}.png)" for name in experiment.panels),
    ]
    return "\n".join(lines) + "\n"


def _row(claim: Claim) -> str:
    cells = (claim.statement, claim.source, WORDS[claim.holds], claim.seen)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _json(experiment: Experiment) -> str:
    """Return the table for scripts."""
    document = {
        "schema": 1,
        "experiment": experiment.name,
        "title": experiment.title,
        "paper": experiment.paper,
        "seeds": experiment.seeds,
        "claims": [asdict(claim) for claim in experiment.claims],
        "notes": list(experiment.notes),
        "figures": [f"{name}.png" for name in experiment.panels],
        "versions": {"attest": attest.__version__},
    }
    return to_json(document, indent=2) + "\n"


def text(experiment: Experiment) -> str:
    """Return the table for a terminal."""
    words = {True: "yes", False: "NO", None: "open"}
    lines = [f"{experiment.name}  {experiment.title}", f"  {experiment.paper}"]
    for claim in experiment.claims:
        lines.append(f"  {words[claim.holds]:>5s}   {claim.statement} [{claim.source}]")
        lines.append(f"          {claim.seen}")
    return "\n".join(lines)
