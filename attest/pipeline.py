"""The whole program, read aloud: read, condition, estimate, evaluate, write."""

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from attest import (
    conditioning,
    config,
    evaluation,
    inspection,
    observers,
    readers,
    report,
    writers,
)
from attest.config import Configuration
from attest.errors import AttestError, ConfigError, ReadError
from attest.estimates import Estimates
from attest.metrics import Metrics
from attest.observers.observer import Observer
from attest.readers import reference_file
from attest.readers.options import ReadOptions
from attest.recording import Note, Recording, Reference
from attest.result import Result, ranked
from attest.samples import Samples

OnStage = Callable[[str], None]
Conditioned = tuple[Samples, tuple[Note, ...]]

SMOOTHER = "smoother"
"""The reference that attest makes itself, of a log that has no better one."""
FEW = 16
"""Steps that an observer is compiled with before its time is taken."""


def configure(name: str, assignments: Sequence[str] = ()) -> Configuration:
    """Return the checked configuration of a name or a YAML file, with ``--set`` on top.

    Raises
    ------
    ConfigError
        There is no such configuration, or it is wrong.
    """
    document = config.override(config.read(config.find(name)), assignments)
    observer = observers.get(str(document["observer"]))
    return config.validate(observer.config, document, name)


def read(log: Path, configuration: Configuration) -> Recording:
    """Read a log as the configuration asks, and the reference if that is of another file."""
    wanted = configuration.input
    options = ReadOptions(
        vehicle=wanted.vehicle,
        imu=wanted.imu,
        topics=wanted.topics.model_dump(exclude_none=True),
        world=wanted.world,
        csv=wanted.csv,
        units=wanted.unit.model_dump(exclude_none=True),
        axes=wanted.axes.model_dump(exclude_none=True),
    )
    name = configuration.evaluation.reference
    recording = reference_file.join(
        readers.read(log, options), None if name == SMOOTHER else name, options
    )
    return inspection.in_time(recording, configuration.evaluation)


def referenced(
    log: Path, configuration: Configuration, timing: dict[str, float], on_stage: OnStage | None
) -> tuple[Recording, Reference | None]:
    """Read a log, and choose its reference: a name that is not there is refused before the work."""
    with _stage("reading", timing, on_stage):
        recording = doubted(read(log, configuration))
    recording = _smoothed(recording, configuration, timing, on_stage)
    return recording, evaluation.choose(recording, configuration.evaluation.reference)


def _smoothed(
    recording: Recording,
    configuration: Configuration,
    timing: dict[str, float],
    on_stage: OnStage | None,
) -> Recording:
    """Add the smoother's attitude to the references, where it is asked for and the log has none."""
    if configuration.evaluation.reference != SMOOTHER or SMOOTHER in recording.references:
        return recording
    if configuration.observer == SMOOTHER:
        raise ConfigError(
            f"{recording.path}: the smoother is no reference for itself. Choose another observer, "
            "or another --reference."
        )
    smoother = observers.get(SMOOTHER)
    settings = config.with_its_sensors(smoother.config, SMOOTHER, configuration)
    with _stage("smoothing", timing, on_stage):
        samples, _ = conditioning.condition(recording, settings)
        found = smoother.estimate(samples, settings)
        notes = [note for note in smoother.notes(samples, found, settings) if note.doubt]
    text = "attest's own, of the whole log and the same sensors: not independent, not truth"
    notes.insert(0, Note(text, doubt=True))
    told = (replace(note, text=f"reference 'smoother': {note.text}") for note in notes)
    made = {SMOOTHER: Reference(SMOOTHER, "smoother", found.t, found.q), **recording.references}
    return replace(recording, references=made, notes=(*recording.notes, *told))


def inspect(
    log: Path, configuration: Configuration, options: Sequence[str] = ()
) -> tuple[Recording, dict[str, Any]]:
    """Read a log, and describe what is in it and whether it can answer.

    The options are those that the command to run it will need.
    """
    recording = doubted(read(log, configuration))
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
        if wanted.reference != SMOOTHER or SMOOTHER in recording.references:
            reference = evaluation.choose(recording, wanted.reference)
            notes += evaluation.unshared(samples.t, reference, wanted)
    except AttestError as error:
        why = str(error).removeprefix(f"{recording.path}: ")
        return [Note(f"a run would refuse this log: {why}", doubt=True)]
    return [note for note in notes if note.doubt]


