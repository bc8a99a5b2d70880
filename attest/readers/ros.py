"""ROS logs: ROS 1 bags, ROS 2 folders, and their storage files on their own (SQLite, MCAP)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from attest.errors import ReadError
from attest.geometry import frames, quaternion
from attest.readers import gps, ros_axes, ros_choose, ros_clock, ros_decoded, ros_files
from attest.readers.options import ReadOptions
from attest.readers.ros_axes import Fixed
from attest.readers.ros_clock import Lag
from attest.readers.ros_decode import Array, Ints
from attest.readers.ros_decoded import Decoded
from attest.readers.ros_offers import Offer
from attest.readers.ros_units import in_tesla
from attest.recording import Clock, Note, Recording, Reference, Signal, World

UNIX = 10**18
"""Nanoseconds, the year 2001: later stamps are unix time."""
UNIT_TOLERANCE = 1e-3
_UP = 5.0
"""Specific force along z, m/s², by which an axis is told to point up."""
_IN_BODY = ("accel", "mag", "torque")


def recognises(head: bytes, path: Path) -> bool:
    """Whether it is a ROS 2 folder, or begins as a bag, an MCAP or a database of messages."""
    return ros_files.recognises(head, path)


@np.errstate(over="ignore", invalid="ignore")  # of numbers that damage made, and that are dropped
def read(path: Path, options: ReadOptions) -> Recording:
    """Read the topics that give the signals.

    Raises
    ------
    ReadError
        There are neither gyroscope nor feature points, or not what the options ask for.
    """
    decoded = Decoded()
    form, crate = ros_files.read(path, decoded.settle)
    notes = [Note(text, count, doubt=True) for text, count in crate.damage.items()]
    counts = {(topic.name, topic.type): topic.seen for topic in crate.topics.values()}
    notes += [*ros_decoded.skipped(crate.topics.values()), *decoded.told()]
    offers = ros_choose.usable(decoded.offers(), notes)
    topics = dict(options.topics or {})
    if options.imu is not None:
        topics = {"gyro": options.imu} | topics  # whose accelerometer is taken too
    chosen = ros_choose.choose(path, offers, topics, notes)
    main = chosen.get("gyro") or next(_others(offers, alone=options.references_alone), None)
    if main is None:
        raise ReadError(f"{path}: {_nothing(counts)}")
    world = _world(offers, main, options, notes)
    log = _Log(path, offers, chosen, topics, dict(options.units or {}), main, world, notes,
               ros_clock.lag(main))  # fmt: skip
    signals, references = _signals(log), _references(log)
    stamps = [signal.t for signal in signals.values()] + [r.t for r in references.values()]
    if not stamps:
        raise ReadError(f"{path}: no reference in it can be used. Record the log again.")
    return Recording(
        path=path,
        format=form,
        signals=signals,
        references=references,
        clock=_clock(int(stamps[0][0]), log.lag),
        world=log.world,
        body="frd" if log.world == "ned" else "flu",
        notes=tuple(dict.fromkeys(notes)),
        details={"topics": _topics(counts, signals, references)},
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """What the parts of a reading share."""

    path: Path
    offers: Sequence[Offer]
    chosen: Mapping[str, Offer]
    topics: Mapping[str, str]
    """That the user names, by role."""
    units: Mapping[str, str]
    """That the user tells, by role."""
    main: Offer
    """Its clock and frame are the log's: the gyroscope, else a feature point, else a reference."""
    world: World
    notes: list[Note]
    lag: Lag | None
    """How far the recorder's clock is ahead of the main topic's."""


def _others(offers: Sequence[Offer], *, alone: bool) -> Iterator[Offer]:
    """Yield what a log without a gyroscope may be of."""
    yield from (offer for offer in offers if offer.role == "point")
    if alone:
        yield from filter(ros_choose.is_attitude, (o for o in offers if o.role == "reference"))


