"""What goes on which topic of an MCAP.

The tree of frames is ``map`` (east-north-up, so that viewers show up as up), ``world`` (the world
axes of the recording), and in it the body by the observer and by the reference.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.estimates import Estimates
from attest.geometry import quaternion
from attest.geometry.frames import WORLD
from attest.metrics import Metrics
from attest.recording import Recording, World
from attest.result import Result
from attest.writers.cdr import Field, sequence, text, texts

Array = NDArray[np.float64]

WORLD_IN_MAP: Mapping[World, tuple[float, float, float, float]] = {
    "enu": (1.0, 0.0, 0.0, 0.0),
    "ned": (*WORLD.tolist(),),
}
"""The world axes as a quaternion (w, x, y, z) in ``map``."""

COVARIANCE = (9,)
"""Left at zero, which ``sensor_msgs`` reads as unknown."""
NOT_MEASURED = (-1.0, *[0.0] * 8)
"""The covariance by which ``sensor_msgs`` marks a quantity that is not there."""


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """The messages of one shape on one topic."""

    topic: str
    schema: str
    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, not decreasing, shape (n,)."""
    fields: tuple[Field, ...]
    """The message's layout, its constants in it; ``sec`` and ``nanosec`` are the stamp."""
    columns: Mapping[str, NDArray[np.generic]]
    """The values of the fields that change, each (n, …)."""


def streams(results: Sequence[Result]) -> list[Stream]:
    """Lay out every message of the runs over one log, topics without one left out.

    Reference and magnetometer are the same for all, and told once.
    """
    results = list(_apart(results))
    every = [stream for result in results for stream in _of_result(result)]
    scored = next((result for result in results if result.metrics), None)
    if scored is not None and scored.metrics is not None:
        every += _of_reference(scored.metrics, scored.estimates)
    every += _of_recording(results[0])
    filled = [stream for stream in every if len(stream.t)]
    return [*_static(filled, results), *filled]


def _apart(results: Sequence[Result]) -> Iterator[Result]:
    """Name the frames of the bodies so that each frame has one parent."""
    taken = {"map", *(frames(result.estimates)[0] for result in results)}
    for result in results:
        world, body = frames(result.estimates)
        if body in taken:
            body = f"{topic_name(result.estimates.observer)}/{body}"
        taken.add(body)
        yield replace(result, estimates=replace(result.estimates, frames=(world, body)))


def _of_result(result: Result) -> Iterator[Stream]:
    yield from _of_observer(result.estimates, result.recording, result.samples.names)
    if result.metrics is not None:
        yield _error(result.metrics, result.estimates)


def frames(estimates: Estimates) -> tuple[str, str]:
    """Return the names of the frames that an attitude leads to and from."""
    return estimates.frames or ("world", topic_name(estimates.observer))


def topic_name(name: str) -> str:
    """Spell a name so that ROS takes it in a topic or frame."""
    words = [word for part in name.split("/") if (word := re.sub(r"[^A-Za-z0-9]+", "_", part))]
    return "/".join(f"_{word}" if word[0].isdigit() else word for word in words) or "_"


def _of_observer(
    estimates: Estimates, recording: Recording, names: tuple[str, ...]
) -> Iterator[Stream]:
    world, body = frames(estimates)
    topic, t = f"/attest/{topic_name(estimates.observer)}", estimates.t
    yield _transform("/tf", t, world, body, estimates.q)
    yield _pose(f"{topic}/pose", t, world, estimates.q)
    yield _imu(f"{topic}/imu", body, estimates, recording)
    if estimates.gyro_bias is not None:
        yield _vector(f"{topic}/bias", t, body, estimates.gyro_bias)
    yield _vector(f"{topic}/euler", t, world, np.degrees(quaternion.to_euler(estimates.q)))
    yield _state(f"{topic}/state", body, estimates, names)
    if (torque := estimates.states.get("disturbance_torque")) is not None:
        yield _vector(f"{topic}/torque", t, body, torque)


def _of_reference(metrics: Metrics, estimates: Estimates) -> Iterator[Stream]:
    name, (world, _) = topic_name(metrics.reference), frames(estimates)
    held = np.isfinite(metrics.q_ref).all(axis=1)
    t, q = estimates.t[held], metrics.q_ref[held]
    yield _transform("/tf", t, world, f"reference/{name}", q)
    yield _pose(f"/attest/reference/{name}/pose", t, world, q)


def _error(metrics: Metrics, estimates: Estimates) -> Stream:
    scored = np.isfinite(metrics.error_deg).all(axis=1)
    return _stamped(
        f"/attest/{topic_name(estimates.observer)}/error",
        "attest_msgs/msg/AttitudeError",
        estimates.t[scored],
        frames(estimates)[0],
        {"error": metrics.error_deg[scored]},
    )


