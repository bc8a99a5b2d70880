"""The 3D view: world axes, the vehicle by estimate and by reference, measured vectors.

Measured vectors are logged in the body, so that the estimate turns them into the world: where they
lie on the predicted ones, the estimate explains the measurement.
"""

from collections.abc import Callable, Sequence
from itertools import cycle

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from attest.geometry import quaternion
from attest.recording import World
from attest.result import Result
from attest.samples import Samples
from attest.writers.rerun_target import Columns, Target, recent
from attest.writers.topics import topic_name

Array = NDArray[np.float64]
Color = tuple[int, int, int]

UP = {"ned": rr.ViewCoordinates.FRD, "enu": rr.ViewCoordinates.RFU}
"""What the world axes are to a viewer that looks north."""
AXIS_NAMES = {"ned": ("N", "E", "D"), "enu": ("E", "N", "U")}

VIVID: tuple[Color, ...] = ((239, 68, 68), (34, 197, 94), (59, 130, 246))
PALE: tuple[Color, ...] = ((250, 190, 190), (190, 235, 200), (190, 210, 250))
GREY: Color = (150, 155, 165)
ESTIMATES: tuple[Color, ...] = (
    (245, 158, 11),
    (59, 130, 246),
    (34, 197, 94),
    (217, 70, 239),
    (239, 68, 68),
    (20, 184, 166),
    (132, 204, 22),
    (148, 163, 184),
)
"""One per observer, the best first."""
COLOR_NAMES = ("amber", "blue", "green", "violet", "red", "teal", "lime", "grey")
REFERENCE: Color = (203, 213, 225)
VECTORS: tuple[Color, ...] = ((236, 72, 153), (34, 211, 238), (163, 230, 53), (192, 132, 252))
"""One per measured direction, none of them an axis's."""

AIRFRAME = np.array(
    [
        [[-0.05, 0.0, 0.0], [0.42, 0.05, 0.05]],  # fuselage: centre, half the size
        [[0.42, 0.0, 0.0], [0.08, 0.03, 0.03]],  # nose
        [[0.05, 0.0, -0.03], [0.09, 0.55, 0.012]],  # wing
        [[-0.42, 0.0, -0.02], [0.06, 0.2, 0.01]],  # tailplane
        [[-0.42, 0.0, -0.13], [0.06, 0.01, 0.11]],  # fin
    ]
)
"""A vehicle whose nose, wing and fin tell its attitude, forward-right-down."""

CORNER = (0.3, -1.3, 0.4)
"""Where the world axes stand, clear of the vehicle, north-east-down."""

HELD = 1_000_000_000
"""For how long a measured vector is shown after its last sample, nanoseconds."""


def log_scene(target: Target, results: Sequence[Result]) -> None:
    """Log everything that the 3D view shows; the vectors as the first of the observers has them."""
    first = results[0]
    target.static("world", UP[first.recording.world])
    _log_world_axes(target, first)
    _log_estimate(target, first)
    for result, color in zip(results[1:], cycle(ESTIMATES[1:]), strict=False):
        _log_other(target, result, color)
    scored = next((result for result in results if result.metrics), first)
    _log_reference(target, scored)
    for i in range(len(first.samples.names)):
        _log_measured(target, first, i)
        _log_predicted(target, first.samples, i)


def in_world(ned: tuple[float, float, float], world: World) -> tuple[float, float, float]:
    """Spell a place, given north-east-down, in the world axes."""
    north, east, down = ned
    return ned if world == "ned" else (east, north, -down)


def _log_world_axes(target: Target, result: Result) -> None:
    world = result.recording.world
    axes = rr.Arrows3D(
        vectors=0.35 * np.eye(3),
        origins=[in_world(CORNER, world)] * 3,
        radii=0.012,
        colors=[GREY] * 3,
        labels=("x", "y", "z") if result.estimates.frames else AXIS_NAMES[world],
        show_labels=True,
    )
    target.static("world/axes", axes)


def _log_other(target: Target, result: Result, color: Color) -> None:
    """Show another observer's estimate as an outline with axes, all in its colour."""
    entity = _vehicle(result)
    _log_rotation(target, entity, result.estimates.t, result.estimates.q)
    axes = rr.Arrows3D(vectors=0.9 * np.eye(3), radii=0.006, colors=[color] * 3)
    target.static(f"{entity}/axes", axes)
    centers, half_sizes = _airframe(result)
    boxes = rr.Boxes3D(centers=centers, half_sizes=half_sizes, colors=[color], radii=0.004)
    target.static(f"{entity}/airframe", boxes)