def _world(offers: Sequence[Offer], main: Offer, options: ReadOptions, notes: list[Note]) -> World:
    """Axes as declared; else PX4's, those of attest's own results, or REP-103's."""
    if options.world is not None:
        return options.world
    if main.axes == "px4":
        return "ned"
    own = ros_axes.fixed(offers).get(("map", "world"))
    if own is not None and ros_choose.OWN in main.topic:
        if abs(float(own @ frames.WORLD)) > 0.999:
            notes.append(Note("world north-east-down, as attest's own results say"))
            return "ned"
        return "enu"
    accel = [offer.y for offer in offers if offer.role == "accel" and offer.topic == main.topic]
    if accel and _is_mounted_so(np.nanmedian(accel[0], axis=0), main, ros_axes.fixed(offers)):
        text = "accel_z is down: the sensor is upside down, as the log's static transforms say"
        notes.append(Note(text, about="up"))
    return "enu"


def _is_mounted_so(accel: Array, main: Offer, known: Fixed) -> bool:
    """Whether gravity is the wrong way in the sensor's frame, and the right way in another one."""
    frames = {frame for pair in known for frame in pair}
    turns = (ros_axes.between(known, frame, main.frame) for frame in frames)
    upright = any(quaternion.rotate(q, accel)[2] > _UP for q in turns if q is not None)
    return bool(accel[2] < -_UP) and upright


def _signals(log: _Log) -> dict[str, Signal]:
    found: dict[str, Signal] = {}
    known = ros_axes.fixed(log.offers)
    for role, offer in [*log.chosen.items(), *_points(log)]:
        open_unit = role == "mag" and offer.axes != "px4" and role not in log.units
        right = in_tesla(offer, log.notes) if open_unit else offer
        if role in _IN_BODY:
            right = ros_axes.into_body(right, log.main.frame, known, log.notes)
        if (signal := _signal(log, _turned(log, right))) is not None:
            found[role] = signal
    if "velocity" in found and not log.chosen["velocity"].type.endswith("/Odometry"):
        velocity = gps.vetted(found.pop("velocity"), list(_receivers(log)), log.notes)
        found |= {} if velocity is None else {"velocity": velocity}
    if log.main.role == "gyro" and "gyro" not in found:
        raise ReadError(f"{log.path}: no gyroscope sample in {log.main.topic} can be used. "
                        "Choose another: --set input.topics.gyro=TOPIC.")  # fmt: skip
    if log.main.role == "point" and not found:
        raise ReadError(f"{log.path}: no feature point can be used. Record the log again.")
    return found


def _receivers(log: _Log) -> Iterator[gps.Receiver]:
    """Yield what receivers say of their fix; an odometry has its own word, and other sensors."""
    for offer in log.offers:
        if offer.role == "fix":
            t, rows = ros_clock.times(offer, log.lag, [])  # told of its position
            yield gps.Receiver(offer.topic, t, offer.y[rows, 0] > 0.0, np.zeros(len(t)))


def _turned(log: _Log, offer: Offer) -> Offer:
    """Turn values from the axes of their source to the log's; points stay in their sensor's."""
    if offer.role == "point":
        return offer
    foreign = log.main.axes == "px4" and offer.axes != "px4"
    own: World = "ned" if offer.axes == "px4" else "enu" if foreign else log.world
    return ros_axes.axes(offer, own, log.world)


def _signal(log: _Log, offer: Offer) -> Signal | None:
    t, rows = ros_clock.times(offer, log.lag, log.notes)
    y = np.ascontiguousarray(offer.y[rows])
    good = ros_clock.finite(offer, y, log.notes)
    if not good.all():
        t, y = t[good], y[good]
    return Signal(t, y, offer.topic) if len(t) else None


