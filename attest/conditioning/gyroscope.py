"""The gyroscope: its own errors taken off, and to each step the rate measured over it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import drift, frame, smoothing
from attest.conditioning.measured import usable
from attest.conditioning.rest import BIAS
from attest.conditioning.rested import rested
from attest.config import Conditioning
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AXES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """The gyroscope, corrected as far as is known at each sample."""

    at: Array
    """Rate at the stamps, rad/s, shape (n, 3)."""
    over: Array
    """What the observer takes for the step that begins at each stamp, rad/s, shape (n, 3)."""
    mean: Array
    """Mean rate over that step: for one that is divided, of its two ends, shape (n, 3)."""
    bias: Array | None
    """Bias that was taken off, rad/s, shape (n, 3); None where nothing was."""


def rates(
    recording: Recording,
    gyro: Signal,
    restart: Mask,
    substeps: NDArray[np.int64],
    config: Conditioning,
) -> tuple[Rates, list[Note]]:
    """Take the gyroscope's errors off, and give each step its rate."""
    at, bias, notes = _corrected(recording, gyro, restart, config)
    between = frame.mean_of_ends(at)
    if config.gyroscope.sample == "begins":
        return Rates(at, at, between, bias), notes
    # a step that is divided takes the line between its ends
    whole = ((substeps == 1) & ~np.concatenate([restart[1:], [True]]))[:, np.newaxis]
    ends = np.concatenate([at[1:], at[-1:]])
    return Rates(at, np.where(whole, ends, at), np.where(whole, ends, between), bias), notes


def _corrected(
    recording: Recording, gyro: Signal, restart: Mask, config: Conditioning
) -> tuple[Array, Array | None, list[Note]]:
    settings = config.gyroscope
    if "accel" not in recording.signals or not settings.correct:
        return gyro.y, None, []
    accel, _ = usable(recording.signals["accel"])
    if len(accel.t) < drift.FEWEST:
        return gyro.y, None, []
    h = np.where(restart, 0.0, np.diff(gyro.t, prepend=gyro.t[0]) * 1e-9)
    force = _at(gyro.t, accel)
    resting = rested(h, gyro.y, force, restart)
    y = _still(recording, gyro, force, h)
    known = np.zeros((2, drift.N))
    known[1, :3], known[1, 3:] = settings.bias_std, settings.scale_std
    at, bias, known = drift.follow(h, gyro.y, y, resting, restart, known)
    return at, bias, [_told(resting, known)]


def _still(recording: Recording, gyro: Signal, force: Array, h: Array) -> Array:
    """Return what stands still in the world on average, shape (n, 0, 1 or 2, 3)."""
    # with velocity it is a vehicle's, which turns and climbs: gravity is no mean of its force
    slow = smoothing.longest_memory(h, gyro.y) < drift.WINDOW
    if slow or "velocity" in recording.signals:
        return np.empty((len(h), 0, 3))
    vectors = [force]
    if "mag" in recording.signals:
        mag, _ = usable(recording.signals["mag"])
        vectors += [_at(gyro.t, mag)] if len(mag.t) >= drift.FEWEST else []
    return np.stack(vectors, axis=1)


def _at(t: NDArray[np.int64], signal: Signal) -> Array:
    """Interpolate a signal to times t, (n, 3)."""
    if np.array_equal(t, signal.t):
        return signal.y
    origin = int(t[0])
    at, stamps = seconds(t, origin), seconds(signal.t, origin)
    return np.stack([np.interp(at, stamps, column) for column in signal.y.T], axis=1)


def _told(resting: Mask, known: Array) -> Note:
    """Say what was found."""
    bias = np.rad2deg(known[0, :3])
    text = (
        f"gyroscope: bias {bias[0]:+.2f}, {bias[1]:+.2f}, {bias[2]:+.2f} °/s at the end "
        f"(at rest {resting.mean():.0%} of the log), scale and misalignment up to "
        f"{100.0 * np.abs(known[0, 3:]).max():.2f} %, taken off as they became known"
    )
    return Note(text, doubt=bool(np.linalg.norm(known[0, :3]) > BIAS))