def doubted(recording: Recording) -> Recording:
    """Add what in a recording cannot be to its notes."""
    return replace(recording, notes=(*recording.notes, *inspection.doubts(recording)))


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A log, read for observers that read and score it in the same way."""

    recording: Recording
    reference: Reference | None
    timing: Mapping[str, float]
    """Of the reading, seconds."""
    conditioned: dict[str, Conditioned] = field(default_factory=dict)
    """Samples that observers share, by what makes them."""


def opened(log: Path, configuration: Configuration, on_stage: OnStage | None = None) -> Opened:
    """Read a log, once for all observers whose `reading` is the same.

    Raises
    ------
    ReadError
        The log cannot be used.
    ConfigError
        The log lacks the reference.
    """
    timing: dict[str, float] = {}
    recording, reference = referenced(log, configuration, timing, on_stage)
    return Opened(recording, reference, timing)


def reading(configuration: Configuration) -> Mapping[str, Any]:
    """Return what configurations must share to be run over one reading, and to be compared."""
    whole = config.effective(configuration)
    return {section: whole[section] for section in ("input", "evaluation")}


def observe(
    log: Opened,
    configuration: Configuration,
    on_stage: OnStage | None = None,
    *,
    label: str | None = None,
    compiled: bool = True,
) -> Result:
    """Run one observer over a log that is read; a label stands for the observer's name.

    What is not compiled yet is compiled before time is taken.

    Raises
    ------
    ReadError
        The data in the log cannot be used.
    ConfigError
        The configuration does not suit the log.
    """
    timing, how = dict(log.timing), config.sampling(configuration)
    with _stage("conditioning", timing, on_stage):
        if how not in log.conditioned:
            log.conditioned[how] = conditioning.condition(log.recording, configuration)
    if not compiled:
        _compile(log.conditioned[how][0], configuration)
    result = _observe(
        log.recording, log.conditioned[how], log.reference, configuration, timing, on_stage
    )
    if label is not None:
        result = replace(result, estimates=replace(result.estimates, observer=label))
    return replace(result, summary=report.summarise(result, timing))


def run(log: Path, configuration: Configuration, on_stage: OnStage | None = None) -> Result:
    """Run one log through one observer.

    Raises
    ------
    ReadError
        The log, or the data in it, cannot be used.
    ConfigError
        The configuration does not suit the log.
    """
    return observe(opened(log, configuration, on_stage), configuration, on_stage)


def compare(
    log: Path, configurations: Mapping[str, Configuration], on_stage: OnStage | None = None
) -> tuple[list[Result], dict[str, str]]:
    """Run several observers, by label, over one log that is read once.

    Returns
    -------
    results
        Of those that could run, the best first; their labels stand for the observers' names.
    failed
        Of the others, why not.

    Raises
    ------
    ReadError
        The log cannot be used, or by none of them.
    ConfigError
        The configurations read or score the log in different ways, or the log lacks the reference.
    """
    config.refuse_unlike(configurations)
    read_once = opened(log, _first(configurations), on_stage)
    results: list[Result] = []
    failed: dict[str, str] = {}
    for label, configuration in configurations.items():
        if _is_itself(read_once.reference, configuration):
            failed[label] = "is the reference, and not ranked against itself"
            continue
        try:
            results.append(observe(read_once, configuration, on_stage, label=label, compiled=False))
        except AttestError as error:
            failed[label] = str(error)
    if not results:
        raise ReadError(f"{log}: no observer could run. {next(iter(failed.values()))}")
    return ranked(results), failed


def _first(configurations: Mapping[str, Configuration]) -> Configuration:
    """Return the first that the smoother may be the reference of, by whose sensors it then goes."""
    every = list(configurations.values())
    return next((each for each in every if each.observer != SMOOTHER), every[0])


def _is_itself(reference: Reference | None, configuration: Configuration) -> bool:
    made = reference is not None and reference.kind == SMOOTHER
    return made and configuration.observer == SMOOTHER


def _compile(samples: Samples, configuration: Configuration) -> None:
    """Run the observer over a few steps, so that its compilation is not counted as its time."""
    n = len(samples.t)
    named = {each.name: getattr(samples, each.name) for each in fields(samples)}
    few: dict[str, Any] = {
        name: values[:FEW]
        for name, values in named.items()
        if isinstance(values, np.ndarray) and len(values) == n > FEW
    }
    with suppress(AttestError):  # the whole log will tell
        observers.get(configuration.observer).estimate(replace(samples, **few), configuration)


def _observe(
    recording: Recording,
    conditioned: Conditioned,
    reference: Reference | None,
    configuration: Configuration,
    timing: dict[str, float],
    on_stage: OnStage | None,
) -> Result:
    """Estimate and evaluate; the summary is left to be made."""
    samples, notes = conditioned
    observer = observers.get(configuration.observer)
    with _stage("observing", timing, on_stage):
        estimates = observer.estimate(samples, configuration)
        notes += observer.notes(samples, estimates, configuration)
    with _stage("evaluating", timing, on_stage):
        metrics, scored = evaluation.evaluate(
            samples, estimates, reference, configuration.evaluation
        )
        estimates = _with_lyapunov(observer, configuration, estimates, metrics)
        claims = evaluation.attest(samples, estimates, metrics, configuration, whole=observer.whole)
        if observer.promises is not None:
            claims += observer.promises(samples, estimates, configuration)
    return Result(
        recording=recording,
        samples=samples,
        estimates=estimates,
        reference=reference,
        metrics=metrics,
        configuration=config.effective(configuration),
        notes=(*recording.notes, *notes, *scored),
        summary={},
        claims=claims,
    )


def write(
    results: Sequence[Result],
    folder: Path,
    on_stage: OnStage | None = None,
    document: Mapping[str, object] | None = None,
    kinds: Collection[str] = writers.KINDS,
) -> list[Path]:
    """Write MCAP, Rerun and JSON of the runs over one log, and return their paths.

    The JSON is the run's summary, unless another document is given. Of the others, those of the
    kinds named are written.

    Raises
    ------
    WriteError
        An output cannot be written; it is then not there, or the old one is.
    """
    if on_stage:
        on_stage("writing")
    return list(writers.write(results, folder, document, kinds))


def _with_lyapunov(
    observer: Observer, configuration: Configuration, estimates: Estimates, metrics: Metrics | None
) -> Estimates:
    """Add the paper's Lyapunov function where there is one and truth is known."""
    bias = estimates.gyro_bias
    if observer.lyapunov is None or metrics is None or metrics.bias_true is None or bias is None:
        return estimates
    V = observer.lyapunov(estimates, configuration, bias - np.array(metrics.bias_true))
    return replace(estimates, lyapunov=V)


@contextmanager
def _stage(name: str, timing: dict[str, float], on_stage: OnStage | None) -> Iterator[None]:
    if on_stage:
        on_stage(name)
    began = time.perf_counter()
    yield
    timing[name] = time.perf_counter() - began
