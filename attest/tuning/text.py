"""What tuning found, as YAML to run with, as the JSON document, and as a table."""

from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from typing import Any

import attest
from attest import config
from attest.config import Configuration
from attest.errors import printable
from attest.tuning.knobs import Values, points_of
from attest.tuning.plan import SHORT, Errors, Tuned

AUTOPILOT = "an autopilot's attitude is not truth: what is tuned towards it becomes like it"

BORDER = 1e-3
"""Share of a key's range in which a value is at its end."""
UNLIKE = 10.0
"""Ratio of a key's values between folds over which it is doubted."""


def yaml_of_tuning(tuned: Tuned, configuration: Configuration) -> str:
    """Return a configuration to run with, and in its head what it is worth."""
    head = "".join(f"# {printable(line)}\n" for line in _head(tuned, configuration))
    return head + config.dump(tuned.configuration(configuration))


def describe(tuned: Tuned, configuration: Configuration) -> dict[str, Any]:
    """Return the JSON document, ``schema: 1``."""
    return {
        "schema": 1,
        "observer": configuration.observer,
        "metric": tuned.plan.metric,
        "logs": [
            {
                "path": str(log.path),
                "reference": log.reference.name,
                "kind": log.reference.kind,
                "doubts": log.doubts,
            }
            for log in tuned.logs
        ],
        "failed": tuned.failed,
        "keys": {
            knob.key: {
                "start": _plain(knob.start),
                "tuned": _plain(values),
                "lowest_factor": knob.low,
                "highest_factor": knob.high,
            }
            for knob, values in zip(tuned.knobs, tuned.values, strict=True)
        },
        "rmse_deg": {"all": asdict(tuned.training), "held_back": asdict(tuned.held_back)},
        "folds": [
            {
                "held_back": fold.held_back,
                "rmse_deg": {"training": asdict(fold.training), "held_back": asdict(fold.error)},
                "keys": {
                    knob.key: _plain(values)
                    for knob, values in zip(tuned.knobs, fold.values, strict=True)
                },
            }
            for fold in tuned.folds
        ],
        "worthwhile": tuned.worthwhile,
        "seed": tuned.plan.seed,
        "candidates": tuned.candidates,
        "configuration": config.effective(tuned.configuration(configuration)),
        "versions": {"attest": attest.__version__},
    }


def text_of_tuning(tuned: Tuned, configuration: Configuration) -> str:
    """Return a table for people."""
    lines = [
        f"{_of(tuned)}  {configuration.observer}",
        *(f"  {log.path.name}  {log.reference.name} ({log.reference.kind})" for log in tuned.logs),
        "",
        *_values(tuned),
        "",
        *_errors(tuned),
        "",
        f"  {_verdict(tuned)}",
        *(f"  ! {warning}" for warning in _warnings(tuned)),
    ]
    return "\n".join(map(printable, lines))


def _head(tuned: Tuned, configuration: Configuration) -> Iterator[str]:
    yield f"{configuration.observer}, by attest tune {attest.__version__}, seed {tuned.plan.seed}"
    yield from (
        f"  {log.path.name}: {log.reference.name} ({log.reference.kind})" for log in tuned.logs
    )
    yield f"{tuned.plan.metric} RMSE, start -> tuned"
    yield f"  on all: {_change(tuned.training)}"
    yield f"  held back, {len(tuned.folds)} folds: {_change(tuned.held_back)}"
    yield _verdict(tuned)
    yield from _warnings(tuned)


def _of(tuned: Tuned) -> str:
    return str(tuned.logs[0].path) if len(tuned.logs) == 1 else f"{len(tuned.logs)} logs"


def _values(tuned: Tuned) -> Iterator[str]:
    yield f"  {'key':44s}{'start':>12s}{'tuned':>12s}    without each fold"
    points = points_of(tuned.knobs, tuned.values)
    for i, (knob, values) in enumerate(zip(tuned.knobs, tuned.values, strict=True)):
        each = "  ".join(_shown(fold.values[i]) for fold in tuned.folds)
        mark = " " if BORDER < points[i] < 1.0 - BORDER else "*"
        yield f"  {knob.key:44s}{_shown(knob.start):>12s}{_shown(values):>12s}{mark}   {each}"
    if not all(BORDER < point < 1.0 - BORDER for point in points):
        yield "  * as far as it may go: by --factor, or by the theory"


def _errors(tuned: Tuned) -> Iterator[str]:
    yield f"  {tuned.plan.metric + ' RMSE':44s}{'start':>12s}{'tuned':>12s}"
    for fold in tuned.folds:
        yield _row(f"without {fold.held_back}", fold.training)
        yield _row("  held back", fold.error)
    yield _row("on all", tuned.training)
    yield _row("held back, together", tuned.held_back)


def _row(name: str, errors: Errors) -> str:
    return f"  {name:44.44s}{_degrees(errors.start):>12s}{_degrees(errors.tuned):>12s}"


def _verdict(tuned: Tuned) -> str:
    better, folds = tuned.nearer, len(tuned.folds)
    said = f"what was held back is nearer in {better} of {folds} folds"
    if tuned.worthwhile:
        return f"Tuning is worthwhile: {said}. These are the tuned values."
    if tuned.plan.generations <= SHORT:
        said += f", and {SHORT} generations tell little: raise --generations"
    else:
        said += ", and not by 1 % in all" if 2 * better > folds else ", which is not most of them"
    return f"Tuning is NOT worthwhile: {said}. The starting values are kept."


def _warnings(tuned: Tuned) -> Iterator[str]:
    if any(log.reference.kind == "autopilot" for log in tuned.logs):
        yield AUTOPILOT
    for i, knob in enumerate(tuned.knobs):
        found = sorted(fold.values[i] for fold in tuned.folds)
        if found[-1][0] > UNLIKE * found[0][0]:
            low, high = _shown(found[0]), _shown(found[-1])
            yield f"{knob.key} is {low} to {high} between the folds: the data do not tell it"
    for path, reason in tuned.failed.items():
        yield f"left out: {reason if path in reason else f'{path}: {reason}'}"
    for log in tuned.logs:
        yield from (f"{log.path.name}: {doubt}" for doubt in log.doubts)


def _change(errors: Errors) -> str:
    return f"{_degrees(errors.start)} -> {_degrees(errors.tuned)}"


def _degrees(error: float) -> str:
    return f"{error:.3f}°" if isfinite(error) else "no number"


def _shown(values: Values) -> str:
    return (
        f"{values[0]:.4g}"
        if len(set(values)) == 1
        else "[" + ",".join(f"{x:.3g}" for x in values) + "]"
    )


def _plain(values: Values) -> float | list[float]:
    return values[0] if len(values) == 1 else list(values)
