"""Frames: which rotations the log knows between sensors, and the axes of body and world."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from attest.geometry import frames, quaternion
from attest.readers.ros_decode import Array
from attest.readers.ros_offers import Offer
from attest.recording import Note, World

STILL = 1e-6
"""A transform whose quaternion moves by no more than this is fixed, on whatever topic."""
WORLDS = re.compile(r"map|world|odom|earth|enu|ned|utm|origin|global|local|inertial")
"""Names of frames that stand still."""

Fixed = Mapping[tuple[str, str], Array]
"""Rotations by (parent, child): ``v_parent = rotate(q, v_child)``."""


def fixed(offers: Sequence[Offer]) -> dict[tuple[str, str], Array]:
    """Return the transforms between frames that do not move; a body at rest is none of them."""
    found = {}
    for offer in offers:
        if offer.role != "reference" or not is_tree(offer):
            continue
        static = offer.topic.endswith("tf_static") or not WORLDS.search(offer.frame.lower())
        if static and is_still(offer):
            found[offer.frame, offer.child] = quaternion.normalize(offer.y[0])
    return {pair: q for pair, q in found.items() if np.isfinite(q).all()}


def is_still(offer: Offer) -> bool:
    """Whether a transform is the same in all messages."""
    return bool(np.abs(offer.y - offer.y[0]).max() <= STILL)


def is_tree(offer: Offer) -> bool:
    """Whether it is one of a tree of transforms."""
    return offer.type.endswith(("/TFMessage", "/tfMessage"))


def between(known: Fixed, target: str, source: str) -> Array | None:
    """Return the rotation that takes vectors of one frame to another; None where none is known."""
    reached = {source: np.array([1.0, 0.0, 0.0, 0.0])}
    border = [source]
    while border and target not in reached:
        frame = border.pop()
        for (parent, child), q in known.items():
            if child == frame and parent not in reached:
                reached[parent] = quaternion.multiply(q, reached[frame])
                border.append(parent)
            elif parent == frame and child not in reached:
                reached[child] = quaternion.multiply(quaternion.conjugate(q), reached[frame])
                border.append(child)
    return reached.get(target)


def into_body(offer: Offer, body: str, known: Fixed, notes: list[Note]) -> Offer:
    """Turn a vector from its own frame to that of the gyroscope."""
    if not offer.frame or not body or offer.frame == body:
        return offer
    q = between(known, body, offer.frame)
    what = f"{offer.role} in frame {offer.frame!r}, gyro in {body!r}"
    if q is None:
        notes.append(Note(f"{what}, and the log does not tell how they lie: not turned",
                          doubt=True))  # fmt: skip
        return offer
    notes.append(Note(f"{what}: turned by the log's static transforms"))
    return replace(offer, y=quaternion.rotate(q, offer.y), frame=body)


def of_body(offer: Offer, body: str, known: Fixed, notes: list[Note]) -> Offer:
    """Turn an attitude of another frame to that of the gyroscope's, where the log tells how."""
    if not offer.child or not body or offer.child == body:
        return offer
    q = between(known, offer.child, body)
    if q is None or np.abs(q[1:]).max() <= STILL:
        return offer
    notes.append(Note(f"{offer.name} is of {offer.child!r}, gyro in {body!r}: turned by the log's "
                      "static transforms"))  # fmt: skip
    return replace(offer, y=quaternion.multiply(offer.y, q), child=body)


def axes(offer: Offer, own: World, target: World) -> Offer:
    """Turn values from their source's axes to the recording's."""
    if own == target:
        return offer
    if offer.role == "reference":
        return replace(offer, y=frames.bring(offer.y))
    if offer.role == "velocity":
        return replace(offer, y=offer.y[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0]))
    if offer.role == "position":
        return offer
    return replace(offer, y=offer.y * np.array([1.0, -1.0, -1.0]))