def _points(log: _Log) -> Iterator[tuple[str, Offer]]:
    """Yield the feature points of one topic as ``point1``, ``point2`` and so on."""
    held = [offer for offer in log.offers if offer.role == "point"]
    if not held:
        return
    topics = {offer.topic: sum(len(o.y) for o in held if o.topic == offer.topic) for offer in held}
    topic = max(topics, key=lambda name: topics[name])
    if "points" in log.topics:
        nameless = [replace(offer, name="") for offer in held]
        topic = ros_choose.named(log.path, nameless, "points", log.topics["points"]).topic
    chosen = [offer for offer in held if offer.topic == topic]
    names = ", ".join(f"point{i} {offer.name!r}" for i, offer in enumerate(chosen[:12], 1))
    log.notes.append(Note(f"feature points from {topic}: {names}"))
    if others := sorted(topics.keys() - {topic}):
        log.notes.append(Note(f"points from {topic}, not {', '.join(others)}: "
                              "--set input.topics.points=TOPIC takes another"))  # fmt: skip
    yield from ((f"point{i}", offer) for i, offer in enumerate(chosen, 1))


def _references(log: _Log) -> dict[str, Reference]:
    main, known = log.main, ros_axes.fixed(log.offers)
    held = [
        offer
        for offer in log.offers
        if offer.role == "reference"
        and ros_choose.is_attitude(offer)
        and (offer.frame, offer.child) not in known
        and not (ros_choose.OWN in offer.topic and offer.type.endswith("/Imu"))
    ]
    first = log.topics.get("reference")
    held = [
        offer
        for offer in held
        if first in {offer.topic, offer.name} or ros_choose.is_measured(offer, log.notes)
    ]
    best = first and ros_choose.named(log.path, held, "reference", first)
    found: list[tuple[tuple[object, ...], Reference]] = []
    for offer in held:
        worth = ros_choose.kind(offer, log.notes)
        turned = _turned(log, ros_axes.of_body(offer, main.frame, known, log.notes))
        if (attitude := _attitude(log, turned)) is not None:
            order = (
                offer.name != best.name if best else False,
                *ros_choose.rank(offer, worth, main),
            )
            t, q = attitude
            found.append((order, Reference(offer.name, worth, t, q)))
    return {reference.name: reference for _, reference in sorted(found, key=lambda f: f[0])}


def _attitude(log: _Log, offer: Offer) -> tuple[Ints, Array] | None:
    t, rows = ros_clock.times(offer, log.lag, log.notes)
    q = offer.y[rows]
    size = np.linalg.norm(q, axis=1)
    good = ros_clock.finite(offer, q, log.notes) & (size > 1e-3) & (size < 1e3)
    if lost := int((np.isfinite(size) & ~good).sum()):
        log.notes.append(Note(f"{offer.name} of no usable length dropped", lost))
    if off := int((np.abs(size[good] - 1.0) > UNIT_TOLERANCE).sum()):
        log.notes.append(Note(f"{offer.name} not of unit length, normalised", off))
    if not good.any():
        return None
    return t[good], quaternion.continuous(quaternion.normalize(q[good]))


def _clock(first: int, lag: Lag | None) -> Clock:
    name = "recorder's time" if lag is None or (lag.far and not lag.steady) else "ROS time"
    return Clock(name, 0 if first > UNIX else None)


def _topics(
    counts: Mapping[tuple[str, str], int],
    signals: Mapping[str, Signal],
    references: Mapping[str, Reference],
) -> list[dict[str, object]]:
    """Tell of every topic its type, its messages, and what was taken from it."""
    told = []
    for (topic, type_), count in sorted(counts.items()):
        used = [name for name, signal in signals.items() if signal.source == topic]
        used += [
            "reference" for name in references if name == topic or name.startswith(f"{topic}/")
        ]
        told.append({"topic": topic, "type": type_, "messages": count,
                     "used": list(dict.fromkeys(used))})  # fmt: skip
    return told


def _nothing(counts: Mapping[tuple[str, str], int]) -> str:
    """Say what the log holds instead of a gyroscope."""
    if not any(counts.values()):
        return "no message can be read. Record or copy the log again."
    types = ", ".join(sorted({type_ for (_, type_), count in counts.items() if count})[:8])
    return f"no gyroscope (sensor_msgs/Imu or px4_msgs/SensorCombined). The log holds: {types}."
