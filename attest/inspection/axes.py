"""Axes, signs and scales of gyroscope, accelerometer and magnetometer against each other."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from attest.inspection import carried, felt, mounting, references, turning, units
from attest.inspection.turning import CLEAR, FITS, Fit
from attest.recording import Note, Recording

SCALES = {
    np.pi / 180.0: "deg/s",
    1e-3: "mrad/s",
    180.0 / np.pi: "rad/s, taken for deg/s",
    1e3: "rad/s, taken for mrad/s",
}
"""Units by what a gyroscope in them must be multiplied by."""
SCALE_TOLERANCE = 0.15
WRONG_SCALE = 2.0
"""A scale that is further from 1 than this factor is doubted without a unit."""
NAMES = {
    "gyro": "gyroscope",
    "accel": "accelerometer",
    "mag": "magnetometer",
    "reference": "reference",
}


def fits(recording: Recording) -> dict[str, Fit]:
    """Fit magnetometer, accelerometer and default reference to the gyroscope, where they tell."""
    if "gyro" not in recording.signals:
        return {}
    vectors = {n: recording.signals[n] for n in ("mag", "accel") if n in recording.signals}
    if (reference := references.default(recording)) is not None:
        vectors["reference"] = references.north(reference)
    gyro = recording.signals["gyro"]
    found = {name: turning.fit(gyro, vector) for name, vector in vectors.items()}
    return {name: fit for name, fit in found.items() if fit is not None}


def felt_too(recording: Recording, found: Mapping[str, Fit]) -> dict[str, Fit]:
    """Add the accelerometer by other means, where accelerations keep it from turning alike."""
    accel = recording.signals.get("accel")
    known = "accel" in found and found["accel"].best > CLEAR
    if "gyro" not in recording.signals or accel is None or known:
        return dict(found)
    reference = references.default(recording)
    fit = None
    if reference is not None and "reference" in _right(found):
        fit = felt.fit(recording, reference)
    if fit is None:
        fit = carried.fit(recording.signals["gyro"], accel)
    others = {name: other for name, other in found.items() if name != "accel"}
    return dict(found) if fit is None else others | {"accel": fit}


def unit(recording: Recording, found: Mapping[str, Fit]) -> Note | None:
    """Doubt the gyroscope's unit, by what turns with it or else by what no vehicle survives."""
    scale = _scale(found)
    return units.too_fast(recording) if scale is None else _of_scale(recording, scale)


def doubts(recording: Recording, found: Mapping[str, Fit]) -> Iterator[Note]:
    """Yield what does not fit: the gyroscope's axes, or else what turns otherwise."""
    right = _right(found)
    turned = {name: fit for name, fit in _wrong(found).items() if not fit.shared}
    mirrored = [fit for fit in turned.values() if _mirrored(fit)]
    agreed = [] if len(turned) < 2 or not _same(turned) else list(turned.values())
    if not right and (mirrored or agreed):
        yield _of_gyroscope(recording, (mirrored + agreed)[0])
        return
    for name, fit in turned.items():
        if name != "reference":
            yield _of_vector(recording, name, fit, right)
    if _scale(found) is None:
        witness = next((NAMES[name] for name in right if name != "reference"), "")
        yield from references.doubts(recording, found, witness)


def _wrong(found: Mapping[str, Fit]) -> dict[str, Fit]:
    return {name: fit for name, fit in found.items() if fit.as_read < FITS and fit.best > CLEAR}


def _right(found: Mapping[str, Fit]) -> list[str]:
    return [name for name, fit in found.items() if fit.as_read >= FITS and fit.shared]


def _scale(found: Mapping[str, Fit]) -> Fit | None:
    """Return a fit that asks for another scale of the gyroscope, where none is right as read."""
    if _right(found):
        return None
    return next((fit for fit in _wrong(found).values() if _scaled(fit)), None)


def _scaled(fit: Fit) -> bool:
    return fit.scale > 0.0 and not 1.0 / WRONG_SCALE < fit.scale < WRONG_SCALE


def _of_scale(recording: Recording, fit: Fit) -> Note:
    near = (unit for k, unit in SCALES.items() if abs(fit.scale / k - 1.0) < SCALE_TOLERANCE)
    unit = next(near, None)
    seems = "its unit or scale is wrong" if unit is None else f"its unit seems to be {unit}"
    text = f"the vectors turn {fit.scale:.3g} times as fast as the gyroscope reads: {seems}"
    return Note(text + units.mend(recording, "gyro", fit.scale), doubt=True)


def _same(fits: Mapping[str, Fit]) -> bool:
    first, *others = fits.values()
    return all(np.array_equal(fit.axes, first.axes) for fit in others)


def _mirrored(fit: Fit) -> bool:
    """Whether axes are mirrored, which no fault of a vector's own axes looks like."""
    return fit.unique and bool(np.linalg.det(fit.axes) < 0.0)


def _of_gyroscope(recording: Recording, fit: Fit) -> Note:
    if np.array_equal(fit.axes, -np.eye(3)):
        text = "the gyroscope turns the wrong way about all axes: it is inverted"
    else:
        text = (
            f"the gyroscope's axes are wrong{': they' if fit.unique else ''}{_named(fit, fit.axes)}"
        )
    option = f": {mounting.option(recording, 'gyro', fit.axes)}" if fit.unique else ""
    return Note(text + _evidence(fit) + option, doubt=True)


def _of_vector(recording: Recording, name: str, fit: Fit, right: list[str]) -> Note:
    what = f"the gyroscope's and the {NAMES[name]}'s axes are not the same"
    if right:
        what = f"the {NAMES[name]}'s axes are not those of gyroscope and {NAMES[right[0]]}"
    if fit.unique:
        what += f": the {NAMES[name]}'s"
    # the vector as read is P or -P times the true one, and both turn alike
    or_opposite = ", or the opposite" if fit.unique else ""
    text = f"{what}{_named(fit, fit.axes.T)}{or_opposite}{_evidence(fit)}"
    return Note(text + _cure(recording, name, fit, right), doubt=True)


def _cure(recording: Recording, name: str, fit: Fit, right: list[str]) -> str:
    """Name the option that turns the vector, or the gyroscope where that may be at fault."""
    if not fit.unique:
        return ""
    reference = references.default(recording) if "reference" in right else None
    of_vector = mounting.either_way(recording, name, fit.axes.T, reference)
    if right:
        return f": {of_vector}"
    of_gyro = mounting.option(recording, "gyro", fit.axes)
    return f": {of_gyro} if the gyroscope's are wrong, else {of_vector}"


def _named(fit: Fit, axes: NDArray[np.float64]) -> str:
    return f" would fit as {turning.written(axes)}" if fit.unique else ""


def _evidence(fit: Fit) -> str:
    if not fit.turns:
        return ""
    seen = f"{max(0.0, fit.as_read):.0%}"
    which = "that explains" if fit.unique else "others explain"
    return f" ({which} {fit.best:.0%} of the turns; as read, {seen})"
