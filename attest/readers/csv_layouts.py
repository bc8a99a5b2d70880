"""Layouts of CSV that are known by their header: of loggers, data sets and trajectories."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from attest.config import Csv
from attest.errors import ReadError
from attest.readers import csv_head, csv_plan
from attest.readers.csv_plan import Plan
from attest.recording import Note, World


@dataclass(frozen=True, slots=True)
class Known:
    """A layout, and what is known of those who write it."""

    name: str
    csv: Csv
    world: World
    fits: Callable[[bytes], bool]
    """Whether the first bytes of a file are of this layout."""
    reference: str = "ref"
    """Name of its reference."""
    remark: str = ""
    """What a reader of the result must know."""


def _xyz(pattern: str) -> list[str]:
    return [pattern.format(axis) for axis in ("x", "y", "z")]


def _heads(*wanted: str) -> Callable[[bytes], bool]:
    """Whether the header, which may be a comment, has these columns."""

    def fits(head: bytes) -> bool:
        line = csv_head.lines(head)
        texts = (line.told, line.first)
        return any(set(wanted) <= set(csv_head.fields(text, wanted)[0]) for text in texts)

    return fits


def _is_tum(head: bytes) -> bool:
    """Whether the first row is a time, a place and a unit quaternion, and blanks between them."""
    try:
        row = [float(cell) for cell in csv_head.lines(head).first.split()]
    except ValueError:
        return False
    return len(row) == 8 and abs(sum(x * x for x in row[4:]) - 1.0) < 1e-2


def _stamp(head: bytes) -> str:
    """Return the name of EuRoC's first column, which has been written in several ways."""
    line = csv_head.lines(head)
    return csv_head.cells(line.told, ",")[0]


def _euroc(*wanted: str) -> Callable[[bytes], bool]:
    def fits(head: bytes) -> bool:
        return _heads(*wanted)(head) and _stamp(head).startswith("timestamp")

    return fits


_GYRO, _ACCEL = _xyz("w_RS_S_{} [rad s^-1]"), _xyz("a_RS_S_{} [m s^-2]")
_EUROC_Q = ["q_RS_w []", *_xyz("q_RS_{} []")]
_EUROC: dict[str, object] = {"time": {"column": 1, "unit": "ns"}}
_XIO_GYRO = [f"Gyroscope {a} (deg/s)" for a in "XYZ"]
_XIO: dict[str, object] = {
    "time": {"column": "Time (s)", "unit": "s"},
    "gyro": {"columns": _XIO_GYRO, "unit": "deg/s"},
    "accel": {"columns": [f"Accelerometer {a} (g)" for a in "XYZ"], "unit": "g"},
}
_XIO_MAG = {"columns": [f"Magnetometer {a} (uT)" for a in "XYZ"], "unit": "uT"}
_REPOIMU = {
    "skip": 2,
    "header": False,
    "time": {"column": 1, "unit": "s"},
    "reference": {"columns": [2, 3, 4, 5]},
    "accel": {"columns": [6, 7, 8], "unit": "m/s2"},
    "gyro": {"columns": [9, 10, 11], "unit": "rad/s"},
    "mag": {"columns": [12, 13, 14], "unit": "gauss"},
}


def _csv(keys: Mapping[str, object]) -> Csv:
    return Csv.model_validate(keys)


LOGS = (
    Known(
        "EuRoC",
        _csv(_EUROC | {"gyro": {"columns": _GYRO}, "accel": {"columns": _ACCEL}}),
        "enu",
        _euroc(*_GYRO, *_ACCEL),
    ),
    Known("x-io", _csv(_XIO | {"mag": _XIO_MAG}), "enu",
          _heads(*_XIO_GYRO, "Magnetometer X (uT)")),
    Known("x-io", _csv(_XIO), "enu", _heads(*_XIO_GYRO)),
    Known(
        "RepoIMU",
        _csv(_REPOIMU),
        "enu",
        _heads("Vicon Orientation", "IMU Acceleration", "IMU Gyroscope", "IMU Magnetometer"),
        reference="vicon",
        remark="magnetometer in a unit that is not told: 1 taken as a gauss, so trust its "
        "direction alone; the axes of motion capture and sensor are not aligned",
    ),
)  # fmt: skip
"""Of files with a gyroscope."""

TRAJECTORIES = (
    Known(
        "EuRoC ground truth",
        _csv(_EUROC | {"reference": {"columns": _EUROC_Q}}),
        "enu",
        _euroc(*_EUROC_Q),
        reference="ground_truth",
    ),
    Known(
        "TUM trajectory",
        _csv({"separator": " ", "header": False, "time": {"column": 1},
              "reference": {"columns": [8, 5, 6, 7]}}),
        "enu",
        _is_tum,
        reference="trajectory",
    ),
)  # fmt: skip
"""Of files that are a reference alone."""

_BESIDE = ("state_groundtruth_estimate0", "mocap0")
"""Folders of the truth beside EuRoC's ``imu0``; the second is TUM-VI's."""


def of_log(head: bytes) -> Known | None:
    """Return the layout of a log that begins so, if it is known."""
    return next((known for known in LOGS if known.fits(head)), None)


def of_trajectory(path: Path) -> Known | None:
    """Return the layout of a file that is a reference alone, if it is known."""
    try:
        with path.open("rb") as file:
            head = file.read(csv_head.BLOCK)
    except (OSError, ValueError):
        return None
    return next((known for known in TRAJECTORIES if known.fits(head)), None)


def plan(path: Path, known: Known) -> Plan:
    """Plan for a file of a known layout."""
    made = csv_plan.mapped(path, known.csv, f"as {known.name} gives it", known.reference)
    return replace(made, unused=())  # of a known layout, nothing is left out by mistake


def notes(known: Known, world: World) -> list[Note]:
    """Tell what was taken for granted."""
    told = [Note(f"layout of {known.name}, columns and units as it has them")]
    if world == known.world:
        told.append(Note(f"world axes not declared: those of {known.name}, z up"))
    return told + ([Note(known.remark)] if known.remark else [])


def truth_beside(path: Path) -> Path | None:
    """Return EuRoC's ground truth of a sensor's file, if it is where the data set has it."""
    for folder in _BESIDE:
        beside = path.parent.parent / folder / path.name
        if beside != path and beside.is_file() and of_trajectory(beside) is not None:
            return beside
    return None


def no_log(path: Path) -> ReadError:
    """Return what to say of a trajectory that is given for a log."""
    return ReadError(f"{path}: a trajectory and no log. Name it by --reference, behind a log.")
