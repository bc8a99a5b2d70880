"""The whole log at once, past and future: the most likely attitude, and how sure it is.

[Barfoot24]  T. D. Barfoot, "State estimation for robotics", 2nd ed., 2024: maximum a posteriori
             estimation on matrix Lie groups, 3.1, 5.3, 8.2 and 9.1.
[Lange89]    K. L. Lange, R. J. A. Little, J. M. G. Taylor, "Robust statistical modeling using the
             t distribution", JASA 84(408).

It looks for attitude, velocity and gyroscope bias, every quarter of a second, that fit best:

- the turn between them that the gyroscope measures, with errors of scale and alignment that are the
  same over the log, and a bias that wanders and that rest shows;
- the velocity that the accelerometer adds up to: of a body that is not carried away it stays
  small, and it is zero at rest. So gravity is told from motion over seconds, and not at once.
  Where the log has velocity, it is the difference from that which stays small;
- the world's magnetic field, of an unknown strength and dip, with a hard iron of the body. The
  local field is off by what is the same for seconds, and at rest for as long as that lasts, and
  at times by far more: outliers count for less, and nothing is left out.

It is no filter for flight, since it needs the future.
"""

from dataclasses import replace
from math import radians, sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from attest.config import Configuration, Section, SmoothedConditioning, Weights
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.geometry import earth, mat3, quaternion, so3, wahba
from attest.geometry.jit import kernel
from attest.observers.observer import (
    COLUMNS,
    Observer,
    estimates,
    gain_matrices,
    initial_attitude,
    record,
)
from attest.recording import Note
from attest.samples import Samples, segments
from attest.smoothing import factors, inputs, smooth, spread, start, told
from attest.smoothing.factors import CONSTANTS
from attest.smoothing.path import Expected, Nodes, Path
from attest.smoothing.smooth import Found, Prior
from attest.smoothing.stretch import Log

Array = NDArray[np.float64]

REST_SPEED = 0.05
"""Of the velocity at rest, m/s."""
REST_RATE = 3e-4
"""What a rest tells of the bias, rad/s."""
DIRECTION_TIME = 1.0
"""How long the error of any other vector stays the same, s."""

IRON, FIELD, WEIGHT, LEAN = 9, 12, 14, 15
"""Where hard iron, field, scale of gravity and accelerometer's bias are among the constants."""
HALF = sqrt(factors.TAIL + 3.0)
"""Deviations at which a field counts half."""
LARGE = 0.1
"""Hard iron, as a share of the field, that must show: a body that hardly tilts cannot tell a large
one in a strong field from none."""
CLEARLY = 0.5
"""Share of the field's scatter without it that a large one may leave."""
FILTERS = 0.00125
"""Delay of an inertial unit's filters, s, as 16 hand-held trials against cameras have it."""
NIL = 1e-4
"""Deviation of a hard iron that is none."""


class Gains(Section):
    """What is expected of sensors and motion, as standard deviations."""

    theorem = "[Barfoot24]"

    gyro_noise: Annotated[float, Field(gt=0, le=10)] = 2e-4
    """Least of the gyroscope's noise, which the log tells [rad/√s]."""
    gyro_scale: Annotated[float, Field(gt=0, le=1)] = 0.01
    """Of the gyroscope's errors of scale and alignment, which are estimated."""
    gyro_rest: Annotated[float, Field(ge=0, le=1)] = 0.001
    """Of what is left of those, for each rad/s [√s]."""
    bias_deg_s: Annotated[float, Field(gt=0, le=1e3)] = 3.0
    """Of the gyroscope's bias at the start [deg/s]."""
    bias_walk: Annotated[float, Field(ge=0, le=10)] = 2e-4
    """Of the gyroscope's bias's random walk [rad/s/√s]."""
    accel_noise: Annotated[float, Field(gt=0, le=100)] = 0.05
    """Least of the accelerometer's noise, which the log tells [m/s/√s]."""
    accel_bias: Annotated[float, Field(gt=0, le=10)] = 0.03
    """Of the accelerometer's bias [m/s²]."""
    speed: Annotated[float, Field(gt=0, le=1e4)] = 3.0
    """Of the body's velocity, where the log has none [m/s]. More follows the accelerometer less."""
    aided_speed: Annotated[float, Field(gt=0, le=1e4)] = 1.0
    """Of the log's velocity [m/s]."""
    speed_time: Annotated[float, Field(gt=0, le=1e3)] = 0.5
    """How long a velocity stays the same [s]."""
    field: Annotated[float, Field(gt=0, le=10)] = 0.03
    """Of the local magnetic field, as a share of it. More follows the magnetometer less."""
    field_time: Annotated[float, Field(gt=0, le=1e4)] = 10.0
    """How long a moving body's local field stays the same [s]. More follows it less."""
    field_delay: Annotated[float, Field(ge=0, le=10)] = 0.03
    """Of the magnetometer's delay, which blurs the field as the body turns [s]."""
    hard_iron: Annotated[float, Field(gt=0, le=10)] = 0.015
    """Of the body's own field, as a share of the world's; far more is possible."""
    direction: Annotated[float, Field(gt=0, le=10)] = 0.03
    """Of any other vector [rad]."""
    delay_s: Annotated[float | None, Field(ge=0, le=0.1)] = None
    """How late an inertial unit's values are; null: 1.25 ms by its filters, and half a step, whose
    mean a sample is, where steps are not divided [s]."""
    node_s: Annotated[float, Field(ge=0.01, le=10)] = 0.25
    """How far apart attitudes are looked for; the gyroscope leads from one to the next [s]."""


