"""The whole program, read aloud: read, condition, estimate, evaluate, write."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from attest import conditioning, config, evaluation, observers, readers, report, writers
from attest.config import Configuration
from attest.estimates import Estimates
from attest.metrics import Metrics
from attest.observers.observer import Observer
from attest.readers.options import ReadOptions
from attest.recording import Recording
from attest.result import Result

OnStage = Callable[[str], None]


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
    """Read a log as the configuration asks."""
    wanted = configuration.input
    options = ReadOptions(
        vehicle=wanted.vehicle,
        imu=wanted.imu,
        topics=wanted.topics.model_dump(exclude_none=True),
        world=wanted.world,
    )
    return readers.read(log, options)


def run(log: Path, configuration: Configuration, on_stage: OnStage | None = None) -> Result:
    """Run one log through one observer.

    Raises
    ------
    ReadError
        The log, or the data in it, cannot be used.
    ConfigError
        The configuration does not suit the log.
    """
    timing: dict[str, float] = {}
    observer = observers.get(configuration.observer)
    with _stage("reading", timing, on_stage):
        recording = read(log, configuration)
        reference = evaluation.choose(recording, configuration.evaluation.reference)
    with _stage("conditioning", timing, on_stage):
        samples, conditioned = conditioning.condition(recording, configuration)
    with _stage("observing", timing, on_stage):
        estimates = observer.estimate(samples, configuration)
    with _stage("evaluating", timing, on_stage):
        metrics, scored = evaluation.evaluate(
            samples, estimates, reference, configuration.evaluation
        )
        estimates = _with_lyapunov(observer, configuration, estimates, metrics)
        claims = evaluation.attest(samples, estimates, metrics, configuration)
        if observer.promises is not None:
            claims += observer.promises(samples, estimates, configuration)
    result = Result(
        recording=recording,
        samples=samples,
        estimates=estimates,
        reference=reference,
        metrics=metrics,
        configuration=config.effective(configuration),
        notes=(*recording.notes, *conditioned, *scored),
        summary={},
        claims=claims,
    )
    return replace(result, summary=report.summarise(result, timing))


def write(result: Result, folder: Path, on_stage: OnStage | None = None) -> list[Path]:
    """Write MCAP, Rerun and JSON of a run, and return their paths.

    Raises
    ------
    WriteError
        An output cannot be written; it is then not there, or the old one is.
    """
    if on_stage:
        on_stage("writing")
    return list(writers.write(result, folder))


def folder_for(result: Result, output: Path, logs: Sequence[Path]) -> Path:
    """Return where a run is written: ``OUTPUT/<log stem>``, and for another log's, its digest too.

    A folder is another log's when two logs of this call share a stem, or when what is in it was
    made from a log at another path.
    """
    log = result.recording.path
    stem = log.stem.strip(".") or "log"  # a stem of dots would lead out of the folder
    folder = output / stem
    first = next(other for other in logs if (other.stem.strip(".") or "log") == stem)
    if first == log and _owners(folder) <= {str(log.resolve())}:
        return folder
    return output / f"{stem}-{str(result.summary['log']['sha256'])[:8]}"


def _owners(folder: Path) -> set[str]:
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
