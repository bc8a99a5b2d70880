"""What a log holds, in SI units and stated axes, before anything is done to it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError

World = Literal["ned", "enu"]
"""World axes: north-east-down, or east-north-up."""

Kind = Literal["truth", "autopilot", "smoother"]
"""``truth``: motion capture or simulator. ``autopilot``: an on-board estimate, same sensors.
``smoother``: attest's own, of the whole log, same sensors."""


Subject = Literal["up", "field strength"]
"""``up``: which way the accelerometer says is up. ``field strength``: the magnetometer's length."""


def seconds(t: NDArray[np.int64], origin: int) -> NDArray[np.float64]:
    """Return nanoseconds as seconds from an origin, exact to their last digit for months."""
    return np.asarray((t - origin) * 1e-9, np.float64)


@dataclass(frozen=True, slots=True)
class Note:
    """One repair, drop or doubt about the data, counted."""

    text: str
    """What happened, in words that read well behind the count."""
    count: int = 1
    """How many times."""
    doubt: bool = False
    """Whether the result should be read with care because of it (shown as a warning)."""
    about: Subject | None = None
    """What it is about, where others would tell the same: they look here, not at the text."""


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """One quantity on its own clock."""

    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, strictly increasing, shape (n,)."""
    y: NDArray[np.float64]
    """Values, shape (n, k)."""
    source: str = ""
    """The message, topic or columns that it was read from."""

    def __post_init__(self) -> None:
        _check_clock(self.source, self.t, self.y)


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """An attitude to compare with, and what it is worth."""

    name: str
    """The message or topic, such as ``SIMSTATE``."""
    kind: Kind
    t: NDArray[np.int64]
    """Nanoseconds on the recording's clock, strictly increasing, shape (n,)."""
    q: NDArray[np.float64]
    """Unit quaternion (w, x, y, z), body to world, sign continuous in time, shape (n, 4)."""
    world: World | None = None
    """World axes that it was read in from a file of its own, where these can be chosen."""

    def __post_init__(self) -> None:
        _check_clock(self.name, self.t, self.q)


@dataclass(frozen=True, slots=True)
class Clock:
    """What the nanoseconds of a recording count from."""

    name: str
    """In words, such as ``autopilot boot clock``."""
    utc_offset: int | None = None
    """Nanoseconds to add to reach UTC since 1970; None where the log does not allow it."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One log, read.

    Signals by name: ``gyro`` rad/s, ``accel`` m/s² (specific force), ``mag`` tesla, and what the
    log has besides: ``velocity`` m/s in the world, ``position`` (latitude and longitude in degrees,
    altitude in m), ``torque`` N·m in the body, points ``point1``, ``point2`` and so on (m, in their
    sensor's frame), and any further direction measured in the body.
    """

    path: Path
    format: str
    """``tlog``, ``csv``, …"""
    signals: Mapping[str, Signal]
    references: Mapping[str, Reference]
    """By name, the best first."""
    clock: Clock
    vehicle: str = ""
    """Who sent it, in words."""
    vehicle_id: str | None = None
    """What tells it from others: ``uid 3a…``, ``serial 7``, or ``system 1``, as many are called."""
    world: World = "ned"
    body: Literal["frd", "flu"] = "frd"
    declination: float | None = None
    """How far magnetic north is east of true north, rad, as the vehicle was told; None: not."""
    restarts: tuple[int, ...] = ()
    """Times at which the log's own clock started anew (reboot), on the recording's clock, ns."""
    notes: tuple[Note, ...] = ()
    details: Mapping[str, object] = field(default_factory=dict)
    """What only this format can tell, JSON-like: message counts, vehicles seen, damage."""

    def require(self, name: str) -> Signal:
        """Return a signal, or say which ones there are.

        Raises
        ------
        ReadError
            The log holds no such signal.
        """
        if name not in self.signals:
            held = ", ".join(sorted(self.signals)) or "none"
            raise ReadError(f"{self.path}: no {name!r} signal. The log holds: {held}.")
        return self.signals[name]

    def tells(self, subject: Subject) -> bool:
        """Whether a note is about a subject."""
        return any(note.about == subject for note in self.notes)


def _check_clock(name: str, t: NDArray[np.int64], y: NDArray[np.float64]) -> None:
    if t.dtype != np.int64 or y.ndim != 2 or len(t) != len(y):
        raise ReadError(f"{name}: {t.dtype} stamps {t.shape} for values {y.shape}")
    if (late := t[1:] <= t[:-1]).any():
        raise ReadError(f"{name}: time does not advance after sample {np.argmax(late)}")
