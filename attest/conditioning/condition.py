"""The stages of conditioning, in order."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import frame, latency, magnetic, specific_force
from attest.config import Conditioning, Configuration, Vector
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.recording import Note, Recording, Signal, World, seconds
from attest.samples import Samples

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

GRAVITY = 9.80665
"""Standard gravity, m/s²; only its direction matters to the observers."""
SECOND = 1_000_000_000
MOST_SUBSTEPS = 100
"""In one step, so that work grows with the log's size and not with the time it spans."""
SHORTEST, LONGEST = 1e-12, 1e6
"""Lengths between which a vector is one, in m/s² or tesla or any other unit."""
VERTICAL = 0.99
"""Cosine from which a known vector is taken as straight up, 8°: in a turn, a - g is not."""
FASTEST = 1e3
"""rad/s; no gyroscope measures a tenth of this."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """The gyroscope's stamps, its values there, and the frame that it integrates."""

    t: Stamps
    gyro: Array
    D: Array


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One vector on the timeline: in the body, in the world, and where it may be used."""

    body: Array
    inertial: Array
    """Shape (n, 3), or (1, 3) where constant."""
    valid: NDArray[np.bool_]


def condition(recording: Recording, config: Configuration) -> tuple[Samples, tuple[Note, ...]]:
    """Put everything on the gyroscope's stamps.

    Raises
    ------
    ReadError
        The log has no gyroscope, or too little of it, or not the vector that is asked for.
    ConfigError
        A vector's reference does not suit its signal.
    """
    line, notes = _timeline(recording, config)
    restart, gaps = _restarts(recording, line, config.conditioning)
    substeps, slow = _substeps(line.t, restart, config.conditioning.max_step_s)
    notes += gaps + slow
    names: list[str] = []
    vectors: list[Measured] = []
    for vector in _vectors(recording, config):
        measured, told = _measure(recording, line, vector, vectors, config.conditioning)
        names.append(vector.signal)
        vectors.append(measured)
        notes += told
    if not vectors:
        text = "no direction is measured: the attitude is the gyroscope's integral from its start"
        notes.append(Note(text, doubt=True))
    samples = Samples(
        t=line.t,
        gyro=line.gyro,
        body=_stack([vector.body for vector in vectors], len(line.t)),
        inertial=_stack([vector.inertial for vector in vectors], 1),
        valid=_valid(vectors, len(line.t)),
        names=tuple(names),
        substeps=substeps,
        restart=restart,
    )
    return samples, tuple(notes)


def _timeline(recording: Recording, config: Configuration) -> tuple[Timeline, list[Note]]:
    """Cut the gyroscope to the time that is asked for, and leave out what it cannot measure."""
    gyro = recording.require("gyro")
    at = seconds(gyro.t, int(gyro.t[0]))
    wanted = at >= (config.input.start_s or 0.0)
    if config.input.end_s is not None:
        wanted &= at <= config.input.end_s
    if wanted.sum() < 2:
        raise ReadError(
            f"{recording.path}: {wanted.sum()} gyroscope samples between start and end; two are "
            f"needed. The log has {len(at)} over {at[-1]:.1f} s."
        )
    sane = wanted & (np.abs(gyro.y).max(axis=1) < FASTEST)
    wild = int(wanted.sum() - sane.sum())
    if sane.sum() < 2:
        raise ReadError(
            f"{recording.path}: the gyroscope reads over {FASTEST:g} rad/s. Check its unit."
        )
    text = f"gyroscope sample of over {FASTEST:g} rad/s left out"
    notes = [Note(text, wild, doubt=True)] if wild else []
    t, y = gyro.t[sane], gyro.y[sane]
    return Timeline(t, y, frame.integrate(t, y)), notes


def _restarts(
    recording: Recording, line: Timeline, config: Conditioning
) -> tuple[NDArray[np.bool_], list[Note]]:
    """Mark the first step, and those after a reboot or a gap that is too long to bridge."""
    gaps = np.diff(line.t) > config.restart_gap_s * SECOND
    reboots = np.isin(
        np.arange(len(line.t)), np.searchsorted(line.t, np.array(recording.restarts, np.int64))
    )
    restart = reboots | np.concatenate([[True], gaps])
    notes = []
    if gaps.any():
        text = f"gap of over {config.restart_gap_s:g} s: the observer starts anew after it"
        notes.append(Note(text, int(gaps.sum()), doubt=True))
    period = np.median(np.diff(line.t))
    bridged = (np.diff(line.t) > 5 * period) & ~restart[1:]
    if bridged.any():
        longest = np.diff(line.t)[bridged].max() * 1e-9
        text = f"gap in the gyroscope bridged by interpolation, the longest {longest:.2f} s"
        notes.append(Note(text, int(bridged.sum())))
    return restart, notes


def _substeps(
    t: Stamps, restart: NDArray[np.bool_], max_step: float
) -> tuple[NDArray[np.int64], list[Note]]:
    """Divide each step so that no part is longer than the gains allow."""
    h = np.diff(t, append=t[-1])
    substeps = np.clip(-(-h // max(1, round(max_step * SECOND))), 1, MOST_SUBSTEPS)
    substeps[:-1][restart[1:]] = 1  # nothing is stepped across a restart
    rate = 1e9 / np.median(h[:-1])
    if (substeps > 1).mean() < 0.5:
        return substeps, []
    text = (
        f"gyroscope at {rate:.1f} Hz, interpolated to steps of at most {max_step * 1e3:g} ms: "
        "motion faster than that is not in the log"
    )
    return substeps, [Note(text, doubt=bool(rate < 20.0))]


def _vectors(recording: Recording, config: Configuration) -> tuple[Vector, ...]:
    """Return the vectors asked for, or those of the two usual ones that the log has."""
    if config.vectors is not None:
        return config.vectors
    usual = (name for name in ("accel", "mag") if name in recording.signals)
    return tuple(
        Vector(signal=name) for name in usual if len(_usable(recording.signals[name])[0].t)
    )


def _measure(
    recording: Recording,
    line: Timeline,
    vector: Vector,
    before: list[Measured],
    config: Conditioning,
) -> tuple[Measured, list[Note]]:
    """Bring one vector to the timeline and find what it is in the world."""
    signal, notes = _usable(recording.require(vector.signal))
    if not len(signal.t):
        raise ReadError(
            f"{recording.path}: {vector.signal!r} has no sample with a direction. "
            "Name the other 'vectors' only."
        )
    reference = vector.reference
    if isinstance(reference, tuple):
        known = np.array([reference])
        measured = _carried(line, signal, known, config)
    elif vector.signal == "accel" and reference in {None, "gravity", "specific_force"}:
        measured, told = _accelerometer(recording, line, signal, reference, config)
        notes += told
    elif vector.signal == "mag" and reference in {None, "magnetic", "north"}:
        measured, told = _magnetometer(recording, line, signal, reference, before, config)
        notes += told
    else:
        raise ConfigError(
            f"vectors: {vector.signal!r} cannot have the reference {reference or 'null'!r}. "
            "Give it a constant [x, y, z] in the world."
        )
    stale = len(line.t) - int(measured.valid.sum())
    if stale:
        text = f"step without a sample of {vector.signal!r} within {config.max_age_s:g} s"
        notes.append(Note(text, stale, doubt=stale > 0.1 * len(line.t)))
    return measured, notes


def _usable(signal: Signal) -> tuple[Signal, list[Note]]:
    """Leave out vectors that have no direction: of no length, or of none that is real."""
    length = np.abs(signal.y).max(axis=1)
    some = np.flatnonzero((length > SHORTEST) & (length < LONGEST))
    if len(some) == len(signal.t):
        return signal, []
    left_out = Note(f"{signal.source} vector of no real length left out", len(signal.t) - len(some))
    return Signal(signal.t[some], signal.y[some], signal.source), [left_out]


def _carried(line: Timeline, signal: Signal, known: Array, config: Conditioning) -> Measured:
    """Carry a signal by the gyroscope to the timeline."""
    max_age = min(config.max_age_s, config.restart_gap_s / 2.0)  # never across a restart
    body, valid, _ = frame.carry(line.t, line.D, signal.t, signal.y, round(max_age * SECOND))
    return Measured(_unit(body), _unit(known), valid)


def _accelerometer(
    recording: Recording,
    line: Timeline,
    signal: Signal,
    reference: str | None,
    config: Conditioning,
) -> tuple[Measured, list[Note]]:
    """Use a - g where the log's velocity gives a, gravity elsewhere."""
    down = 1.0 if recording.world == "ned" else -1.0
    g = np.array([0.0, 0.0, down * GRAVITY])
    plain = _carried(line, signal, -g[np.newaxis], config)
    if reference == "gravity":
        return plain, [Note("accelerometer's reference: gravity, as asked")]
    if "velocity" not in recording.signals:
        if reference == "specific_force":
            raise ReadError(
                f"{recording.path}: no velocity, which 'specific_force' needs. "
                "Use 'reference: gravity' for 'accel'."
            )
        return plain, [Note("accelerometer's reference: gravity (the log has no velocity)")]
    smoothed, inertial, notes = _specific_force(recording, line, signal, g, config)
    expected, seen = np.linalg.norm(inertial, axis=1), np.linalg.norm(smoothed, axis=1)
    if reference is None and not specific_force.explains(expected, seen, GRAVITY):
        text = (
            "accelerometer's reference: gravity (the log's velocity does not fit the accelerometer)"
        )
        return plain, [Note(text, doubt=True)]
    # NaN where there is too little to smooth; near free fall there is no direction
    with np.errstate(invalid="ignore"):
        moving = np.minimum(expected, seen) > 0.1 * GRAVITY
    still = len(line.t) - int(moving.sum())
    if still:
        text = "step without velocity nearby: the accelerometer's reference is gravity there"
        notes.append(Note(text, still))
    body = np.where(moving[:, np.newaxis], _unit(smoothed), plain.body)
    known = np.where(moving[:, np.newaxis], _unit(inertial), plain.inertial)
    return Measured(body, known, plain.valid), notes