def _log_estimate(target: Target, result: Result) -> None:
    estimates = result.estimates
    entity = _vehicle(result)
    _log_rotation(target, entity, estimates.t, estimates.q)
    axes = rr.Arrows3D(
        vectors=np.eye(3), radii=0.016, colors=VIVID, labels=("x", "y", "z"), show_labels=True
    )
    target.static(f"{entity}/axes", axes)
    centers, half_sizes = _airframe(result)
    solid = rr.components.FillMode.Solid
    target.static(
        f"{entity}/airframe",
        rr.Boxes3D(centers=centers, half_sizes=half_sizes, colors=[ESTIMATES[0]], fill_mode=solid),
    )


def _log_reference(target: Target, result: Result) -> None:
    """Show the reference while there is one: its shape comes and goes with it."""
    if result.metrics is None:
        return
    entity = f"world/reference/{topic_name(result.metrics.reference)}"
    t, q = result.estimates.t, result.metrics.q_ref
    held = np.isfinite(q[:, 0])
    _log_rotation(target, entity, t[held], q[held])
    centers, half_sizes = _airframe(result)
    style = rr.Boxes3D.from_fields(centers=centers, colors=REFERENCE, radii=0.006)
    target.static(f"{entity}/airframe", style)
    target.static(f"{entity}/axes", rr.Arrows3D.from_fields(radii=0.01, colors=PALE))
    switches = np.flatnonzero(np.diff(held, prepend=~held[:1]))
    t, shown = t[switches], held[switches]
    target.rows(f"{entity}/airframe", t, _shown(_boxes, half_sizes, shown))
    target.rows(f"{entity}/axes", t, _shown(_arrows, 1.15 * np.eye(3), shown))


def _shown(
    make: Callable[[Array], rr.ComponentColumnList], values: Array, shown: NDArray[np.bool_]
) -> Columns:
    """Make rows of the same shape where it is shown, and of nothing where it is not."""

    def columns(part: slice) -> rr.ComponentColumnList:
        every: Array = np.tile(values, (int(shown[part].sum()), 1))
        return make(every).partition(len(values) * shown[part].astype(np.int64))

    return columns


def _log_measured(target: Target, result: Result, i: int) -> None:
    """Show a measured direction in the body, and nothing once it has not been measured for long."""
    samples = result.samples
    name, valid = samples.names[i], samples.valid[:, i]
    told = valid | ~recent(samples.t, valid, HELD)
    entity = f"{_vehicle(result)}/measured/{topic_name(name)}"
    color = VECTORS[i % len(VECTORS)]
    target.static(entity, rr.Arrows3D.from_fields(radii=0.015, colors=color, labels=name))
    t, shown, vectors = samples.t[told], valid[told], 0.75 * samples.body[told, i]
    target.rows(
        entity,
        t,
        lambda part: _arrows(vectors[part][shown[part]]).partition(shown[part].astype(np.int64)),
    )


def _log_predicted(target: Target, samples: Samples, i: int) -> None:
    """Show a known direction in the world, longer, thinner and paler than the measured one."""
    entity = f"world/predicted/{topic_name(samples.names[i])}"
    color = _paler(VECTORS[i % len(VECTORS)])
    target.static(entity, rr.Arrows3D.from_fields(radii=0.007, colors=color))
    vectors = 1.1 * samples.inertial[:, i]
    if len(vectors) == 1:
        target.static(entity, rr.Arrows3D.from_fields(vectors=vectors))
    else:
        target.rows(entity, samples.t, lambda part: _arrows(vectors[part]))


def _vehicle(result: Result) -> str:
    return f"world/estimate/{topic_name(result.estimates.observer)}"


def _log_rotation(target: Target, entity: str, t: NDArray[np.int64], q: Array) -> None:
    xyzw = quaternion.to_xyzw(q).astype(np.float32)
    target.rows(entity, t, lambda part: rr.Transform3D.columns(quaternion=xyzw[part]))


def _arrows(vectors: Array) -> rr.ComponentColumnList:
    return rr.Arrows3D.columns(vectors=vectors)


def _boxes(half_sizes: Array) -> rr.ComponentColumnList:
    return rr.Boxes3D.columns(half_sizes=half_sizes)


def _airframe(result: Result) -> tuple[Array, Array]:
    """Give the centres and half sizes of the vehicle's parts in the body axes."""
    flip = 1.0 if result.recording.body == "frd" else np.array([1.0, -1.0, -1.0])
    return AIRFRAME[:, 0] * flip, AIRFRAME[:, 1]


def _paler(color: Color) -> Color:
    red, green, blue = (int(0.55 * part + 0.45 * 255) for part in color)
    return red, green, blue