def _of_recording(result: Result) -> Iterator[Stream]:
    """Lay out the magnetometer at its own stamps, within the run."""
    t = result.estimates.t
    if (mag := result.recording.signals.get("mag")) is not None and len(t):
        within = slice(*np.searchsorted(mag.t, [t[0], t[-1] + 1]).tolist())
        yield _stamped(
            "/attest/mag",
            "sensor_msgs/msg/MagneticField",
            mag.t[within],
            frames(result.estimates)[1],
            {"magnetic_field": mag.y[within]},
            (Field("covariance", "<f8", COVARIANCE),),
        )


def _static(filled: list[Stream], results: Sequence[Result]) -> list[Stream]:
    """Tie each world's axes to a map whose third axis is up, once, at the first message."""
    if not filled:
        return []
    first = np.array([min(stream.t[0] for stream in filled)])
    q = np.array([WORLD_IN_MAP[results[0].recording.world]])
    worlds = dict.fromkeys(frames(result.estimates)[0] for result in results)
    return [_transform("/tf_static", first, "map", world, q) for world in worlds]


def _transform(topic: str, t: NDArray[np.int64], parent: str, child: str, q: Array) -> Stream:
    fields = (
        Field("transforms.count", "<u4", value=1),
        *_header(parent),
        *text("child_frame_id", child),
        Field("translation", "<f8", (3,)),
        Field("rotation", "<f8", (4,)),
    )
    columns = {"rotation": quaternion.to_xyzw(q)}
    return Stream(topic, "tf2_msgs/msg/TFMessage", t, fields, columns)


def _pose(topic: str, t: NDArray[np.int64], world: str, q: Array) -> Stream:
    fields = (
        *_header(world),
        Field("position", "<f8", (3,)),
        Field("orientation", "<f8", (4,)),
    )
    columns = {"orientation": quaternion.to_xyzw(q)}
    return Stream(topic, "geometry_msgs/msg/PoseStamped", t, fields, columns)


def _vector(topic: str, t: NDArray[np.int64], frame: str, vector: Array) -> Stream:
    return _stamped(topic, "geometry_msgs/msg/Vector3Stamped", t, frame, {"vector": vector})


def _imu(topic: str, body: str, estimates: Estimates, recording: Recording) -> Stream:
    accel = recording.signals.get("accel")
    fields = (
        *_header(body),
        Field("orientation", "<f8", (4,)),
        Field("orientation_covariance", "<f8", COVARIANCE),
        Field("angular_velocity", "<f8", (3,)),
        Field("angular_velocity_covariance", "<f8", COVARIANCE),
        Field("linear_acceleration", "<f8", (3,)),
        Field("linear_acceleration_covariance", "<f8", COVARIANCE, None if accel else NOT_MEASURED),
    )
    columns = {
        "orientation": quaternion.to_xyzw(estimates.q),
        "angular_velocity": estimates.angular_velocity,
    }
    if accel:
        columns["linear_acceleration"] = _interpolated(estimates.t, accel.t, accel.y)
    return Stream(topic, "sensor_msgs/msg/Imu", estimates.t, fields, columns)


def _state(topic: str, body: str, estimates: Estimates, names: tuple[str, ...]) -> Stream:
    states = list(_columns(estimates.states))
    fields = (
        *_header(body),
        *(Field(name, "<f8") for name in ("s_norm", "cost", "lyapunov")),
        *sequence("updated", "u1", estimates.updated.shape[1]),
        *texts("vectors", names),
        *texts("state_names", [name for name, _ in states]),
        *sequence("states", "<f8", len(states)),
    )
    unknown = np.full(len(estimates.t), np.nan)
    columns: dict[str, NDArray[np.generic]] = {
        "s_norm": estimates.s_norm,
        "cost": estimates.cost,
        "lyapunov": unknown if estimates.lyapunov is None else estimates.lyapunov,
    }
    if estimates.updated.shape[1]:
        columns["updated"] = estimates.updated
    if states:
        columns["states"] = np.stack([column for _, column in states], axis=1)
    return Stream(topic, "attest_msgs/msg/ObserverState", estimates.t, fields, columns)


def _stamped(
    topic: str,
    schema: str,
    t: NDArray[np.int64],
    frame: str,
    columns: Mapping[str, Array],
    after: tuple[Field, ...] = (),
) -> Stream:
    fields = [Field(name, "<f8", values.shape[1:]) for name, values in columns.items()]
    return Stream(topic, schema, t, (*_header(frame), *fields, *after), columns)


def _header(frame: str) -> tuple[Field, ...]:
    return (Field("sec", "<i4"), Field("nanosec", "<u4"), *text("frame_id", frame))


def _columns(states: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    """Take observer-specific states apart, one number each, with a name that says which."""
    for name, values in states.items():
        if values.ndim == 1:
            yield name, values
        else:
            yield from ((f"{name}[{i}]", values[:, i]) for i in range(values.shape[1]))


def _interpolated(at: NDArray[np.int64], t: NDArray[np.int64], y: Array) -> Array:
    """Interpolate each column; times are taken from the first, since float64 rounds nanoseconds."""
    if not len(t):
        return np.full((len(at), y.shape[1]), np.nan)
    return np.stack([np.interp(at - t[0], t - t[0], column) for column in y.T], axis=1)
