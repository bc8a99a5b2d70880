"""The gyroscope: its own errors taken off, and to each step the rate measured over it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import drift, drift_sums, frame, gyroscope_errors, smoothing
from attest.conditioning.measured import usable
from attest.conditioning.rest import BIAS
from attest.conditioning.rested import rested
from attest.conditioning.rows import times_since
from attest.config import Conditioning
from attest.recording import Note, Recording, Signal, seconds

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AXES = "xyz"
KNOWN = 0.1
"""Share of a deviation of before, below which something is known; the scale of one gyroscope is
another by 0.2 of it from log to log."""
SHOWN = 0.005
"""Least scale or misalignment that shows in what is told, %."""
UNKNOWN = 0.5
"""Share of the deviation of before, above which a bias is hardly known."""


Room = tuple[Array, Array, Array, Array]
"""That of `drift`, and of the rate over each step."""


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """The gyroscope, corrected as far as is known at each sample."""

    at: Array
    """Rate at the stamps, rad/s, shape (n, 3)."""
    over: Array
    """What the observer takes for the step that begins at each stamp, rad/s, shape (n, 3)."""
    mean: Array
    """Mean rate over that step: for one that is divided, of its two ends, shape (n, 3); the same
    array where none is."""
    bias: Array | None
    """Bias that was taken off, rad/s, shape (n, 3); None where nothing was."""
    known: Array | None = None
    """Bias, scale and misalignment at the end, and their deviations, (2, 12); None where nothing
    tells them."""
    deviation: Array | None = None
    """Of the bias, as it was known at each stamp, rad/s, shape (n,); None where nothing tells."""


def shapes(n: int) -> list[tuple[int, ...]]:
    """Return the shapes of a `Room` for a log of n samples."""
    return [(n, 3), (n, 3), (n,), (n, 3)]


def rates(
    recording: Recording,
    gyro: Signal,
    restart: Mask,
    substeps: NDArray[np.int64],
    config: Conditioning,
    into: Room,
) -> tuple[Rates, list[Note]]:
    """Take the gyroscope's errors off, and give each step its rate.

    Arrays ``into``, of the shapes that `shapes` says, are filled by what is found.
    """
    h = times_since(gyro.t, restart)
    corrected, notes = _corrected(recording, gyro, restart, h, config, into[:3])
    at = corrected.at
    if config.gyroscope.sample == "begins":
        return replace(corrected, mean=frame.mean_of_ends(at)), notes
    mean = over = into[-1]
    over[:-1], over[-1] = at[1:], at[-1]
    divided = (substeps > 1) | np.append(restart[1:], True)
    if divided[:-1].any():  # such a step takes the line between its ends
        mean = over.copy()
        mean[divided] = 0.5 * (at[divided] + over[divided])
        over[divided] = at[divided]
    frame.cone(h, at, divided, over)
    if mean is not over:
        frame.cone(h, at, divided, mean)
    return replace(corrected, over=over, mean=mean), notes


def scale_of(known: Array | None, config: Conditioning) -> Array | None:
    """Return the scale of each axis, shape (3,), NaN where the log does not tell it."""
    if known is None:
        return None
    scale, std = (np.diag(row[3:].reshape(3, 3)) for row in known)
    told = std < KNOWN * config.gyroscope.scale_std
    return np.where(told, scale, np.nan) if told.any() else None


def resting(
    recording: Recording, gyro: Signal, restart: Mask, h: Array
) -> tuple[Array, Array, Mask] | None:
    """Return specific force and field at the gyroscope's stamps, and where the body is at rest.

    Both (n, 3); the field without rows where there is too little of it. None where the log has too
    little of an accelerometer; h is the time from the sample before.
    """
    if "accel" not in recording.signals:
        return None
    accel, _ = usable(recording.signals["accel"])
    if len(accel.t) < drift.FEWEST:
        return None
    force, field = _at(gyro.t, accel), _field(recording, gyro)
    return force, field, rested(h, gyro.y, force, restart, field)


def _corrected(
    recording: Recording,
    gyro: Signal,
    restart: Mask,
    h: Array,
    config: Conditioning,
    into: drift.Room,
) -> tuple[Rates, list[Note]]:
    """Return the rate less the gyroscope's errors, for every step as at its stamp."""
    settings = config.gyroscope
    known = np.zeros((2, gyroscope_errors.N))
    known[0, :3], known[0, 3:] = settings.bias, np.ravel(settings.scale)
    known[1, :3], known[1, 3:] = settings.bias_std, settings.scale_std
    told = resting(recording, gyro, restart, h) if settings.correct else None
    if told is None:
        return _as_given(gyro, known[0]), []
    force, field, still = told
    if unfit(recording, gyro, h, config.max_step_s) is not None:  # only rest tells
        force = field = np.empty((0, 3))
    found = drift.follow(h, gyro.y, force, field, still, restart, known, into)
    at = found.rate
    rates = Rates(at, at, at, found.bias, found.known, found.deviation)
    return rates, [_told(still, known, found.known, found.bias[-1])]


