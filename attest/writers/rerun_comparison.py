"""The time series of several observers over one log: a curve for each, in its own colour."""

from collections.abc import Callable, Iterator, Sequence
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from attest.result import Result
from attest.writers.rerun_plots import Plot, Series, euler_deg, field, restarts
from attest.writers.rerun_scene import ESTIMATES, REFERENCE, Color
from attest.writers.topics import topic_name

Array = NDArray[np.float64]

ANGLES = ("roll", "pitch", "yaw")
ERRORS = ("total", "heading", "inclination")


def plots_of_several(results: Sequence[Result]) -> list[Plot]:
    """Lay out every plot, most telling first: errors, angles, bias and residual."""
    return [*_errors(results), *_angles(results), *_norms(results), *field(results[0])]


def _coloured(results: Sequence[Result]) -> Iterator[tuple[Result, Color]]:
    return zip(results, cycle(ESTIMATES), strict=False)


def _curve(
    plot: str, result: Result, values: Callable[[], Array], color: Color, width: float = 1.5
) -> Series:
    name = result.estimates.observer
    entity = f"{plot}/{topic_name(name)}"
    t, broken = result.estimates.t, restarts(result)
    return Series(entity, t, broken, values, (name,), (color,), width)


def _errors(results: Sequence[Result]) -> Iterator[Plot]:
    scored = [(result, color) for result, color in _coloured(results) if result.metrics]
    for i, name in enumerate(ERRORS if scored else ()):
        curves = [
            _curve(f"error/{name}", result, _column(result, i), color) for result, color in scored
        ]
        yield Plot(_title(name, scored[0][0]), f"error/{name}", tuple(curves))


def _title(error: str, scored: Result) -> str:
    """Say against what the total error is; the others stand below it."""
    name = scored.metrics.reference if scored.metrics and error == "total" else ""
    return f"{error.capitalize()} error{f' against {name}' if name else ''} [deg]"


def _column(result: Result, i: int) -> Callable[[], Array]:
    errors = None if result.metrics is None else result.metrics.error_deg
    return lambda: np.empty((0, 1)) if errors is None else errors[:, i : i + 1]


def _angles(results: Sequence[Result]) -> Iterator[Plot]:
    against = next((result for result in results if result.metrics), None)
    for i, name in enumerate(ANGLES):
        curves = [
            _curve(f"euler/{name}", result, _angle(result.estimates.q, i), color)
            for result, color in _coloured(results)
        ]
        if against is not None and against.metrics is not None:
            values = _angle(against.metrics.q_ref, i)
            t, broken = against.estimates.t, restarts(against)
            # drawn in the order of their names: the broad band below all
            label = (against.metrics.reference,)
            entity = f"euler/{name}/0_reference"
            curves.insert(0, Series(entity, t, broken, values, label, (REFERENCE,), 4.0))
        yield Plot(f"{name.capitalize()} [deg]", f"euler/{name}", tuple(curves))


def _angle(q: Array, i: int) -> Callable[[], Array]:
    return lambda: euler_deg(q)[:, i : i + 1]


def _norms(results: Sequence[Result]) -> Iterator[Plot]:
    having = [(r, c, r.estimates.gyro_bias) for r, c in _coloured(results)]
    biases = [
        _curve("bias", result, _length(bias), color)
        for result, color, bias in having
        if bias is not None
    ]
    if biases:
        yield Plot("|Gyro bias| [deg/s]", "bias", tuple(biases))
    residuals = [
        _curve("residual", result, _alone(result.estimates.cost), color)
        for result, color in _coloured(results)
    ]
    yield Plot("Wahba's cost U", "residual", tuple(residuals))


def _length(bias: Array) -> Callable[[], Array]:
    return lambda: np.degrees(np.linalg.norm(bias, axis=1, keepdims=True))


def _alone(values: Array) -> Callable[[], Array]:
    return lambda: values[:, np.newaxis]