def _specific_force(
    recording: Recording, line: Timeline, signal: Signal, g: Array, config: Conditioning
) -> tuple[Array, Array, list[Note]]:
    """Return smoothed specific force in the body, a - g in the world, and what was done."""
    settings, velocity = config.specific_force, recording.signals["velocity"]
    fixed = quaternion.rotate(frame.at(line.t, line.D, signal.t), signal.y)
    level, _ = specific_force.smooth(line.t, signal.t, fixed, settings.smoothing_s)
    lag = settings.lag_s
    if lag is None:
        _, a = specific_force.smooth(line.t, velocity.t, velocity.y, settings.smoothing_s)
        lag = specific_force.find_lag(
            seconds(line.t, int(line.t[0])),
            np.linalg.norm(a - g, axis=1),
            np.linalg.norm(level, axis=1),
        )
    told = "its lag could not be told and is taken as 0" if lag is None else f"{lag:+.2f} s late"
    shifted = line.t + round((lag or 0.0) * SECOND)
    _, a = specific_force.smooth(shifted, velocity.t, velocity.y, settings.smoothing_s)
    note = Note(f"accelerometer's reference: a - g from {velocity.source} velocity, {told}")
    return quaternion.rotate(quaternion.conjugate(line.D), level), a - g, [note]