class Config(Configuration):
    """Configuration of ``smoother``; one for all logs."""

    observer: str = "smoother"
    gains: Gains = Gains()
    weights: Weights = Weights(k=(1.2, 1.0, 30.0))
    conditioning: SmoothedConditioning = SmoothedConditioning()


def estimate(samples: Samples, config: Config) -> Estimates:
    """Estimate attitude and gyroscope bias from all that is measured before and after."""
    if not np.isfinite(samples.gyro).all():
        raise ConfigError("smoother: needs a gyroscope. Choose another observer for this log.")
    gains = config.gains
    nodes = inputs.nodes(samples, gains.node_s)
    log = inputs.log(samples, (gains.gyro_noise, gains.accel_noise))
    first, north = _start(samples, log, nodes, config), _north(samples)
    expected, prior = _noise(gains)
    found = smooth.smooth(log, nodes, first, north, expected, prior)
    if np.linalg.norm(found.path.c[IRON:FIELD]) > LARGE:
        bare = smooth.smooth(log, nodes, first, north, expected, replace(prior, iron=NIL))
        found = found if found.scatter < CLEARLY * bare.scatter else bare
    smoothed = np.empty((len(samples.t), spread.COLUMNS))
    spread.spread(log, nodes, found.path, found.P, smoothed)
    _lead(smoothed, _delay(samples) if gains.delay_s is None else gains.delay_s)
    out = np.empty((len(samples.t), COLUMNS))
    for part in segments(samples):
        L = gain_matrices(samples, part, config.weights)
        _diagnose(smoothed[part], L, out[part])
    return estimates(
        "smoother",
        samples,
        out,
        states=_states(samples, nodes, found, smoothed),
        constants=_constants(found, north, gains.field),
    )


def _north(samples: Samples) -> Array:
    """Return the known direction of the field in the world, (3,)."""
    if "mag" not in samples.names:
        return np.array([1.0, 0.0, 0.0])
    north: Array = samples.inertial[0, samples.names.index("mag")]
    return north


def _start(samples: Samples, log: Log, nodes: Nodes, config: Config) -> Path:
    """Return a first guess: attitudes of averaged vectors, the bias as rest has it."""
    N = len(nodes.at)
    resting = samples.rest is not None and samples.rest.any()
    b = samples.gyro[samples.rest].mean(axis=0) if resting else np.array(config.initial.bias)
    first = {
        part.start: initial_attitude(samples, part, config.initial) for part in segments(samples)
    }
    u = samples.body.copy()
    if "accel" in samples.names:  # swings even out of forces, and not of their directions
        u[:, samples.names.index("accel")] = log.force / earth.GRAVITY
    vectors = start.Vectors(log.h, u, np.ascontiguousarray(samples.inertial), samples.valid)
    c = np.zeros(CONSTANTS)
    c[FIELD], c[WEIGHT] = 1.0, 1.0
    return Path(
        q=start.attitudes(vectors, samples.gyro - b, nodes.at, first),
        v=np.zeros((N, 3)),
        b=np.tile(b, (N, 1)),
        c=c,
    )


