"""What an experiment gives, and how the observers are run on a simulated flight."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest import config, observers
from attest.claims import Claim
from attest.config import Configuration
from attest.estimates import Estimates
from attest.geometry import quaternion
from attest.samples import Samples
from attest.simulation.flight import Flight

Array = NDArray[np.float64]

XYZ = ("x", "y", "z")
REGRESSION = "no claim of the paper: what a right implementation gives"


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes of a figure, as the paper has them."""

    title: str
    y: str
    """Label of the upright axis, with its unit."""
    lines: Mapping[str, tuple[Array, Array]]
    """By name: times in seconds, and values."""
    x: str = "time [s]"
    log: bool = False
    bounds: tuple[float, float] | None = None
    """Of the upright axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One of the papers' experiments, run."""

    name: str
    title: str
    paper: str
    """Paper and section."""
    seeds: int
    """Over how many seeds it was run; 0 where nothing is random."""
    claims: tuple[Claim, ...]
    panels: Mapping[str, tuple[Panel, ...]]
    """By file name, without its ending: the panels of a figure, from top to bottom."""
    notes: tuple[str, ...]
    """What the paper leaves open and was chosen, in sentences."""


def samples(flight: Flight) -> Samples:
    """Return what the observers step over: gyroscope and vectors at the same stamps.

    Vectors keep the length that noise gave them, as in the papers.
    """
    names = tuple(name for name in flight.signals if name[0] == "v" and name[1:].isdigit())
    body = np.stack([flight.signals[name].y for name in names], axis=1)
    n = len(flight.t)
    gyro = flight.signals.get("gyro")
    torque = flight.signals.get("torque")
    return Samples(
        t=flight.t,
        gyro=np.full((n, 3), np.nan) if gyro is None else gyro.y,
        body=body,
        inertial=np.array([flight.constants[name] for name in names])[np.newaxis],
        valid=np.ones(body.shape[:2], np.bool_),
        names=names,
        substeps=np.ones(n, np.int64),
        restart=np.arange(n) == 0,
        torque=None if torque is None else torque.y,
    )


def configure(name: str, document: Mapping[str, Any]) -> Configuration:
    """Return a checked configuration of an observer."""
    plain = {"observer": name, **document}
    return config.validate(observers.get(name).config, plain, name)


def run(given: Samples, configuration: Configuration) -> Estimates:
    """Run an observer."""
    return observers.get(configuration.observer).estimate(given, configuration)


def energy(found: Estimates, configuration: Configuration, flight: Flight) -> Array:
    """Return the Lyapunov function of an observer that has one, shape (n,)."""
    lyapunov = observers.get(configuration.observer).lyapunov
    V = None if lyapunov is None else lyapunov(found, configuration, bias_error(found, flight))
    if V is None:
        raise ValueError(configuration.observer)
    return V


def bias_error(found: Estimates, flight: Flight) -> Array:
    """Return beta_hat - beta, rad/s, shape (n, 3)."""
    bias = np.zeros((len(found.t), 3)) if found.gyro_bias is None else found.gyro_bias
    off: Array = bias - np.array(flight.constants["gyro_bias"])
    return off


def start(flight: Flight, **other: Any) -> dict[str, Any]:
    """Return the observer's start that a scenario fixes."""
    constants = flight.constants
    found: dict[str, Any] = {"attitude": list(constants["initial_attitude"])}
    if "initial_bias" in constants:
        found["bias"] = list(constants["initial_bias"])
    if "initial_angular_velocity" in constants:
        found["angular_velocity"] = list(constants["initial_angular_velocity"])
    return found | other


def seconds(flight: Flight) -> Array:
    """Return the times of a flight, s."""
    return np.asarray((flight.t - flight.t[0]) * 1e-9, np.float64)


def attitude_error(q: Array, flight: Flight) -> Array:
    """Return the principal angle of R R_hat^T, degrees, shape (n,)."""
    apart = quaternion.multiply(quaternion.conjugate(q), flight.q)
    angle: Array = np.linalg.norm(quaternion.log(apart), axis=-1)
    return np.rad2deg(angle)


def components(t: Array, values: Array) -> dict[str, tuple[Array, Array]]:
    """Name the components of a series (n, 3)."""
    return {axis: (t, values[:, i]) for i, axis in enumerate(XYZ)}


def after(t: Array, error: Array, moment: float) -> float:
    """Return the worst error from a moment on."""
    return float(error[t >= moment - 1e-9].max())


def stays_below(t: Array, error: Array, bound: float) -> float | None:
    """Return from when on the error stays below a bound; None where it does not in the end."""
    above = np.flatnonzero(error >= bound)
    if len(above) == 0:
        return float(t[0])
    return None if above[-1] + 1 == len(t) else float(t[above[-1] + 1])


def at_most(statement: str, source: str, value: float, bound: float, unit: str) -> Claim:
    """Return a claim that a figure does not exceed a bound."""
    return Claim(
        statement=statement,
        source=source,
        seen=f"{value:.3g} {unit}".rstrip(),
        holds=value <= bound,
        value=value,
        bound=bound,
    )
