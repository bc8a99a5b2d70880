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
from attest.errors import AttestError, ConfigError
from attest.estimates import Estimates
from attest.metrics import Metrics
from attest.observers.observer import Observer
from attest.readers import reference_file
from attest.readers.options import ReadOptions
from attest.recording import Note, Recording, Reference
from attest.result import Result
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
    result = _observe(log, log.conditioned[how], configuration, timing, on_stage)
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
    log: Opened,
    conditioned: Conditioned,
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
            samples, estimates, log.reference, configuration.evaluation
        )
        estimates = _with_lyapunov(observer, configuration, estimates, metrics)
        claims = evaluation.attest(samples, estimates, metrics, configuration, whole=observer.whole)
        if observer.promises is not None:
            claims += observer.promises(samples, estimates, configuration)
    return Result(
        recording=log.recording,
        samples=samples,
        estimates=estimates,
        reference=log.reference,
        metrics=metrics,
        configuration=config.effective(configuration),
        notes=(*log.recording.notes, *notes, *scored),
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
