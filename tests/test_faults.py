"""What goes wrong with sensors in flight: the attitude stays sane, or a warning says so plainly.

Each fault is put into a simulated flight of known truth, and goes through the whole pipeline. The
hand-held unit has no velocity and no place: its heading is from magnetic north, 3.6° off.
"""

import re
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from attest import pipeline, simulation
from attest.errors import ConfigError
from attest.recording import Signal

BIAS_X = np.array([0.0873, 0.0, 0.0])
"""5 °/s, rad/s."""
NUMBER = r"[+-]?\d+(\.\d+)?"
STUCK = "the magnetometer stands still for # s while the gyroscope turns: it is stuck"
UNSURE = "heading is uncertain by over 10° in #% of the log, by up to #°: the field hardly tells it"
TURNED = (
    "the field turns against the gyroscope, by up to #° from one 5 s to the next, first at # s: "
    "disturbed, stuck or late; heading is doubtful since"
)
UNLIKE = "magnetometer sample unlike the field before it, believed the less"
OFF = (
    "magnetic field: dip #° in the whole log, and in #% of the log so far off that it counts for "
    "less than half: heading is doubtful"
)
AXES = (
    "the magnetometer's axes are not those of gyroscope and reference: the magnetometer's would "
    "fit as (-x, y, -z), or the opposite (that explains #% of the turns; as read, #%): "
    "--set 'input.axes.mag=[x,-y,z]'"
)
ALONE = "'accel' is the only direction: the turn about it is not observable, and drifts"
WORSE = (
    "magnetometer: hard iron #, #, # µT taken off as configured, misfit # % against the "
    "gyroscope, # % in strength{}: worse than without it"
)
CUT = "the accelerometer is cut off, {}: what lies beyond its range is lost"
BIAS = (
    "gyroscope: bias #, #, # °/s at the end (at rest #% of the log), scale and misalignment up to "
    "# %, taken off as they became known"
)
BIAS_ALONE = (
    "gyroscope: bias #, #, # °/s at the end (at rest #% of the log), taken off as they became known"
)
BIAS_OF_ALL = (
    "gyroscope: bias #, #, # °/s at the end, scale and misalignment up to # %, found in the whole "
    "log and taken off"
)


TURNED_AIDED = TURNED + ", and tilt where it accelerates"


def changed(flight, name, change):
    """Return a flight with a signal's values, (j, 3), changed, given seconds (j, 1) too."""
    signal = flight.signals[name]
    y = change(signal.y.copy(), (signal.t - signal.t[0])[:, np.newaxis] * 1e-9)
    return replace(flight, signals={**flight.signals, name: Signal(signal.t, y, signal.source)})


def strength(flight):
    return float(np.median(np.linalg.norm(flight.signals["mag"].y, axis=1)))


def elsewhere(flight):
    """Let the field of the body change half-way, by half of the world's."""
    by = strength(flight) * np.array([0.4, -0.3, 0.2])
    return changed(flight, "mag", lambda y, s: y + (s > s[-1] / 2.0) * by)


def late(flight):
    mag = flight.signals["mag"]
    signal = Signal(mag.t + 10 * 10**9, mag.y, mag.source)
    return replace(flight, signals={**flight.signals, "mag": signal})


def absent(flight):
    return replace(flight, signals={n: s for n, s in flight.signals.items() if n != "mag"})


FAULTS = {
    "none": lambda flight: flight,
    "wrong iron": lambda flight: flight,
    "wrong sign": partial(changed, name="mag", change=lambda y, _: y * [1.0, -1.0, 1.0]),
    "elsewhere": elsewhere,
    "stuck": partial(changed, name="mag", change=lambda y, _: y * 0.0 + y[:1]),
    "absent": absent,
    "late": late,
    "clipping": partial(changed, name="accel", change=lambda y, _: np.clip(y, -9.0, 9.0)),
    "bias x": partial(changed, name="gyro", change=lambda y, _: y + BIAS_X),
    "bias z": partial(changed, name="gyro", change=lambda y, _: y + BIAS_X[::-1]),
}


@dataclass(frozen=True)
class Case:
    """A fault, the largest errors that it may make, and what must be said of it."""

    scenario: str
    fault: str
    observer: str
    total: float
    """Degrees; 180 where nothing is promised."""
    tilt: float
    told: tuple[str, ...] = ()


def hand(fault, observer, total, tilt, *told):
    return Case("handheld", fault, observer, total, tilt, told)


def copter(fault, observer, total, tilt, *told):
    return Case("quadcopter", fault, observer, total, tilt, told)


WORSE_IN_DIP = WORSE.format(", # % in dip")
CUT_HAND = CUT.format("x at # m/s², x at # m/s², y at # m/s², z at # m/s²")
CUT_COPTER = CUT.format("z at # m/s²")
UNFIT = "accelerometer's reference: gravity (the log's velocity does not fit the accelerometer)"