def _as_given(gyro: Signal, x: Array) -> Rates:
    """Return the rate less the errors that are known before, and the bias if there are any."""
    if not x.any():
        return Rates(gyro.y, gyro.y, gyro.y, None)
    at = gyro.y - x[:3] - gyro.y @ x[3:].reshape(3, 3).T
    return Rates(at, at, at, np.broadcast_to(x[:3], gyro.y.shape).copy())


def unfit(recording: Recording, gyro: Signal, h: Array, max_step: float) -> str | None:
    """Say why turns cannot tell scale and misalignment; None where they can.

    Parameters
    ----------
    h : shape (n,)
        Time from the sample before, s.
    max_step
        Longest step that is not divided, s.
    """
    if "velocity" in recording.signals:  # a vehicle's, whose turns and climbs do not cancel
        return "as gravity is no mean of a vehicle's force, and the log has a velocity"
    if smoothing.longest_memory(h, gyro.y, max_step) < drift_sums.WINDOW:
        return "as the gyroscope is too slow for its motion"
    return None


def _field(recording: Recording, gyro: Signal) -> Array:
    """Return the magnetometer at the gyroscope's stamps, (n, 3); none where there is too little."""
    if "mag" in recording.signals:
        mag, _ = usable(recording.signals["mag"])
        if len(mag.t) >= drift.FEWEST:
            return _at(gyro.t, mag)
    return np.empty((0, 3))


def _at(t: NDArray[np.int64], signal: Signal) -> Array:
    """Interpolate a signal to times t, (n, 3)."""
    if np.array_equal(t, signal.t):
        return signal.y
    origin = int(t[0])
    at, stamps = seconds(t, origin), seconds(signal.t, origin)
    return np.stack([np.interp(at, stamps, column) for column in signal.y.T], axis=1)


def _told(resting: Mask, before: Array, known: Array, last: Array) -> Note:
    """Say what was found, and if it was not at the last step yet, what was taken off there."""
    large = bool(np.linalg.norm(known[0, :3]) > BIAS)
    at_rest = f"(at rest {resting.mean():.0%} of the log)"
    open_axes = "".join(
        axis
        for axis, std, prior in zip(AXES, known[1, :3], before[1, :3], strict=True)
        if std > UNKNOWN * prior
    )
    if len(open_axes) == len(AXES):
        return Note(f"gyroscope: nothing in the log tells its bias {at_rest}: left to the observer")
    text = f"gyroscope: bias {_axes(known[0, :3])} °/s at the end {at_rest}, "
    if (scale := 100.0 * np.abs(known[0, 3:]).max()) >= SHOWN:
        text += f"scale and misalignment up to {scale:.2f} %, "
    text += "taken off as they became known"
    if np.linalg.norm(last - known[0, :3]) > gyroscope_errors.REST_STD:
        text += f"; that came late: {_axes(last)} °/s was taken off at the last step"
    if open_axes:
        text += f"; that about {' and '.join(open_axes)} is hardly told"
    return Note(text, doubt=large)


def _axes(rate: Array) -> str:
    return ", ".join(f"{each:+.2f}" for each in np.round(np.rad2deg(rate), 2) + 0.0)
