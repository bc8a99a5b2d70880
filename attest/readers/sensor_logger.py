"""Sensor Logger, an app of phones: a folder of CSVs, each sensor in its own.

Time in nanoseconds since 1970, columns by name. Gyroscope in rad/s, acceleration in m/s², magnetic
field in µT, orientation from the phone to east-north-up. An iPhone gives accelerations with the
opposite sign, and its orientation to north-west-up, unless the app's units and frames were made
standard; ``Metadata.csv`` tells.
"""

import csv
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from attest.config import Csv
from attest.errors import AttestError, ConfigError, ReadError
from attest.geometry import quaternion
from attest.readers import csv_head, csv_plan, csv_signals
from attest.readers.csv import UNIX
from attest.readers.csv_signals import Taken
from attest.readers.options import ReadOptions
from attest.recording import Clock, Note, Recording, Reference, Signal

_Keys = dict[str, dict[str, object]]

GYROSCOPE = "Gyroscope.csv"
_HEADER = {"time", "seconds_elapsed", "x", "y", "z"}
_TIME: dict[str, object] = {"column": "time", "unit": "ns"}
_XYZ: dict[str, object] = {"columns": ["x", "y", "z"]}
_FILES: dict[str, _Keys] = {
    GYROSCOPE: {"gyro": _XYZ},
    "TotalAcceleration.csv": {"accel": _XYZ},
    "Accelerometer.csv": {"accel": _XYZ},
    "Gravity.csv": {"accel": _XYZ},
    "Magnetometer.csv": {"mag": _XYZ},
    "Location.csv": {"position": {"columns": ["latitude", "longitude", "altitude"]}},
    "Orientation.csv": {
        "reference": {"columns": ["qw", "qx", "qy", "qz"], "kind": "autopilot"},
    },
}
_ACCELERATIONS = ("TotalAcceleration.csv", "Accelerometer.csv", "Gravity.csv")
_LINE = 1 << 16
"""Longest line of the metadata that is looked at."""
_WEST = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Turns north-west-up into east-north-up."""


def recognises(head: bytes, path: Path) -> bool:  # noqa: ARG001 - a folder has no first bytes
    """Whether it is a folder of this app."""
    return is_folder(path)


def is_folder(path: Path) -> bool:
    """Whether a folder holds a gyroscope's file with the columns of this app."""
    try:
        with (path / GYROSCOPE).open("rb") as file:
            line = csv_head.lines(file.read(1000)).first
    except OSError:
        return False
    return set(csv_head.cells(line, ",")) >= _HEADER


def read(path: Path, options: ReadOptions) -> Recording:
    """Read the files of one folder.

    Raises
    ------
    ReadError
        The gyroscope's file has no row that can be used.
    """
    notes = [Note("layout of Sensor Logger, columns and units as it has them")]
    units = options.csv.units() if options.csv is not None else {}
    if units:
        notes.append(Note(f"units as input.csv says: {csv_plan.listed(units)}"))
    taken = {name: _take(path / name, _in(units, keys), notes) for name, keys in _FILES.items()}
    signals = {key: replace(signal, source=name) for name, one in taken.items()
               for key, signal in one.signals.items() if name not in _ACCELERATIONS}  # fmt: skip
    signals |= _acceleration(taken, notes)
    for key in units.keys() - signals.keys() - {"time"}:
        raise ConfigError(f"{path}: no {key} for input.csv.{key}.unit. Leave it out.")
    if "gyro" not in signals:
        raise ReadError(f"{path / GYROSCOPE}: no row that can be used. Record the log again.")
    references = taken["Orientation.csv"].references
    if _is_apple(path):
        signals, references = _as_android(signals, references, notes)
    start = min(int(signal.t[0]) for signal in signals.values())
    return Recording(
        path=path,
        format="sensor_logger",
        signals=signals,
        references=references,
        clock=Clock("phone's time", 0 if start > UNIX else None),
        world="enu",
        body="flu",
        notes=tuple(notes),
        details={"units": {"time": "ns", "gyro": "rad/s", "accel": "m/s2", "mag": "uT"} | units},
    )


def _in(units: Mapping[str, str], keys: _Keys) -> _Keys:
    """Return the columns of a file, in the units that are told for them."""
    columns = {"time": _TIME, **keys}
    told = {key: {**columns[key], "unit": unit} for key, unit in units.items() if key in columns}
    return columns | told


def _acceleration(taken: dict[str, Taken], notes: list[Note]) -> dict[str, Signal]:
    """Return the specific force: as it is, or made of motion and gravity."""
    total, motion, gravity = (taken[name].signals.get("accel") for name in _ACCELERATIONS)
    if total is not None:
        return {"accel": replace(total, source=_ACCELERATIONS[0])}
    if motion is None:
        return {}
    if gravity is None:
        notes.append(Note("Accelerometer.csv is without gravity, and Gravity.csv is missing: left "
                          "out", doubt=True))  # fmt: skip
        return {}
    inside = (motion.t >= gravity.t[0]) & (motion.t <= gravity.t[-1])
    if not inside.any():
        notes.append(Note("Accelerometer.csv and Gravity.csv share no time: left out", doubt=True))
        return {}
    t, origin = motion.t[inside], gravity.t[0]
    at, known = (t - origin).astype(np.float64), (gravity.t - origin).astype(np.float64)
    y = motion.y[inside] + np.stack([np.interp(at, known, g) for g in gravity.y.T], axis=1)
    notes.append(Note("accelerometer made of Accelerometer.csv and Gravity.csv"))
    if lost := int(np.sum(~inside)):
        notes.append(Note("Accelerometer.csv rows without gravity, dropped", lost))
    return {"accel": Signal(t, y, "Accelerometer.csv")}


def _is_apple(path: Path) -> bool:
    """Whether an iPhone's own signs and axes were kept."""
    try:
        with (path / "Metadata.csv").open(encoding="utf-8", errors="replace") as file:
            told = next(iter(csv.DictReader([file.readline(_LINE), file.readline(_LINE)])), {})
    except (OSError, csv.Error):
        return False
    standard = str(told.get("standardisation", "")).strip().lower()
    return str(told.get("platform", "")).strip().lower() == "ios" and standard != "true"


def _as_android(
    signals: dict[str, Signal], references: dict[str, Reference], notes: list[Note]
) -> tuple[dict[str, Signal], dict[str, Reference]]:
    """Turn signs and axes of an iPhone to those of the others."""
    notes.append(Note("an iPhone's signs and axes, as Metadata.csv says: acceleration negated, "
                      "orientation turned from north-west-up to east-north-up"))  # fmt: skip
    if "accel" in signals:
        signals = signals | {"accel": replace(signals["accel"], y=-signals["accel"].y)}
    turned = {
        name: replace(reference, q=quaternion.multiply(_WEST, reference.q))
        for name, reference in references.items()
    }
    return signals, turned


def _take(path: Path, keys: _Keys, notes: list[Note]) -> Taken:
    """Read one file of the folder, if it is there and has what it should."""
    nothing = Taken({}, {}, [], 0)
    if not path.is_file():
        return nothing
    try:
        plan = csv_plan.mapped(path, Csv.model_validate(keys),
                               "as the phone's own estimate", path.stem.lower())  # fmt: skip
        taken = csv_signals.take(path, replace(plan, unused=()))
    except AttestError as error:
        notes.append(Note(f"{path.name} left out: {str(error).removeprefix(f'{path}: ')}",
                          doubt=True))  # fmt: skip
        return nothing
    notes += [replace(note, text=f"{path.name}: {note.text}") for note in taken.notes]
    return taken
