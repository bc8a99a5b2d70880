"""What the smoother did to a log, and where its answer is doubtful, in words.

Symbols: those of `attest.smoothing.factors`; D the frame that the gyroscope integrates.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from attest.estimates import Estimates
from attest.geometry import quaternion, so3
from attest.recording import Note
from attest.samples import Samples
from attest.smoothing.inputs import usual
from attest.smoothing.turned import turned

Array = NDArray[np.float64]

LEVEL = 0.05
"""Least part of a field across the vertical that has a direction."""
NO_IRON = 1e-3
"""Hard iron below which there is none, as a share of the field."""
OFTEN = 0.15
"""Share of the log in which an unlike field is doubtful."""
UNSURE = 10.0
"""Deviation of the heading that is doubtful, deg."""
TINY = 1e-24
"""Product of variances that are none, rad⁴."""
SELDOM = 0.05
"""Share of the log in which it is not worth a word."""
SHOWN = 0.005
"""Least error of a sensor, m/s² or %, that shows in what is told of it."""


def told(samples: Samples, found: Estimates, bias_deg_s: float) -> Iterator[Note]:
    """Yield what was found of rest and sensors, and taken off, a line each.

    A larger bias than is expected, deg/s, is doubtful.
    """
    known = found.constants
    if samples.rest is not None and samples.rest.any():
        share = f"at rest {samples.rest.mean():.0%} of the log"
        yield Note(f"{share}: the velocity is zero there, and the gyroscope reads its bias")
    else:
        yield Note("at rest nowhere in the log, as far as is told")
    scale = 100.0 * np.abs(known["gyro_scale"]).max()
    if found.gyro_bias is not None:
        bias = np.rad2deg(found.gyro_bias[-1])
        text = f"gyroscope: bias {_axes(bias, 2)} °/s at the end, "
        if scale >= SHOWN:
            text += f"scale and misalignment up to {scale:.2f} %, "
        text += "found in the whole log and taken off"
        yield Note(text, doubt=bool(np.linalg.norm(bias) > bias_deg_s))
    if "accel" in samples.names:
        yield _of_accel(known["accel_bias"], 100.0 * (known["gravity_scale"].item() - 1.0))
    if "mag" in samples.names and known["field_unlike"].size:
        yield from _of_field(samples, known["hard_iron"], known["field"], found)


def _of_accel(bias: Array, scale: float) -> Note:
    if max(np.abs(bias).max(), abs(scale)) < SHOWN:
        return Note("accelerometer used as it is: the whole log tells no bias or scale")
    found = f"bias {_axes(bias, 2)} m/s² and scale {scale:+.2f} %"
    return Note(f"accelerometer: {found}, found in the whole log and taken off")


def _of_field(samples: Samples, iron: Array, field: Array, found: Estimates) -> Iterator[Note]:
    before = samples.sensors.iron in {"applied", "given"}
    if np.abs(iron).max() >= NO_IRON:
        besides = "besides, " if before else ""
        yield Note(
            f"magnetometer: hard iron {_axes(100.0 * iron, 1)} % of the field, {besides}found in "
            "the whole log and taken off"
        )
    elif not before:
        yield Note("magnetometer used as it is: the whole log tells no hard iron")
    down = 1.0 if samples.world == "ned" else -1.0
    dip = np.rad2deg(np.arctan2(down * field[2], np.hypot(field[0], field[1])))
    unlike = found.constants["field_unlike"].item()
    where = f"in {unlike:.0%} of the log" if unlike else "nowhere"
    text = (
        f"magnetic field: dip {dip:+.1f}° in the whole log, and {where} so far off that it counts "
        "for less than half"
    )
    yield Note(f"{text}: heading is doubtful" if unlike > OFTEN else text, doubt=unlike > OFTEN)


def doubts(samples: Samples, found: Estimates) -> Iterator[Note]:
    """Yield where heading is doubtful: by its deviation, and by the gyroscope against the field."""
    if len(samples.names) < 2:
        return  # conditioning says so
    deviation = np.rad2deg(_of_heading(found.states["attitude_covariance"]))
    unsure = float(np.mean(deviation > UNSURE))
    if unsure > SELDOM:
        yield Note(
            f"heading is uncertain by over {UNSURE:g}° in {unsure:.0%} of the log, by up to "
            f"{min(deviation.max(), 180.0):.0f}°: the field hardly tells it",
            doubt=True,
        )
    if "mag" in samples.names:
        yield from _turned(samples, found)


def _of_heading(P: Array) -> Array:
    """Return the heading's deviation if tilt is right, rad, (n,); P by rows of its upper half.

    For want of time to tell gravity from motion, tilt takes heading with it where the field is
    steep: that is no fault of the field.
    """
    xx, xy, xz, yy, yz, zz = P.T
    told_by_tilt = (yy * xz**2 - 2.0 * xy * xz * yz + xx * yz**2) / np.maximum(
        xx * yy - xy**2, TINY
    )
    deviation: Array = np.sqrt(np.maximum(zz - told_by_tilt, 0.0))
    return deviation


def _turned(samples: Samples, found: Estimates) -> list[Note]:
    """Compare the field without the hard iron, across the vertical, with the gyroscope."""
    j, h, rate = samples.names.index("mag"), _steps(samples), found.angular_velocity
    length = np.ones(len(h)) if samples.length is None else samples.length[:, j]
    field = length[:, np.newaxis] / usual(samples) * samples.body[:, j]
    field -= found.constants["hard_iron"]
    up = quaternion.rotate(quaternion.conjugate(found.q), np.array([0.0, 0.0, 1.0]))
    field -= np.sum(field * up, axis=1, keepdims=True) * up
    flat = np.linalg.norm(field, axis=1)
    D = np.empty((len(h), 4))
    mean = 0.5 * (rate + np.concatenate([rate[1:], rate[-1:]]))
    so3.integrate(np.append(h[1:], 0.0), mean, D)
    unit = field / np.maximum(flat, LEVEL)[:, np.newaxis]
    valid, aided = samples.valid[:, j] & (flat > LEVEL), len(samples.inertial) > 1
    return turned(h, D, (unit, np.empty((0, 3))), valid, samples.restart, aided=aided)


def _steps(samples: Samples) -> Array:
    """Return the time from the sample before, s, zero at a restart."""
    h: Array = np.where(samples.restart, 0.0, np.diff(samples.t, prepend=samples.t[0]) * 1e-9)
    return h


def _axes(x: Array, digits: int) -> str:
    return ", ".join(f"{each:+.{digits}f}" for each in np.round(x, digits) + 0.0)
