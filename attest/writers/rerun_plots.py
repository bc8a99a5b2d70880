"""The time series: what is drawn over time, in which plot, with which names, units and colours."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.result import Result
from attest.writers.rerun_scene import PALE, VIVID, Color
from attest.writers.rerun_target import Columns, Target

Array = NDArray[np.float64]

TOTAL: Color = (245, 158, 11)
HEADING: Color = (59, 130, 246)
INCLINATION: Color = (34, 197, 94)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Some curves over one clock; NaN breaks them."""

    entity: str
    t: NDArray[np.int64]
    restarts: NDArray[np.int64]
    """Times just before which they break."""
    values: Callable[[], Array]
    """Makes them when they are logged, shape (n, k)."""
    names: Sequence[str]
    colors: Sequence[Color]
    width: float = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """One plot and its unit, in its title."""

    title: str
    origin: str
    series: tuple[Series, ...]

    def log(self, target: Target) -> None:
        """Log the curves and their style."""
        for one in self.series:
            style = rr.SeriesLines(colors=one.colors, names=one.names, widths=[one.width])
            target.static(one.entity, style)
            t, y = _broken(one.t, one.values(), one.restarts)
            target.rows(one.entity, t, _columns(y))


def plots(result: Result) -> list[Plot]:
    """Lay out every plot that the run has data for, most telling first."""
    return [plot for make in PLOTS for plot in make(result)]


def _error(result: Result) -> Iterator[Plot]:
    if (metrics := result.metrics) is None:
        return
    names, colors = ("total", "heading", "inclination"), (TOTAL, HEADING, INCLINATION)
    t, broken = result.estimates.t, restarts(result)
    series = Series("error", t, broken, lambda: metrics.error_deg, names, colors, 2.0)
    yield Plot(f"Error against {metrics.reference} [deg]", "error", (series,))


def _euler(result: Result) -> Iterator[Plot]:
    t, q, metrics = result.estimates.t, result.estimates.q, result.metrics
    names, broken = ("roll", "pitch", "yaw"), restarts(result)
    curves = [Series("euler/estimate", t, broken, lambda: euler_deg(q), names, VIVID)]
    if metrics is not None:
        # drawn in the order of their names: a broad band below, so that both are seen
        named = [f"{name}, reference" for name in names]
        q_ref = metrics.q_ref
        against = Series("euler/against", t, broken, lambda: euler_deg(q_ref), named, PALE, 4.0)
        curves.append(against)
    yield Plot("Euler angles [deg]", "euler", tuple(curves))


def _bias(result: Result) -> Iterator[Plot]:
    if (bias := result.estimates.gyro_bias) is not None:
        yield _xyz("Gyro bias [deg/s]", "bias", result, lambda: np.degrees(bias))


def _rate(result: Result) -> Iterator[Plot]:
    estimates = result.estimates
    yield _xyz(
        "Angular rate [deg/s]", "rate", result, lambda: np.degrees(estimates.angular_velocity)
    )


def _residual(result: Result) -> Iterator[Plot]:
    estimates = result.estimates
    curve = Series(
        "residual",
        estimates.t,
        restarts(result),
        lambda: np.stack([estimates.s_norm, estimates.cost], axis=1),
        ("|s_L|", "Wahba's cost U"),
        (TOTAL, HEADING),
    )
    yield Plot("Residuals", "residual", (curve,))


def field(result: Result) -> Iterator[Plot]:
    """Draw the strength of the field that the magnetometer saw."""
    mag = result.recording.signals.get("mag")
    if mag is None or result.recording.tells("field strength"):
        return
    y = mag.y
    series = Series(
        "field",
        mag.t,
        restarts(result),
        lambda: 1e6 * np.linalg.norm(y, axis=1, keepdims=True),
        ("|mag|",),
        ((34, 211, 238),),
    )
    yield Plot("Field strength [µT]", "field", (series,))


def _torque(result: Result) -> Iterator[Plot]:
    if (torque := result.estimates.states.get("disturbance_torque")) is not None:
        yield _xyz("Disturbance torque [N·m]", "torque", result, lambda: torque)


PLOTS = (_error, _euler, _bias, _rate, _residual, field, _torque)


def restarts(result: Result) -> NDArray[np.int64]:
    """Return the times at which a run starts anew."""
    return result.samples.t[result.samples.restart]


def _xyz(title: str, entity: str, result: Result, values: Callable[[], Array]) -> Plot:
    t, names = result.estimates.t, ("x", "y", "z")
    return Plot(title, entity, (Series(entity, t, restarts(result), values, names, VIVID),))


def euler_deg(q: Array) -> Array:
    """Give roll, pitch and yaw in degrees, broken where an angle jumps by a turn."""
    angles = np.degrees(quaternion.to_euler(q))
    with np.errstate(invalid="ignore"):
        jumps = np.abs(np.diff(angles, axis=0, prepend=angles[:1])) > 180.0
    angles[jumps] = np.nan
    return angles


def _broken(
    t: NDArray[np.int64], y: Array, restarts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], Array]:
    """Put NaN just before each restart, so that no curve is drawn across a gap."""
    at = np.searchsorted(t, restarts)
    at = at[(at > 0) & (at < len(t))]
    return np.insert(t, at, t[at] - 1), np.insert(y, at, np.nan, axis=0)


def _columns(y: Array) -> Columns:
    return lambda part: rr.Scalars.columns(scalars=y[part])