def _noise(gains: Gains) -> tuple[Expected, Prior]:
    """Return what is expected of the sensors, and what is known before."""
    expected = Expected(
        scale=gains.gyro_rest,
        bias_walk=gains.bias_walk,
        rest_rate=REST_RATE,
        rest_speed=REST_SPEED,
        speed=gains.speed,
        aided_speed=gains.aided_speed,
        speed_time=gains.speed_time,
        field=gains.field,
        field_time=gains.field_time,
        field_delay=gains.field_delay,
        direction=gains.direction,
        direction_time=DIRECTION_TIME,
        tails=False,
    )
    prior = Prior(
        bias=radians(gains.bias_deg_s),
        scale=gains.gyro_scale,
        iron=gains.hard_iron,
        field=0.3,
        gravity=0.01,
        lean=gains.accel_bias,
    )
    return expected, prior


def _delay(samples: Samples) -> float:
    """Return how late the inertial unit's values are, s."""
    h = np.diff(samples.t)[samples.substeps[:-1] == 1]
    return FILTERS + (0.5e-9 * float(np.median(h)) if 2 * len(h) > len(samples.t) else 0.0)


def _lead(smoothed: Array, delay: float) -> None:
    """Turn the attitudes on to the time of their stamps, which is later than what was measured."""
    turn = quaternion.exp(delay * smoothed[:, 4:7])
    smoothed[:, 0:4] = quaternion.multiply(smoothed[:, 0:4], turn)


def _states(samples: Samples, nodes: Nodes, found: Found, smoothed: Array) -> dict[str, Array]:
    """Return the covariance of the attitude and what the field counted for."""
    P = smoothed[:, [10, 11, 12, 11, 13, 14, 12, 14, 15]].reshape(-1, 3, 3)
    R = quaternion.to_matrix(smoothed[:, 0:4])
    in_body = np.einsum("nji,njk,nki->ni", R, P, R)
    states = {
        "attitude_std": np.sqrt(np.maximum(in_body, 0.0)),
        "attitude_covariance": smoothed[:, 10:16].copy(),
    }
    if "mag" in samples.names:
        before = np.searchsorted(nodes.at, np.arange(len(samples.t)), side="right") - 1
        states["field_weight"] = found.counts[before]
    return states


def _constants(found: Found, north: Array, expected: float) -> dict[str, Array]:
    """Return what is the same throughout: errors of the sensors, and the field, in units of it."""
    c, off = found.path.c, found.off[np.isfinite(found.off)]
    return {
        "gyro_scale": c[:IRON].reshape(3, 3),
        "hard_iron": c[IRON:FIELD],
        "field": c[FIELD] * north + np.array([0.0, 0.0, c[FIELD + 1]]),
        "gravity_scale": c[WEIGHT],
        "accel_bias": c[LEAN:],
        "field_unlike": np.mean(off > HALF * expected, keepdims=True) if len(off) else off,
    }


def notes(samples: Samples, found: Estimates, config: Config) -> tuple[Note, ...]:
    """Say what was found and taken off, and where the answer is doubtful."""
    did = told.told(samples, found, config.gains.bias_deg_s)
    return (*did, *told.doubts(samples, found))


@kernel
def _diagnose(smoothed: Array, L: Array, out: Array) -> None:
    """Fill out (n, 12) with what every observer gives."""
    for i in range(len(smoothed)):
        q = so3.row4(smoothed, i)
        rate = (smoothed[i, 4], smoothed[i, 5], smoothed[i, 6])
        beta = (smoothed[i, 7], smoothed[i, 8], smoothed[i, 9])
        B = mat3.matmul(mat3.transpose(so3.matrix(q)), mat3.matrix_row(L, i))
        s = wahba.residual(B)
        record(out, i, q, rate, beta, sqrt(so3.dot(s, s)), wahba.cost(L[i, 9], B))


OBSERVER = Observer(
    title="Smoother over the whole log, past and future",
    paper="after Barfoot 2024 and Lange, Little, Taylor 1989",
    config=Config,
    estimate=estimate,
    notes=notes,
    whole=True,
)