def _magnetometer(
    recording: Recording,
    line: Timeline,
    signal: Signal,
    reference: str | None,
    before: list[Measured],
    config: Conditioning,
) -> tuple[Measured, list[Note]]:
    """Put the magnetometer at its right time, and find the field in the world."""
    late, notes = config.magnetometer.latency_s, []
    if late is None:
        late = latency.find(line.t, line.D, signal.t, signal.y)
    if late > 0.0:
        notes.append(Note(f"magnetometer {late:.2f} s late against the gyroscope: put right"))
        signal = Signal(signal.t - round(late * SECOND), signal.y, signal.source)
    body = _carried(line, signal, np.array([[1.0, 0.0, 0.0]]), config)
    known, told = _field(recording, body, before, reference)
    return Measured(body.body, known[np.newaxis], body.valid), notes + told


def _field(
    recording: Recording, mag: Measured, before: list[Measured], reference: str | None
) -> tuple[Array, list[Note]]:
    """Return the field's direction in the world, shape (3,)."""
    dip = _dip_of_log(mag, before, recording.world)
    model = None if reference == "north" else magnetic.field(recording)
    if model is None:
        if reference == "magnetic":
            raise ReadError(
                f"{recording.path}: no position, which 'magnetic' needs. "
                "Use 'reference: north' for 'mag'."
            )
        if dip is None:
            told = "dip taken as 0, since no vertical tells it"
        else:
            told = f"dip {np.rad2deg(dip):+.1f}° as in the log"
        doubt = reference is None or dip is None
        note = Note(f"magnetic reference: magnetic north, {told}", doubt=doubt)
        return magnetic.north(dip or 0.0, recording.world), [note]
    field_w, notes = model
    modelled = magnetic.dip_of(field_w, recording.world)
    if dip is None or abs(np.rad2deg(dip - modelled)) <= magnetic.DIP_TOLERANCE_DEG:
        return _unit(field_w), notes
    text = (
        f"the field's dip in the log is {np.rad2deg(dip):+.1f}°, the model's "
        f"{np.rad2deg(modelled):+.1f}°: the log's is used, and its heading is doubtful"
    )
    return magnetic.with_dip(field_w, dip, recording.world), [*notes, Note(text, doubt=True)]


def _dip_of_log(mag: Measured, before: list[Measured], world: World) -> float | None:
    """Return the field's dip against the vertical, where a vector is known to be (nearly) that."""
    up = -1.0 if world == "ned" else 1.0
    for vector in before:
        vertical = np.broadcast_to(up * vector.inertial[:, 2] > VERTICAL, mag.valid.shape)
        both = mag.valid & vector.valid & vertical
        if both.any():
            return magnetic.dip_of_log(vector.body[both], mag.body[both])
    return None


def _unit(v: Array) -> Array:
    """Scale to unit length; zero stays zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    unit: Array = v / np.where(length > 0.0, length, 1.0)
    return unit


def _stack(vectors: list[Array], rows: int) -> Array:
    """Join vectors (n, 3) or (1, 3) to (n, k, 3), constant ones repeated where others move."""
    rows = max([rows, *map(len, vectors)])
    if not vectors:
        return np.empty((rows, 0, 3))
    return np.stack([np.broadcast_to(v, (rows, 3)) for v in vectors], axis=1)


def _valid(vectors: list[Measured], n: int) -> NDArray[np.bool_]:
    return np.stack([v.valid for v in vectors], axis=1) if vectors else np.empty((n, 0), np.bool_)
