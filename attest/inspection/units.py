"""Magnitudes that cannot be: a unit taken for another one, or a field that is not the Earth's."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from attest.config import UNITS
from attest.geometry.earth import FIELD, GRAVITY
from attest.inspection.place import Earth
from attest.recording import Note, Recording

Array = NDArray[np.float64]

MOST_SAMPLES = 5_000
"""That a magnitude is taken from, spread over the log."""
PLAUSIBLE_GRAVITY = (0.5, 2.0)
"""Median of the accelerometer in standard gravities: even a flight in steep turns stays within."""
GRAVITY_MARGIN = 0.1
"""A calm accelerometer may differ from standard gravity by this share."""
HARDLY = 0.3
"""Of standard gravity: an accelerometer that reads less does not feel the ground."""
CALM, STEADY = 0.05, 0.4
"""Spreads of a magnitude, quartile to quartile, over its median: gravity with some motion."""
UNIT_TOLERANCE = 0.25
ACCEL_UNITS = {
    1.0: "m/s²",
    1.0 / GRAVITY: "g",
    1000.0 / GRAVITY: "mg or cm/s²",
    1000.0: "mm/s²",
    3.2808: "ft/s²",
    GRAVITY: "m/s², multiplied by g once more",
    1e-3: "km/s²",
}
"""By what the accelerometer then reads for gravity, in gravities."""
MAG_UNITS = {1.0: "T", 1e4: "gauss", 1e6: "µT", 1e7: "mG", 1e9: "nT", 1e3: "mT"}
"""By how many of them make a tesla."""
READ_AS = {"tlog": 1e7, "dataflash": 1e7, "ulog": 1e4}
"""Units of the field that a format is read in, by how many of them make a tesla; others: tesla."""
CSVS = frozenset({"csv", "sensor_logger"})
"""Formats whose units are told by input.csv."""
FIELD_MARGIN = 1.1
"""The field may be outside the Earth's range by this factor before it is doubted."""
MODEL_MARGIN = 0.25
"""The field's strength may differ from the model's by this share before it is doubted."""
FAR = 5.0
"""Further from what it can be than by this factor is no disturbance."""
FASTEST = 40.0
"""rad/s, 2300 deg/s: what few gyroscopes measure, and few vehicles survive."""


def doubts(recording: Recording, earth: Earth | None) -> Iterator[Note]:
    """Yield what the magnitudes of gyroscope, accelerometer and magnetometer tell."""
    lengths = {
        name: length_of(recording.signals[name].y)
        for name in ("accel", "mag")
        if name in recording.signals and len(recording.signals[name].t) > 1
    }
    yield from _gravity(recording, lengths)
    yield from _field(recording, lengths, earth)


def length_of(y: Array) -> Array:
    """Return the lengths of some vectors, spread over the log."""
    some = y[:: -(-len(y) // MOST_SAMPLES)]
    length: Array = np.linalg.norm(some, axis=1)
    return length


def too_fast(recording: Recording) -> Note | None:
    """Doubt a gyroscope that reads more than any vehicle turns."""
    gyro = recording.signals.get("gyro")
    if gyro is None or len(gyro.t) < 2:
        return None
    rate = float(np.percentile(length_of(gyro.y), 90))
    if rate < FASTEST:
        return None
    text = f"the gyroscope reads {rate:.3g} rad/s: its unit "
    if read_in(recording, "gyro") != 1.0:
        return Note(f"{text}or scale is wrong", doubt=True)
    degree = UNITS["gyro"]["deg/s"]
    return Note(
        f"{text}cannot be rad/s, but deg/s or mrad/s{mend(recording, 'gyro', degree)}", doubt=True
    )


def read_in(recording: Recording, signal: str) -> float:
    """Return the unit, in SI, that a signal's numbers were taken in."""
    options = UNITS[signal]
    untold = next(iter(options.values())) if recording.format in CSVS else 1.0
    return options.get(told(recording).get(signal, ""), untold)


def told(recording: Recording) -> Mapping[str, str]:
    """Return the units that the reader of a CSV took, or that the user told, by signal."""
    units = recording.details.get("units")
    return units if isinstance(units, Mapping) else {}


def mend(recording: Recording, signal: str, factor: float) -> str:
    """Tell the option that multiplies a signal by such a factor, where there is one."""
    wanted = factor * read_in(recording, signal)
    key = f"csv.{signal}.unit" if recording.format in CSVS else f"unit.{signal}"
    for unit, scale in UNITS[signal].items():
        if abs(wanted / scale - 1.0) < UNIT_TOLERANCE:
            return f": --set input.{key}={unit}"
    return ""


def _gravity(recording: Recording, lengths: Mapping[str, Array]) -> Iterator[Note]:
    if "accel" not in lengths:
        return
    low, median, high = np.percentile(lengths["accel"], (25, 50, 75))
    ratio, spread = float(median / GRAVITY), float((high - low) / median) if median else np.inf
    near = PLAUSIBLE_GRAVITY[0] < ratio < PLAUSIBLE_GRAVITY[1]
    if median == 0.0 or (near and (abs(ratio - 1.0) < GRAVITY_MARGIN or spread > CALM)):
        return
    text = f"the accelerometer reads {median:.3g} m/s² for gravity's {GRAVITY:.2f}"
    now = read_in(recording, "accel")
    others = {f: unit for f, unit in ACCEL_UNITS.items() if not np.isclose(f, 1.0 / now)}
    unit = _near(ratio / now, others)
    if unit is not None and spread < STEADY:
        text += f": its unit seems to be {unit}" + mend(recording, "accel", 1.0 / ratio)
    elif near:
        text += ": its scale or bias is wrong"
    elif ratio < HARDLY:
        text += ": it is in free fall, or gravity was taken out of it"
    else:
        text += ": a wrong unit or scale"
    yield Note(text, doubt=True)


def _near(ratio: float, known: Mapping[float, str]) -> str | None:
    for factor, unit in known.items():
        if abs(ratio / factor - 1.0) < UNIT_TOLERANCE:
            return unit
    return None


def _field(
    recording: Recording, lengths: Mapping[str, Array], earth: Earth | None
) -> Iterator[Note]:
    # a reader that found a field without strength has said so
    if "mag" not in lengths or recording.tells("field strength"):
        return
    strength = float(np.median(lengths["mag"]))
    low, high = FIELD[0] / FIELD_MARGIN, FIELD[1] * FIELD_MARGIN
    expected = f"{FIELD[0] * 1e6:.0f}-{FIELD[1] * 1e6:.0f} µT"
    if earth is not None:
        model = float(np.linalg.norm(earth.field))
        low, high = model * (1.0 - MODEL_MARGIN), model * (1.0 + MODEL_MARGIN)
        expected = f"{model * 1e6:.1f} µT by the World Magnetic Model"
    if low <= strength <= high or not strength > 0.0:
        return
    text = f"the magnetometer reads {_tesla(strength)} for the Earth's {expected}"
    numbers = strength * READ_AS.get(recording.format, 1.0) / read_in(recording, "mag")
    per_tesla = next((k for k in MAG_UNITS if low <= numbers / k <= high), None)
    if per_tesla is None:
        far = not low / FAR < strength < high * FAR
        text += ": a wrong unit" if far else ": not calibrated, or disturbed"
    else:
        option = mend(recording, "mag", numbers / per_tesla / strength)
        text += f": its unit seems to be {MAG_UNITS[per_tesla]}{option}"
    yield Note(text, doubt=True)


def _tesla(strength: float) -> str:
    return f"{strength * 1e6:.4g} µT" if 1e-8 < strength < 1e-2 else f"{strength:.3g} T"
