"""Which topic gives what: by type and completeness, unless the user names one."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from attest.errors import ReadError
from attest.readers import gps
from attest.readers.ros_axes import WORLDS, is_tree
from attest.readers.ros_offers import Offer, is_placeholder
from attest.readers.values import any_of
from attest.recording import Kind, Note

QUICK = 0.9
"""Topics with this share of the most messages are as good as the one that has most."""
OWN = "/attest/"
"""Where attest's own results are: an estimate's rate and attitude, no measurement."""

TRUTH = re.compile(
    r"(vicon|optitrack|natnet|mocap|motion_?capture|qualisys|vrpn|phasespace|ground_?truth|"
    r"(?<![a-z])(?:gt|truth)(?![a-z]))"
)
"""Names of motion capture and ground truth."""
LAB = re.compile(r"vicon|optitrack|natnet|mocap|motion_?capture|qualisys|vrpn|phasespace|^odom$")
"""Worlds whose heading is their own, and not north."""
COMMAND = re.compile(r"setpoint|(?<![a-z])(?:cmd|command|goal|target|desired)")
"""Topics of what a vehicle shall do, which nobody measured."""
ON_BOARD = re.compile(r"base|body|imu|fcu|link|sensor")
"""Frames that move with the vehicle."""


def usable(offers: Iterable[Offer], notes: list[Note]) -> list[Offer]:
    """Leave out what is there in form only: zero throughout, or not a single number."""
    kept = []
    for offer in offers:
        finite = ~any_of(~np.isfinite(offer.y))
        real = offer.y if finite.all() else offer.y[finite]
        if offer.empty and len(offer.y):
            text = f"{offer.topic} {offer.role} without a value dropped"
            notes.append(Note(text, offer.empty))
        if offer.poor:
            text = f"{offer.topic} {offer.role} no better than {gps.WORST:g} m/s dropped"
            doubt = offer.poor > 0.1 * (offer.poor + len(offer.y))
            notes.append(Note(text, offer.poor, doubt))
        if not len(real):
            if len(offer.y):
                notes.append(Note(f"{offer.topic} {offer.role} without a finite value: not used"))
        elif not real.any():
            notes.append(Note(f"{offer.topic} {offer.role} zero throughout: not used"))
        elif offer.role == "reference" and not offer.child and is_placeholder(real):
            notes.append(Note(f"{offer.topic} orientation is identity throughout: no reference"))
        else:
            kept.append(offer)
    return kept


def choose(
    path: Path, offers: Sequence[Offer], topics: Mapping[str, str], notes: list[Note]
) -> dict[str, Offer]:
    """Return for each role the offer to take; points and references are chosen elsewhere."""
    chosen: dict[str, Offer] = {}
    for role in ("gyro", "accel", "mag", "velocity", "position", "torque"):
        held = [offer for offer in offers if offer.role == role]
        if role in topics:
            chosen[role] = named(path, held, role, topics[role])
            continue
        if role == "accel" and "gyro" in chosen:  # one unit for both, where it has both
            held = [offer for offer in held if offer.topic == chosen["gyro"].topic] or held
        if role != "torque":  # which is a command
            held = [offer for offer in held if is_measured(offer, notes)]
        if role == "velocity":
            held = [offer for offer in held if _is_in_world(offer, chosen.get("gyro"), notes)]
        if held:
            chosen[role] = _best(held, offers, chosen.get("gyro"))
            _tell(role, chosen, held, notes)
    if "gyro" in chosen and OWN in chosen["gyro"].topic:
        notes.append(Note(f"gyro from {chosen['gyro'].topic}, which is attest's own estimate and "
                          "no measurement", doubt=True))  # fmt: skip
    return chosen


def is_measured(offer: Offer, notes: list[Note]) -> bool:
    """Tell whether something measured it, as far as its topic's name tells."""
    found = COMMAND.search(offer.topic.lower())
    if found is None:
        return True
    notes.append(Note(f"{offer.topic} {offer.role}, by its name {found.group()!r}, is a command: "
                      f"not used; --set input.topics.{offer.role}=TOPIC takes it"))  # fmt: skip
    return False


