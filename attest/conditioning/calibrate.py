"""What a log tells of its sensors' own errors, as a document and as configuration."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from attest.conditioning import attitudes, calibration, gyroscope, iron
from attest.conditioning.accelerometer import accelerometer
from attest.conditioning.calibration import MICRO, Verdict
from attest.conditioning.magnetometer import timed, vertical
from attest.conditioning.measured import usable
from attest.conditioning.rows import times_since, together
from attest.conditioning.timeline import Timeline, apart, restarts, substeps_of
from attest.conditioning.timeline import gyroscope as cut_gyroscope
from attest.config import (
    Accelerometer,
    Conditioning,
    Configuration,
    Gyroscope,
    PointsConfiguration,
    effective,
    validate,
)
from attest.errors import ConfigError
from attest.recording import Recording

Array = NDArray[np.float64]
C = TypeVar("C", bound=Configuration)


def calibrate(recording: Recording, config: Configuration) -> dict[str, Any]:
    """Return what is told of each sensor, and the keys of `conditioning` that say it.

    Each sensor has ``told``, a sentence, and where the log tells it numbers with their deviations;
    ``warnings`` are what is doubtful about the log.
    What is configured as known before is left aside: all is found anew.

    Raises
    ------
    ReadError
        The log has no gyroscope, or too little of it.
    ConfigError
        The observer takes feature points, and none of these sensors.
    """
    if isinstance(config, PointsConfiguration):
        raise ConfigError(
            f"{config.observer}: takes feature points, and no sensor that a log tells of. Choose "
            "another observer."
        )
    how = _afresh(config.conditioning)
    gyro, cut = cut_gyroscope(recording, config)
    restart, gaps = restarts(recording, gyro.t, how, gyro.y)
    substeps, slow = substeps_of(gyro.t, restart, how.max_step_s)
    told = [*recording.notes, *cut, *gaps, *slow]
    at, bias, deviation, over = together(*gyroscope.shapes(len(gyro.t)))
    into = (at, bias, deviation, over)
    rates, _ = gyroscope.rates(recording, gyro, restart, substeps, how, into)
    h = times_since(gyro.t, restart)
    rest = gyroscope.resting(recording, gyro, restart, h)
    why = gyroscope.unfit(recording, gyro, h, how.max_step_s)
    found = {
        "gyroscope": _gyroscope(rates.known, how, why or "for want of turns"),
        "accelerometer": _accelerometer(None if rest is None else attitudes.find(rest[0], rest[2])),
    }
    recording, line = apart(recording, replace(gyro, y=rates.at), rates.mean, restart)
    found["magnetometer"] = _magnetometer(recording, line, how)
    keys = {name: each["configuration"] for name, each in found.items() if "configuration" in each}
    doubts = [{"text": note.text, "count": note.count} for note in told if note.doubt]
    return {"sensors": found, "configuration": {"conditioning": keys}, "warnings": doubts}


def calibrated(config: C, found: Mapping[str, Any]) -> C:
    """Return a configuration with the keys that `calibrate` found, and all else as it is."""
    document = effective(config)
    for name, keys in found["configuration"]["conditioning"].items():
        document["conditioning"][name] |= keys
    return validate(type(config), document, config.observer)


def _afresh(config: Conditioning) -> Conditioning:
    """Return the conditioning without what it is told of errors."""
    unknown, given = Gyroscope(), config.gyroscope
    gyro = given.model_copy(
        update={
            "correct": True,
            "bias": unknown.bias,
            "scale": unknown.scale,
            # small ones are of the bias and scale that are left aside
            "bias_std": max(unknown.bias_std, given.bias_std),
            "scale_std": max(unknown.scale_std, given.scale_std),
        }
    )
    mag = config.magnetometer.model_copy(update={"calibrate": "auto"})
    update = {"gyroscope": gyro, "accelerometer": Accelerometer(), "magnetometer": mag}
    return config.model_copy(update=update)


def _gyroscope(known: Array | None, config: Conditioning, why: str) -> dict[str, Any]:
    if known is None:
        return {"told": "not told: the log has no accelerometer that tells rest or gravity"}
    x, std = known
    prior = config.gyroscope
    bias, scale = x[:3], x[3:].reshape(3, 3)
    keys: dict[str, Any] = {}
    told = []
    if (std[:3] < gyroscope.KNOWN * prior.bias_std).all():
        keys |= {"bias": _plain(bias, 6), "bias_std": _most(std[:3])}
        told.append(f"bias {_spell(np.rad2deg(bias), np.rad2deg(std[:3]), 2)} °/s at the end")
    else:
        told.append(f"bias not told, for want of rest, and {why}")
    sure = (std[3:] < gyroscope.KNOWN * prior.scale_std).reshape(3, 3)
    if sure.diagonal().all():
        # an entry that this log hardly tells would be noise in another
        scale = np.where(sure, scale, 0.0)
        keys |= {"scale": _plain(scale, 6), "scale_std": _most(std[3:])}
        diagonal = 100.0 * np.diag(scale), 100.0 * np.diag(std[3:].reshape(3, 3))
        told.append(
            f"scale {_spell(*diagonal, 2)} %, misalignment up to {_aside(scale):.2f} %, "
            f"{sure.sum()} of 9 known and the others zero"
        )
    else:
        told.append(f"scale and misalignment not told, {why}")
    deviations = {"bias_std": _plain(std[:3], 6), "scale_std": _plain(std[3:].reshape(3, 3), 6)}
    return {"told": "; ".join(told), **deviations} | ({"configuration": keys} if keys else {})


def _accelerometer(fit: attitudes.Fit | str | None) -> dict[str, Any]:
    if fit is None:
        return {"told": "not told: the log has none, or too little of it"}
    if isinstance(fit, str):
        return {"told": fit}
    told = (
        f"bias {_spell(fit.bias, fit.bias_std, 3)} m/s²; scale "
        f"{_spell(fit.scale, fit.scale_std, 4)}, from rests in {fit.rests} attitudes, against "
        "standard gravity"
    )
    keys = {"bias": _plain(fit.bias, 5), "scale": _plain(fit.scale, 6)}
    deviations = {"bias_std": _plain(fit.bias_std, 5), "scale_std": _plain(fit.scale_std, 6)}
    return {"told": told, **deviations, "configuration": keys}


def _magnetometer(recording: Recording, line: Timeline, config: Conditioning) -> dict[str, Any]:
    if "mag" not in recording.signals:
        return {"told": "not told: the log has none"}
    signal, _ = usable(recording.signals["mag"])
    if not len(signal.t):
        return {"told": "not told: it has no sample with a direction"}
    signal, _, told = timed(line, signal, config)
    before = []
    if "accel" in recording.signals and len(usable(recording.signals["accel"])[0].t):
        force, _ = usable(recording.signals["accel"])
        into = np.empty((len(line.t), 3))
        before = [accelerometer(recording, line, force, None, config, into)[0]]
    verdict = calibration.judge(iron.field(line, signal, vertical(before)))
    text = "; ".join(note.text for note in [*told, calibration.note(verdict)])
    document = {"told": text.replace("magnetometer: ", "").replace("magnetometer ", "")}
    return document if isinstance(verdict, str) else document | _iron(verdict)


def _iron(verdict: Verdict) -> dict[str, Any]:
    keys = {
        "hard_iron": _plain(MICRO * verdict.iron.hard, 3),
        "soft_iron": _plain(verdict.iron.soft, 5),
    }
    figures = {
        **keys,
        "hard_iron_std": _plain(MICRO * verdict.deviation, 3),
        "left_of_misfit": _plain(verdict.left, 3),
        "heading_deg": round(float(np.rad2deg(verdict.heading)), 3),
        "applied": not verdict.against,
    }
    return figures if verdict.against else figures | {"configuration": {"calibrate": keys}}


def _plain(values: Array, digits: int) -> Any:
    return (np.round(values, digits) + 0.0).tolist()  # without a negative zero


def _most(deviations: Array) -> float:
    """Return the largest deviation: there is one key for all."""
    return round(float(deviations.max()), 6)


def _spell(values: Array, deviations: Array, digits: int) -> str:
    pairs = zip(np.round(values, digits) + 0.0, deviations, strict=True)
    return ", ".join(f"{value:+.{digits}f} ± {std:.{digits}f}" for value, std in pairs)


def _aside(scale: Array) -> float:
    """Return the largest entry outside the diagonal, %."""
    return 100.0 * float(np.abs(scale - np.diag(np.diag(scale))).max())
