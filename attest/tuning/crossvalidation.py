"""Gains that bring an observer nearest to the references of logs, cross-validated.

The data are cut into folds: by log, or, of a single log, into blocks one after another in time.
For each fold the gains are tuned on the others, and scored on it; these scores together say what
tuning is worth on data that it has not seen. The gains that are given are tuned on everything.
Over a single log the observer runs through all of it, so that a block begins with what the
observer knew from those before it.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from math import inf, isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from attest.config import Configuration
from attest.errors import AttestError, ConfigError, ReadError
from attest.tuning import scoring, search
from attest.tuning.knobs import Knob, Values, configured, knobs, start_of, values_at
from attest.tuning.plan import Errors, Fold, Plan, Tuned
from attest.tuning.scoring import Log, Task

Array = NDArray[np.float64]
Tell = Callable[[str], None]

STAY = 0.01
"""Share of the error that a key must win to go all the way from one end of its range to the other;
keys that the error does not feel stay where they start."""


def tune(
    paths: Sequence[Path],
    configuration: Configuration,
    plan: Plan,
    on_stage: Tell | None = None,
) -> Tuned:
    """Tune an observer on logs.

    Raises
    ------
    ReadError
        No log can be used, or there is too little to hold a part back.
    ConfigError
        There is nothing to tune, or the observer does not run on these logs.
    """
    if configuration.evaluation.reference == "none":
        raise ConfigError("--reference none: tuning needs one. Name it, or leave the option out.")
    _refuse_twice(paths)
    tell: Tell = on_stage or (lambda _: None)
    tuned = knobs(configuration, plan.key, plan.factor)
    logs, failed = _prepared(paths, configuration, plan, tuned, tell)
    task, names = _task(logs, plan)
    with _lanes(plan.jobs) as lanes:
        runs = _Runs(task, configuration, tuned, lanes)
        folds = _folds(runs, names, plan, tell)
        best = runs.best(0, plan, "on all", tell)
    begin = tuple(knob.start for knob in tuned)
    return Tuned(
        logs=logs,
        failed=failed,
        plan=plan,
        knobs=tuned,
        values=best,
        training=Errors(start=runs.score(begin, 0), tuned=runs.score(best, 0)),
        held_back=runs.held_back(folds),
        folds=tuple(folds.values()),
        candidates=runs.candidates,
    )


def _refuse_twice(paths: Sequence[Path]) -> None:
    """Refuse a log that is named twice: held back, it would still be among the others."""
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise ConfigError(f"{path}: named twice, so that it cannot be held back. Name it once.")
        seen.add(path.resolve())


def _prepared(
    paths: Sequence[Path],
    configuration: Configuration,
    plan: Plan,
    tuned: Sequence[Knob],
    tell: Tell,
) -> tuple[tuple[Log, ...], dict[str, str]]:
    """Return the logs that can be used, and of the others why not."""
    reconditioned = any(knob.key.startswith("conditioning.") for knob in tuned)
    logs, failed = [], {}
    for path in paths:
        tell(f"reading {path.name}")
        try:
            log = scoring.prepare(path, configuration, plan.skip, reconditioned=reconditioned)
        except AttestError as error:
            if len(paths) == 1:
                raise
            failed[str(path)] = str(error)
        else:
            logs.append(log)
    if not logs:
        raise ReadError(f"none of {len(paths)} logs can be used. {next(iter(failed.values()))}")
    return scoring.doubted_copies(logs, _count(logs, plan)), failed


def _count(logs: Sequence[Log], plan: Plan) -> int:
    """Return how many folds several logs are cut into: each n-th of them is held back together."""
    return min(plan.folds, len(logs))


def _task(logs: tuple[Log, ...], plan: Plan) -> tuple[Task, list[str]]:
    """Cut the data into folds, and name these."""
    if len(logs) == 1:
        count = plan.folds
        blocks = [scoring.in_time(logs[0], count)]
        names = [f"block {fold + 1} of {count}" for fold in range(count)]
    else:
        count = _count(logs, plan)
        blocks = [scoring.as_one(log, i % count) for i, log in enumerate(logs)]
        names = [", ".join(log.path.name for log in logs[fold::count]) for fold in range(count)]
    one = np.eye(count, dtype=np.bool_)
    parts = np.concatenate([np.ones((1, count), np.bool_), ~one, one])
    return Task(logs, tuple(blocks), parts, plan.metric), names


def _folds(runs: "_Runs", names: Sequence[str], plan: Plan, tell: Tell) -> dict[int, Fold]:
    """Tune without each fold, and score on it; folds without a sample are left out."""
    count, folds = len(names), {}
    begin = tuple(knob.start for knob in runs.knobs)
    for fold, name in enumerate(names):
        train, held = 1 + fold, 1 + count + fold
        if not (runs.counts[:, train].any() and runs.counts[:, held].any()):
            continue
        best = runs.best(train, plan, f"without {name}", tell)
        folds[held] = Fold(
            held_back=name,
            values=best,
            training=Errors(start=runs.score(begin, train), tuned=runs.score(best, train)),
            error=Errors(start=runs.score(begin, held), tuned=runs.score(best, held)),
        )
    if len(folds) < 2:
        raise ReadError(
            f"{runs.task.logs[0].path}: the reference is in one block of time only, so that none "
            "can be held back. Give a longer log, or several."
        )
    return folds


class _Runs:
    """The candidates that were run, each once, and their sums of squared errors."""

    def __init__(
        self, task: Task, configuration: Configuration, tuned: tuple[Knob, ...], lanes: Executor
    ) -> None:
        self.task, self.knobs = task, tuned
        self.counts = scoring.counts(task)
        self._configuration, self._lanes = configuration, lanes
        self._sums: dict[tuple[Values, ...], Array] = {}
        self._error: Exception | None = None
        self._at([tuple(knob.start for knob in tuned)])  # compiles, before lanes do

    @property
    def candidates(self) -> int:
        """How many were run."""
        return len(self._sums)

    def best(self, part: int, plan: Plan, name: str, tell: Tell) -> tuple[Values, ...]:
        """Return the values with the least error on a part."""

        def function(points: Array) -> Array:
            wanted = [values_at(self.knobs, u) for u in points]
            self._at(wanted)
            errors = np.array([self.score(values, part) for values in wanted])
            away = np.square(points - start_of(self.knobs)).sum(axis=1)
            function_of: Array = errors * (1.0 + STAY * away)
            return function_of

        point, least = search.least(
            function,
            start_of(self.knobs),
            plan.generations,
            plan.seed,
            lambda value: tell(f"{name}  {value:.2f}°"),
        )
        if not isfinite(least) and self._error is not None:
            raise self._error  # none can run, so it is not the gains
        return values_at(self.knobs, point)

    def score(self, values: tuple[Values, ...], part: int) -> float:
        """Return the error of a candidate on a part, degrees."""
        (sums,) = self._at([values])
        return scoring.mean_rmse(sums[:, part], self.counts[:, part])

    def held_back(self, folds: Mapping[int, Fold]) -> Errors:
        """Return the error over what was held back, each part with the values of its own fold."""
        begin = tuple(knob.start for knob in self.knobs)
        parts, number = list(folds), self.counts[:, list(folds)].sum(axis=1)
        (start,) = self._at([begin])
        tuned = [self._at([fold.values])[0][:, part] for part, fold in folds.items()]
        return Errors(
            start=scoring.mean_rmse(start[:, parts].sum(axis=1), number),
            tuned=scoring.mean_rmse(np.sum(tuned, axis=0), number),
        )

    def _at(self, wanted: Sequence[tuple[Values, ...]]) -> list[Array]:
        new = [values for values in dict.fromkeys(wanted) if values not in self._sums]
        self._sums.update(zip(new, self._lanes.map(self._run, new), strict=True))
        return [self._sums[values] for values in wanted]

    def _run(self, values: tuple[Values, ...]) -> Array:
        try:
            candidate = configured(self._configuration, self.knobs, values)
            return scoring.squares(self.task, candidate)
        except (AttestError, ArithmeticError) as error:  # the worst there is, not the end
            self._error = self._error or error
            return np.full(self.counts.shape, inf)


@contextmanager
def _lanes(jobs: int) -> Iterator[Executor]:
    """Give threads for candidates: the kernels run without Python's lock."""
    lanes = ThreadPoolExecutor(jobs or os.cpu_count() or 1)
    try:
        yield lanes
    finally:  # an interrupt waits for what runs, not for what would
        lanes.shutdown(cancel_futures=True)
