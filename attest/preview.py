"""A log before a run: what is in it, whether it can answer, and what a run would doubt."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from attest import conditioning, evaluation, inspection, pipeline, report
from attest.config import Configuration
from attest.errors import AttestError
from attest.recording import Note, Recording


def describe(
    log: Path, configuration: Configuration, options: Sequence[str] = ()
) -> tuple[Recording, dict[str, Any]]:
    """Read a log, and describe what is in it and whether it can answer.

    The options are those that the command to run it will need.
    """
    recording = pipeline.doubted(pipeline.read(log, configuration))
    recording = replace(
        recording, notes=(*recording.notes, *_conditioning_doubts(recording, configuration))
    )
    described, inspected = report.describe(recording), inspection.inspect(recording)
    for name, figures in inspected.pop("signals").items():
        described["signals"][name] |= figures
    told = {
        "default_reference": next(iter(recording.references), None),
        "command": inspection.command(recording, options),
    }
    return recording, described | inspected | told


def _conditioning_doubts(recording: Recording, configuration: Configuration) -> list[Note]:
    """Return what a run would doubt before any observer sees the log, or why it would refuse it."""
    if "gyro" not in recording.signals:  # of which the command tells
        return []
    try:
        samples, notes = conditioning.condition(recording, configuration)
        wanted = configuration.evaluation
        if wanted.reference != pipeline.SMOOTHER or pipeline.SMOOTHER in recording.references:
            reference = evaluation.choose(recording, wanted.reference)
            notes += evaluation.unshared(samples.t, reference, wanted)
    except AttestError as error:
        why = str(error).removeprefix(f"{recording.path}: ")
        return [Note(f"a run would refuse this log: {why}", doubt=True)]
    return [note for note in notes if note.doubt]