CASES = [
    hand("none", "fts", 7.0, 2.5),
    hand("none", "smoother", 7.0, 2.5),
    hand("wrong iron", "fts", 25.0, 2.5, WORSE_IN_DIP, UNLIKE, TURNED),
    hand("wrong iron", "smoother", 7.0, 2.5, WORSE_IN_DIP),
    hand("wrong sign", "fts", 180.0, 2.5, AXES, UNLIKE, TURNED),
    hand("wrong sign", "smoother", 180.0, 2.5, AXES, OFF, TURNED),
    hand("elsewhere", "fts", 50.0, 2.5, UNLIKE, TURNED),
    hand("elsewhere", "smoother", 8.0, 2.5, OFF, TURNED),
    hand("stuck", "fts", 180.0, 2.5, STUCK, UNLIKE, TURNED),
    hand("stuck", "smoother", 180.0, 2.5, STUCK, UNSURE),
    hand("absent", "fts", 50.0, 2.5, ALONE),
    hand("absent", "smoother", 50.0, 2.5, ALONE),
    hand("late", "fts", 15.0, 3.0, UNLIKE, TURNED),
    hand("late", "smoother", 8.0, 2.5, OFF, TURNED),
    hand("clipping", "fts", 10.0, 6.0, CUT_HAND),
    hand("clipping", "smoother", 10.0, 4.5, CUT_HAND),
    hand("bias x", "fts", 8.0, 6.0, BIAS),
    hand("bias x", "smoother", 7.0, 2.5, BIAS_OF_ALL),
    hand("bias z", "fts", 8.0, 2.5, BIAS),
    hand("bias z", "smoother", 7.0, 2.5, BIAS_OF_ALL),
    copter("none", "fts", 5.0, 2.5),
    copter("none", "smoother", 2.0, 1.5),
    copter("wrong iron", "fts", 30.0, 10.0, WORSE.format(""), UNLIKE),
    copter("wrong iron", "smoother", 2.0, 1.5, WORSE.format("")),
    copter("wrong sign", "fts", 180.0, 180.0, AXES, TURNED_AIDED),
    copter("wrong sign", "smoother", 3.0, 1.5, AXES, OFF, TURNED_AIDED),
    copter("elsewhere", "fts", 16.0, 9.0, UNLIKE, TURNED_AIDED),
    copter("elsewhere", "smoother", 2.0, 1.5, OFF, TURNED_AIDED),
    copter("stuck", "fts", 180.0, 180.0, STUCK, TURNED_AIDED),
    copter("stuck", "smoother", 2.0, 1.5, STUCK),
    copter("absent", "fts", 40.0, 18.0, ALONE),
    copter("absent", "smoother", 2.0, 1.5, ALONE),
    copter("late", "fts", 180.0, 180.0, TURNED_AIDED),
    copter("late", "smoother", 2.0, 1.5, OFF, TURNED_AIDED),
    copter("clipping", "fts", 20.0, 20.0, CUT_COPTER, UNFIT),
    copter("clipping", "smoother", 7.0, 4.0, CUT_COPTER, UNFIT),
    copter("bias x", "fts", 12.0, 5.0, BIAS_ALONE),
    copter("bias x", "smoother", 2.0, 1.5, BIAS_OF_ALL),
    copter("bias z", "fts", 8.0, 2.5, BIAS_ALONE),
    copter("bias z", "smoother", 2.0, 1.5, BIAS_OF_ALL),
]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return a function that writes a scenario with a fault, once, and returns log and options."""
    folder, flights, logs = tmp_path_factory.mktemp("faults"), {}, {}

    def log(scenario, fault):
        if scenario not in flights:
            flights[scenario] = simulation.simulate(scenario)
        if (scenario, fault) not in logs:
            path = folder / f"{scenario}_{fault.replace(' ', '_')}.csv"
            simulation.write(path, FAULTS[fault](flights[scenario]))
            hard = np.array([0.12, 0.128, -0.096]) * strength(flights[scenario]) * 1e6
            given = f"conditioning.magnetometer.calibrate={{hard_iron: {hard.round(2).tolist()}}}"
            logs[scenario, fault] = path, [given] if fault == "wrong iron" else []
        return logs[scenario, fault]

    return log


def matches(pattern, text):
    """Tell whether a text is word by word a pattern, whose # are any numbers."""
    return re.fullmatch(re.escape(pattern).replace(r"\#", NUMBER), text) is not None


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.scenario}-{c.fault}-{c.observer}")
def test_the_attitude_is_sane_or_a_warning_says_that_it_is_not(flown, case):
    log, options = flown(case.scenario, case.fault)
    found = pipeline.run(log, pipeline.configure(case.observer, options))
    error = found.metrics.error_deg
    assert np.nanmax(error[:, 0]) < case.total
    assert np.nanmax(error[:, 2]) < case.tilt
    warnings = [note["text"] for note in found.summary["warnings"]]
    for pattern in case.told:
        assert any(matches(pattern, text) for text in warnings), (pattern, warnings)
    if case.fault == "none":
        assert all(text.startswith("magnetic reference: ") for text in warnings)


def test_nothing_is_promised_only_of_what_is_warned_of():
    assert all(case.told for case in CASES if case.total == 180.0 or case.tilt == 180.0)


def test_a_calibration_that_mirrors_an_axis_is_refused():
    mirrored = "{soft_iron: [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}"
    with pytest.raises(ConfigError, match="it mirrors or flattens what is measured, or nearly so"):
        pipeline.configure("fts", [f"conditioning.magnetometer.calibrate={mirrored}"])
