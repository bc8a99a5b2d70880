"""The time series: what is drawn over time, in which plot, with which names, units and colours."""

from collections.abc import Iterator, Sequence
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
    y: Array
    """Shape (n, k)."""
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
            target.rows(one.entity, one.t, _columns(one.y))


def plots(result: Result) -> list[Plot]:
    """Lay out every plot that the run has data for, most telling first."""
    return [plot for make in PLOTS for plot in make(result)]


def _columns(y: Array) -> Columns:
    return lambda part: rr.Scalars.columns(scalars=y[part])


def _error(result: Result) -> Iterator[Plot]:
    if result.metrics is None:
        return
    names, colors = ("total", "heading", "inclination"), (TOTAL, HEADING, INCLINATION)
    t, error = _broken(result, result.metrics.error_deg)
    series = Series("error", t, error, names, colors, 2.0)
    yield Plot(f"Error against {result.metrics.reference} [deg]", "error", (series,))


def _euler(result: Result) -> Iterator[Plot]:
    names = ("roll", "pitch", "yaw")
    t, estimated = _broken(result, _euler_deg(result.estimates.q))
    curves = [Series("euler/estimate", t, estimated, names, VIVID)]
    if result.metrics:
        t, reference = _broken(result, _euler_deg(result.metrics.q_ref))
        named = [f"{name}, reference" for name in names]
        # drawn in the order of their names: a broad band below, so that both are seen
        curves.append(Series("euler/against", t, reference, named, PALE, 4.0))
    yield Plot("Euler angles [deg]", "euler", tuple(curves))


def _bias(result: Result) -> Iterator[Plot]:
    t, bias = _broken(result, np.degrees(result.estimates.gyro_bias))
    yield Plot("Gyro bias [deg/s]", "bias", (Series("bias", t, bias, ("x", "y", "z"), VIVID),))


def _rate(result: Result) -> Iterator[Plot]:
    t, rate = _broken(result, np.degrees(result.estimates.angular_velocity))
    yield Plot("Angular rate [deg/s]", "rate", (Series("rate", t, rate, ("x", "y", "z"), VIVID),))


def _residual(result: Result) -> Iterator[Plot]:
    values = np.stack([result.estimates.s_norm, result.estimates.cost], axis=1)
    t, values = _broken(result, values)
    names = ("|s_L|", "Wahba's cost U")
    curve = Series("residual", t, values, names, (TOTAL, HEADING))
    yield Plot("Residuals", "residual", (curve,))


def _field(result: Result) -> Iterator[Plot]:
    if (mag := result.recording.signals.get("mag")) is None:
        return
    strength = 1e6 * np.linalg.norm(mag.y, axis=1, keepdims=True)
    series = Series("field", mag.t, strength, ("|mag|",), ((34, 211, 238),))
    yield Plot("Field strength [µT]", "field", (series,))


def _torque(result: Result) -> Iterator[Plot]:
    if (torque := result.estimates.states.get("disturbance_torque")) is None:
        return
    t, torque = _broken(result, torque)
    series = Series("torque", t, torque, ("x", "y", "z"), VIVID)
    yield Plot("Disturbance torque [N·m]", "torque", (series,))


PLOTS = (_error, _euler, _bias, _rate, _residual, _field, _torque)


def _euler_deg(q: Array) -> Array:
    """Give roll, pitch and yaw in degrees, broken where an angle jumps by a turn."""
    angles = np.degrees(quaternion.to_euler(q))
    with np.errstate(invalid="ignore"):
        jumps = np.abs(np.diff(angles, axis=0, prepend=angles[:1])) > 180.0
    angles[jumps] = np.nan
    return angles


def _broken(result: Result, y: Array) -> tuple[NDArray[np.int64], Array]:
    """Put NaN just before each restart, so that no curve is drawn across a gap."""
    t, restarts = result.estimates.t, result.samples.t[result.samples.restart]
    at = np.searchsorted(t, restarts)
    at = at[(at > 0) & (at < len(t))]
    return np.insert(t, at, t[at] - 1), np.insert(y, at, np.nan, axis=0)
