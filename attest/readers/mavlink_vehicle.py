"""Which of the senders in a log is the vehicle."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from attest.errors import ConfigError, ReadError
from attest.readers.mavlink_scan import Scan, Table
from attest.readers.mavlink_signals import INERTIAL
from attest.recording import Note

ARDUPILOT, NO_AUTOPILOT = 3, 8
"""MAV_AUTOPILOT values."""
GROUND_STATION = 6
"""MAV_TYPE value."""


KNOWN = {"ardupilotmega": "ArduPilot", "px4": "PX4", "invalid": "", "gcs": "ground station"}
"""What people call what the enumerations call otherwise."""


@dataclass(frozen=True, slots=True)
class Sender:
    """One system and component that sent something."""

    number: int
    """``system << 8 | component``."""
    messages: Counter[str]
    kind: int | None = None
    """MAV_TYPE of its last heartbeat, None without one."""
    autopilot: int | None = None

    @property
    def id(self) -> str:
        """``system/component``."""
        return f"{self.number >> 8}/{self.number & 0xFF}"

    @property
    def is_autopilot(self) -> bool:
        """Whether its heartbeat says that it flies a vehicle."""
        return self.autopilot not in (None, NO_AUTOPILOT) and self.kind != GROUND_STATION

    @property
    def inertial(self) -> int:
        """How many inertial messages it sent."""
        return sum(self.messages[name] for name in INERTIAL)

    def __str__(self) -> str:
        system, component = self.id.split("/")
        words = [_word("MAV_AUTOPILOT", self.autopilot), _word("MAV_TYPE", self.kind)]
        what = " ".join(word for word in words if word) or "unknown"
        return f"{what}, system {system}, component {component}"


def _word(enum: str, value: int | None) -> str:
    from pymavlink.dialects.v20 import ardupilotmega

    entry = ardupilotmega.enums[enum].get(value)
    if entry is None:
        return ""
    word = entry.name.removeprefix(f"{enum}_").replace("_", " ").lower()
    return str(KNOWN.get(word, word))


def senders(scan: Scan) -> list[Sender]:
    """Everyone who sent a sound frame, in order of their numbers."""
    messages: dict[int, Counter[str]] = {}
    for (number, name), count in scan.counts.items():
        messages.setdefault(number, Counter())[name] += count
    beats = scan.tables.get("HEARTBEAT")
    return [Sender(number, messages[number], *_beat(beats, number)) for number in sorted(messages)]


def _beat(beats: Table | None, number: int) -> tuple[int | None, int | None]:
    if beats is None or not (mine := np.flatnonzero(beats.sender == number)).size:
        return None, None
    row = beats.rows[mine[-1]]
    return int(row["type"]), int(row["autopilot"])


def choose(path: Path, found: list[Sender], wanted: str | None, notes: list[Note]) -> Sender:
    """Return the wanted vehicle, or else the one with most to work on.

    Raises
    ------
    ReadError
        The wanted vehicle is not in the log, or nobody sent inertial messages.
    """
    if wanted is not None:
        found = _named(path, found, wanted)
    candidates = [sender for sender in found if sender.inertial]
    if not candidates:
        raise ReadError(f"{path}: {_nothing(found, wanted)}")
    best = max(candidates, key=_worth)
    others = {
        sender.number >> 8: sender.id
        for sender in candidates
        if sender.number >> 8 != best.number >> 8
    }
    if others:
        text = f"another vehicle in the log ({', '.join(others.values())}): {best.id} was taken, "
        notes.append(Note(text + "choose with --vehicle", len(others), doubt=True))
    return best


def _worth(sender: Sender) -> tuple[bool, bool, int, int]:
    return sender.is_autopilot, sender.number & 0xFF == 1, sender.inertial, -sender.number


def _named(path: Path, found: list[Sender], wanted: str) -> list[Sender]:
    system, _, component = wanted.partition("/")
    if not system.isdecimal() or (component and not component.isdecimal()):
        raise ConfigError(f"{path}: vehicle {wanted!r} is no system id. Give 1 or 1/1.")
    named = [
        sender
        for sender in found
        if sender.id == wanted or (not component and sender.number >> 8 == int(system))
    ]
    if not named:
        seen = ", ".join(sender.id for sender in found)
        raise ReadError(f"{path}: no vehicle {wanted} in the log. Choose one of: {seen}.")
    return named


def _nothing(found: list[Sender], wanted: str | None) -> str:
    held = sorted(sum((sender.messages for sender in found), Counter()))
    listed = ", ".join(held[:6]) + (f" and {len(held) - 6} more" if len(held) > 6 else " only")
    who = "it" if wanted is None else f"vehicle {wanted}"
    return (
        f"no inertial data: no gyroscope, {who} holds {listed}. "
        f"attest needs one of {', '.join(INERTIAL)}."
    )
