"""The magnetometer: put at its right time, and the field that it measures found in the world."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import calibration, iron, latency, magnetic
from attest.conditioning.measured import Measured, carried, unit
from attest.conditioning.timeline import SECOND, Timeline
from attest.config import Conditioning, Iron
from attest.errors import ReadError
from attest.recording import Note, Recording, Signal, World
from attest.samples import Sensors

Array = NDArray[np.float64]

VERTICAL = 0.99
"""Cosine from which a known vector is taken as straight up, 8°: in a turn, a - g is not."""


def magnetometer(
    recording: Recording,
    line: Timeline,
    signal: Signal,
    reference: str | None,
    before: list[Measured],
    config: Conditioning,
    into: Array,
) -> tuple[Measured, list[Note]]:
    """Put the magnetometer at its right time, and find the field in the world.

    `carried` fills ``into``.
    """
    signal, late, notes = timed(line, signal, config)
    signal, sensors, told = calibrated(line, signal, before, config)
    notes += told
    body = carried(line, signal, np.array([[1.0, 0.0, 0.0]]), config, into)
    model = None if reference == "north" else magnetic.field(recording)
    dip = _dip_of_log(body, before, recording.world)
    known, told = _direction(recording, dip, model, reference)
    measured = replace(
        body,
        inertial=known[np.newaxis],
        field=None if model is None else model[0],
        sensors=replace(sensors, mag_latency_s=late),
    )
    return measured, notes + told


def timed(line: Timeline, signal: Signal, config: Conditioning) -> tuple[Signal, float, list[Note]]:
    """Put the magnetometer at its right time; return also how late it was, s."""
    late = config.magnetometer.latency_s
    if late is None:
        late = latency.find(line.t, line.D, signal.t, signal.y)
    if late <= 0.0:
        return signal, 0.0, []
    text = f"magnetometer {1e3 * late:.0f} ms late against the gyroscope: put right"
    return Signal(signal.t - round(late * SECOND), signal.y, signal.source), late, [Note(text)]


def calibrated(
    line: Timeline, signal: Signal, before: list[Measured], config: Conditioning
) -> tuple[Signal, Sensors, list[Note]]:
    """Take hard and soft iron off, as given or as far as the log tells them."""
    wanted = config.magnetometer.calibrate
    if isinstance(wanted, Iron):
        told = iron.Iron(np.array(wanted.hard_iron) / calibration.MICRO, np.array(wanted.soft_iron))
        note = calibration.given(iron.field(line, signal, vertical(before)), told)
        sensors = Sensors(hard_iron=told.hard, soft_iron=told.soft, iron="given")
        return replace(signal, y=told.off(signal.y)), sensors, [note]
    if wanted == "off":
        return signal, Sensors(), []
    field = iron.field(line, signal, vertical(before))
    verdict = calibration.judge(field)
    if wanted == "large" and not calibration.large(field, verdict):
        return signal, Sensors(), []
    notes = [calibration.note(verdict)]
    if isinstance(verdict, str):
        return signal, Sensors(), notes
    hard = np.where(np.isfinite(verdict.deviation), verdict.iron.hard, np.nan)
    sensors = Sensors(hard_iron=hard, soft_iron=verdict.iron.soft, iron="found")
    if verdict.against:
        return signal, sensors, notes
    return (
        replace(signal, y=verdict.iron.off(signal.y)),
        replace(sensors, iron="applied"),
        notes,
    )


def vertical(before: list[Measured]) -> Measured | None:
    """Return what is measured along the vertical on the timeline."""
    for vector in before:
        if len(vector.inertial) == 1 and abs(vector.inertial[0, 2]) > VERTICAL:
            return vector
    return None


def _direction(
    recording: Recording,
    dip: float | None,
    model: tuple[Array, list[Note]] | None,
    reference: str | None,
) -> tuple[Array, list[Note]]:
    """Return the field's direction in the world, shape (3,)."""
    if model is None:
        return _north(recording, dip, reference)
    field_w, notes = model
    modelled = magnetic.dip_of(field_w, recording.world)
    if dip is None or abs(np.rad2deg(dip - modelled)) <= magnetic.DIP_TOLERANCE_DEG:
        return unit(field_w), notes
    text = (
        f"the field's dip in the log is {np.rad2deg(dip):+.1f}°, the model's "
        f"{np.rad2deg(modelled):+.1f}°: the log's is used, and its heading is doubtful"
    )
    return magnetic.with_dip(field_w, dip, recording.world), [*notes, Note(text, doubt=True)]


def _north(
    recording: Recording, dip: float | None, reference: str | None
) -> tuple[Array, list[Note]]:
    """Return magnetic north: east of the world's by the declination, where the log tells it."""
    declination = None if reference == "north" else recording.declination
    if reference == "magnetic" and declination is None:
        raise ReadError(
            f"{recording.path}: no position, which 'magnetic' needs. "
            "Use 'reference: north' for 'mag'."
        )
    if dip is None:
        told = "dip taken as 0, since no vertical tells it"
    else:
        told = f"dip {np.rad2deg(dip):+.1f}° as in the log"
    north = "magnetic north"
    if declination is not None:
        north += f", {np.rad2deg(declination):+.1f}° east of true north by the log's COMPASS_DEC"
    doubt = dip is None or (reference is None and declination is None)
    note = Note(f"magnetic reference: {north}, {told}", doubt=doubt)
    return magnetic.north(dip or 0.0, recording.world, declination or 0.0), [note]


def _dip_of_log(mag: Measured, before: list[Measured], world: World) -> float | None:
    """Return the field's dip against the vertical, where a vector is known to be (nearly) that."""
    up = -1.0 if world == "ned" else 1.0
    for vector in before:
        vertical = up * vector.inertial[:, 2] > VERTICAL  # (n,), or (1,) where constant
        dip = magnetic.dip_of_log(vector.body, mag.body, mag.valid & vector.valid & vertical)
        if dip is not None:
            return dip
    return None