def named(path: Path, held: Sequence[Offer], role: str, topic: str) -> Offer:
    """Return the offer of the topic that the user names.

    Raises
    ------
    ReadError
        It gives nothing of the kind.
    """
    for offer in held:
        if topic in {offer.topic, offer.name or offer.topic}:
            return offer
    others = ", ".join(dict.fromkeys(offer.name or offer.topic for offer in held)) or "none"
    raise ReadError(f"{path}: {topic} gives no {role}. Topics that do: {others}.")


def _best(held: Sequence[Offer], offers: Sequence[Offer], gyro: Offer | None) -> Offer:
    """Choose by count, then by what else the topic gives, then by name."""
    with_accel = {offer.topic for offer in offers if offer.role == "accel"}
    measured = [offer for offer in held if OWN not in offer.topic] or list(held)
    plain = [offer for offer in measured if "Vector3" not in offer.type] or measured
    most = max(len(offer.y) for offer in plain)
    quick = [offer for offer in plain if len(offer.y) >= QUICK * most]
    return min(
        quick,
        key=lambda offer: (
            gyro is not None and offer.topic != gyro.topic,
            offer.topic not in with_accel,
            gyro is not None and offer.frame != gyro.frame,
            "raw" not in offer.topic,
            offer.topic,
        ),
    )


def _tell(role: str, chosen: Mapping[str, Offer], held: Sequence[Offer], notes: list[Note]) -> None:
    """Say which topics were there to choose from."""
    topic = chosen[role].topic
    others = sorted({offer.topic for offer in held} - {topic})
    if others:
        text = f"{role} from {topic}, not {', '.join(others)}: --set input.topics.{role}=TOPIC"
        notes.append(Note(f"{text} takes another"))


def _is_in_world(offer: Offer, gyro: Offer | None, notes: list[Note]) -> bool:
    """Whether a velocity is along the axes of the world, as far as names tell."""
    if offer.axes == "px4":
        return True
    twist = offer.type.endswith(("TwistStamped", "TwistWithCovarianceStamped"))
    on_board = ON_BOARD.search(offer.frame.lower()) or (
        gyro is not None and offer.frame == gyro.frame
    )
    if twist and on_board:
        reason = "is in the vehicle's own axes"
    elif LAB.search(offer.frame.lower()) or LAB.search(offer.topic.lower()):
        reason = "is in a world whose heading is its own"
    else:
        return True
    notes.append(Note(f"{offer.topic} velocity, by its frame {offer.frame!r}, {reason}: not used; "
                      "--set input.topics.velocity=TOPIC takes it"))  # fmt: skip
    return False


def kind(offer: Offer, notes: list[Note]) -> Kind:
    """Return what a reference is worth: truth only where its name says so."""
    names = "/".join((offer.topic, offer.frame, offer.child)).lower()
    found = None if OWN in offer.topic or offer.type in _ON_BOARD_TYPES else TRUTH.search(names)
    if found is None:
        return "autopilot"
    notes.append(Note(f"{offer.name} taken as truth, as its name has {found.group()!r}"))
    return "truth"


_ON_BOARD_TYPES = {"sensor_msgs/msg/Imu", "px4_msgs/msg/VehicleAttitude"}


def is_attitude(offer: Offer) -> bool:
    """Whether a transform of a tree is a body's against the world, and not a joint's."""
    if not is_tree(offer):
        return True
    if offer.child.startswith("reference/") and offer.frame == "world":
        return False  # attest's own, which it gives as poses too
    against = WORLDS.search(offer.frame.lower()) or TRUTH.search(offer.frame.lower())
    return bool(against) and not WORLDS.fullmatch(offer.child.lower())


def rank(offer: Offer, worth: Kind, gyro: Offer) -> tuple[bool, bool, bool, int, str]:
    """Order references, the best first: truth, the gyroscope's own topic, by count."""
    return worth != "truth", is_tree(offer), offer.topic != gyro.topic, -len(offer.y), offer.name
