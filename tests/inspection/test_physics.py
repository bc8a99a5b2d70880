"""One thing wrong at a time in simulated logs: each is named, and nothing else is."""

from dataclasses import replace

import advised
import numpy as np
import pytest
from flights import FIELD, flight, gyro, recording, resting, seen, stamps, tumbling

from attest import inspection
from attest.geometry import quaternion
from attest.inspection import axes
from attest.readers import sensors
from attest.readers.options import ReadOptions
from attest.recording import Note, Reference, Signal

DEGREES = 180.0 / np.pi
G = 9.80665
MIRRORED = np.diag([1.0, 1.0, -1.0])
FLU = np.diag([1.0, -1.0, -1.0])
SWAPPED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
CYCLED = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def turned(log, name, matrix):
    """Return a log with a signal's values multiplied by a matrix."""
    signal = log.signals[name]
    whole = matrix * np.eye(3) if np.isscalar(matrix) else matrix
    values = Signal(signal.t, signal.y @ whole.T, signal.source)
    return replace(log, signals={**log.signals, name: values})


def referred(log, change):
    """Return a log with its references' quaternions changed."""
    changed = {
        name: Reference(name, r.kind, r.t, quaternion.continuous(change(r.q)))
        for name, r in log.references.items()
    }
    return replace(log, references=changed)


def in_enu(log):
    """Return a log whose values are those of forward-left-up and east-north-up."""
    for name in ("gyro", "accel", "mag"):
        log = turned(log, name, FLU)
    if "velocity" in log.signals:
        log = turned(log, "velocity", ENU)
    world = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
    body = np.array([0.0, 1.0, 0.0, 0.0])
    return referred(log, lambda q: quaternion.multiply(quaternion.multiply(world, q), body))


def without(log, *names):
    """Return a log without some signals, and without references."""
    signals = {name: s for name, s in log.signals.items() if name not in names}
    return replace(log, signals=signals, references={})


def told(log):
    notes = inspection.doubts(log)
    assert all(note.doubt for note in notes)
    return [note.text for note in notes]


def test_nothing_is_said_of_what_is_right(log):
    assert told(log) == []
    assert told(without(log)) == []
    assert told(without(log, "mag")) == []
    assert told(without(log, "accel", "position")) == []
    declared = replace(in_enu(log), world="enu", body="flu")
    assert told(declared) == []


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [
        ("gyro", DEGREES, "deg/s: --set input.csv.gyro.unit=deg/s"),
        ("gyro", 1e3, "mrad/s"),
        ("gyro", 1.0 / DEGREES, "rad/s, taken for deg/s"),
        ("accel", 1.0 / G, "g: --set input.csv.accel.unit=g"),
        ("accel", 1e3 / G, "mg or cm/s²: --set input.csv.accel.unit=mg"),
        ("accel", G, "m/s², multiplied by g once more"),
        ("mag", 1e-2, "gauss: --set input.csv.mag.unit=gauss"),
        ("mag", 1e1, "mG: --set input.csv.mag.unit=mgauss"),
        ("mag", 1e3, "nT: --set input.csv.mag.unit=nT"),
        ("mag", 1e-6, "T: --set input.csv.mag.unit=T"),
    ],
)
def test_a_wrong_unit_is_named_with_the_option_that_mends_it(log, name, factor, unit):
    for wrong in (turned(log, name, factor), turned(without(log), name, factor)):
        (text,) = told(wrong)
        assert text.endswith(f": its unit seems to be {unit}")


@pytest.mark.parametrize(
    ("name", "taken", "factor", "unit"),
    [
        ("gyro", "deg/s", 1.0 / DEGREES, "rad/s, taken for deg/s: --set input.csv.gyro.unit=rad/s"),
        ("accel", "g", G, "m/s²: --set input.csv.accel.unit=m/s2"),
        ("accel", "g", 1e3, "mg or cm/s²: --set input.csv.accel.unit=mg"),
        ("mag", "gauss", 1e2, "µT: --set input.csv.mag.unit=uT"),
        ("mag", "mgauss", 1e-3, "gauss: --set input.csv.mag.unit=gauss"),
    ],
)
def test_a_wrong_unit_is_told_by_the_one_that_it_was_taken_in(log, name, taken, factor, unit):
    wrong = replace(turned(log, name, factor), details={"units": {name: taken}})
    (text,) = told(wrong)
    assert text.endswith(f": its unit seems to be {unit}")


def test_no_setting_is_named_where_there_is_none(log):
    (text,) = told(replace(turned(log, "accel", 1e3), format="tlog"))
    assert text.endswith("its unit seems to be mm/s²")


@pytest.mark.parametrize(
    ("name", "factor", "unit"), [("gyro", DEGREES, "deg/s"), ("accel", 1.0 / G, "g")]
)
def test_a_wrong_unit_of_other_formats_is_named_with_their_option(log, name, factor, unit):
    wrong = replace(turned(log, name, factor), format="mcap", details={})
    (text,) = told(wrong)
    assert text.endswith(f": its unit seems to be {unit}: --set input.unit.{name}={unit}")
    mended = sensors.as_told(wrong, ReadOptions(units={name: unit}))
    assert told(mended) == []
    right = replace(log, format="mcap", details={})
    (text,) = told(sensors.as_told(right, ReadOptions(units={name: unit})))
    assert text.endswith(f": --set input.unit.{name}={'rad/s' if name == 'gyro' else 'm/s2'}")


def test_degrees_are_told_without_any_vector_by_what_no_vehicle_survives(log):
    wrong = without(turned(log, "gyro", 1e3), "mag", "accel")
    (text,) = told(wrong)
    assert text.endswith(
        ": its unit cannot be rad/s, but deg/s or mrad/s: --set input.csv.gyro.unit=deg/s"
    )
    (text,) = told(replace(wrong, details={"units": {"gyro": "deg/s"}}))
    assert text.endswith("rad/s: its unit or scale is wrong")


@pytest.mark.parametrize(
    ("matrix", "what"),
    [
        (-1.0, "the gyroscope turns the wrong way about all axes"),
        (MIRRORED, "the gyroscope's axes are wrong: they would fit as (x, y, -z)"),
        (SWAPPED, "the gyroscope's axes are wrong: they would fit as (y, x, z)"),
        (CYCLED, "the gyroscope's axes are wrong: they would fit as (z, x, y)"),
        (FLU, "the gyroscope's axes are wrong: they would fit as (x, -y, -z)"),
    ],
)
def test_wrong_axes_of_the_gyroscope_are_named(log, matrix, what):
    wrong = turned(log, "gyro", matrix)
    (text,) = told(wrong)
    assert text.startswith(what)
    assert told(advised.mended(wrong, text)) == []


@pytest.mark.parametrize(
    ("matrix", "fit"),
    [
        (FLU, "(x, -y, -z)"),
        (SWAPPED, "(-y, -x, -z)"),
        (CYCLED, "(z, x, y)"),
        (MIRRORED, "(-x, -y, z)"),
    ],
)
def test_wrong_axes_of_the_magnetometer_are_named(log, matrix, fit):
    (text,) = told(turned(log, "mag", matrix))
    assert text.startswith("the magnetometer's axes are not those of gyroscope and reference")
    assert f"would fit as {fit}, or the opposite" in text
    assert told(advised.mended(turned(log, "mag", matrix), text)) == []
    # without a third that tells who is right, neither is blamed
    (text,) = told(turned(without(log, "accel"), "mag", matrix))
    assert text.startswith("the gyroscope's and the magnetometer's axes are not the same")


@pytest.mark.parametrize(
    ("matrix", "fit"),
    [
        (SWAPPED, "(-y, -x, -z)"),
        (CYCLED, "(z, x, y)"),
        (MIRRORED, "(-x, -y, z)"),
        (np.diag([-1.0, 1.0, 1.0]), "(x, -y, -z)"),
    ],
)
def test_wrong_axes_of_an_accelerometer_that_is_moved_about_are_told(log, matrix, fit):
    (text,) = told(turned(log, "accel", matrix))
    assert text.startswith("the accelerometer's axes are not those of gyroscope and magnetometer")
    if "velocity" in log.signals:  # with the reference; an aircraft feels nothing along y
        assert fit in text or "fixed-wing" in str(log.path)
        assert not any("axes are" in text for text in told(turned(without(log), "accel", matrix)))
        return
    assert f": the accelerometer's would fit as {fit}, or the opposite: --set '" in text
    assert told(advised.mended(turned(log, "accel", matrix), text)) == []
    # a hand's accelerations average out, so that the gyroscope alone tells
    (text,) = told(turned(without(log, "mag"), "accel", matrix))
    assert text.startswith("the gyroscope's and the accelerometer's axes are not the same")
    (text,) = told(turned(without(log, "mag"), "gyro", matrix))
    if np.linalg.det(matrix) < 0.0:
        assert text.startswith("the gyroscope's axes are wrong: they would fit as ")


def test_an_inverted_magnetometer_is_told_by_its_dip(log):
    texts = told(turned(log, "mag", -1.0))
    if "position" in log.signals:  # or nothing tells
        (text,) = texts
        assert text.endswith(
            "the magnetometer or the accelerometer is inverted: --set 'input.axes.mag=[-x,-y,-z]'"
        )


@pytest.mark.parametrize("matrix", [-1.0, FLU])
def test_up_that_is_down_is_told(log, matrix):
    (text, *_) = told(turned(log, "accel", matrix))
    axes = "axes are not those of gyroscope and magnetometer"
    assert text.startswith(f"the accelerometer's {'up is 1' if np.isscalar(matrix) else axes}")
    if np.isscalar(matrix):
        assert told(advised.mended(turned(log, "accel", matrix), text)) == []
    texts = told(replace(turned(without(log, "mag"), "accel", matrix), format="tlog"))
    if "velocity" not in log.signals:  # a hand turns all ways: its turns tell, or nothing does
        assert all("axes are not the same" in text for text in texts)
    else:
        assert texts == [
            "accel_z is up: the sensor is upside down, inverted, or of other axes: "
            "--set 'input.axes.accel=[-x,-y,-z]' if it alone is inverted"
        ]


def test_an_inverted_accelerometer_is_told_from_another_world_by_where_the_field_points(log):
    wrong = without(log, "position")
    wrong = turned(replace(wrong, references=log.references), "accel", -1.0)
    (text,) = told(wrong)
    assert text.endswith(
        "one is inverted (the accelerometer: --set 'input.axes.accel=[-x,-y,-z]'), or of another "
        "world, as north-west-up"
    )
    assert told(advised.mended(wrong, text)) == []
    declared = replace(in_enu(wrong), world="enu", body="flu")
    (text,) = told(declared)
    assert text.endswith("or of another world, as west-north-down")
    assert told(advised.mended(declared, text)) == []


def test_axes_are_told_beyond_those_that_are_told_already(log):
    wrong = advised.mended(turned(log, "gyro", SWAPPED), "--set 'input.axes.gyro=[z,x,y]'")
    (text,) = told(wrong)
    assert text.endswith(": --set 'input.axes.gyro=[y,x,z]'")


def test_a_log_of_another_world_is_told_with_the_option_that_mends_it(log):
    for text in told(in_enu(log)):
        assert text.endswith("try --world enu")
    declared = replace(in_enu(log), world="enu", body="flu")
    assert told(in_enu(log))
    assert told(declared) == []
    (first, *_) = told(replace(log, world="enu", body="flu"))
    assert first.endswith("try --world ned")


def test_velocity_of_another_world_is_told(log):
    if "velocity" not in log.signals:
        pytest.skip("a hand has no velocity")
    (text,) = told(turned(log, "velocity", ENU))
    assert text == "velocity and position fit as enu and not as ned: try --world enu"


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (quaternion.conjugate, "world to body"),
        (lambda q: np.roll(q, -1, axis=1), "in the order (x, y, z, w)"),
        (
            lambda q: quaternion.multiply(q, np.array([0.0, 1.0, 0.0, 0.0])),
            "of a body with other axes",
        ),
    ],
)
def test_a_reference_of_another_form_is_named(log, change, what):
    (text, *_) = told(referred(log, change))
    assert "does not turn as the gyroscope does" in text
    assert what in text


def test_field_far_from_the_model_is_not_calibrated():
    log = turned(flight(), "mag", 1.8)
    (text,) = told(log)
    assert text.endswith("not calibrated, or disturbed")


def test_what_a_reader_has_told_is_not_told_again():
    weak = turned(flight(), "mag", 1e-9)
    assert len(told(weak)) == 1
    said = Note("in words of its own", about="field strength")
    assert told(replace(weak, notes=(said,))) == []
    below = turned(without(flight(resting), "mag"), "accel", -1.0)
    assert [text[:13] for text in told(below)] == ["accel_z is up"]
    assert told(replace(below, notes=(replace(said, about="up"),))) == []


def test_gravity_that_is_a_little_off_is_a_scale():
    (text,) = told(turned(flight(), "accel", 1.15))
    assert text.endswith("its scale or bias is wrong")


def test_rest_leaves_axes_open():
    log = flight(resting)
    assert told(turned(log, "gyro", DEGREES)) == []
    assert told(turned(log, "mag", SWAPPED)) == []


def test_noise_leaves_axes_open():
    log, rng = flight(), np.random.default_rng(1)
    for name in ("gyro", "accel", "mag"):
        noise = rng.normal(size=log.signals[name].y.shape) * np.abs(log.signals[name].y).max()
        mixed = Signal(log.signals[name].t, log.signals[name].y + 3.0 * noise, name)
        log = replace(log, signals={**log.signals, name: mixed})
    texts = [text for text in told(without(log)) if "too slow for the motion" not in text]
    assert not any("axes" in text or "turn" in text for text in texts)


@pytest.mark.parametrize("value", [0.0, 1e200, -1e308])
def test_absurd_values_break_nothing(value):
    log = flight(duration=5.0)
    for name in ("gyro", "accel", "mag"):
        signal = log.signals[name]
        filled = Signal(signal.t, np.full_like(signal.y, value), name)
        inspection.doubts(replace(log, signals={**log.signals, name: filled}))
    signals = {name: Signal(s.t[:1], s.y[:1]) for name, s in log.signals.items()}
    assert inspection.doubts(replace(log, signals=signals)) == ()


@pytest.mark.parametrize(("rate", "duration"), [(50.0, 60.0), (1000.0, 30.0), (200.0, 300.0)])
def test_turns_are_told_alike_at_any_rate_and_length(rate, duration):
    t = stamps(rate, duration)
    signals = {
        "gyro": gyro(tumbling, t, bias=(0.05, -0.1, 0.02)),
        "accel": seen(tumbling, t, [0.0, 0.0, -G]),
        "mag": seen(tumbling, stamps(20.0, duration), FIELD),
    }
    log = recording(signals)
    for fit in axes.fits(log).values():
        assert fit.as_read > 0.99
        assert fit.scale == pytest.approx(1.0, abs=0.01)
    for fit in axes.fits(turned(log, "gyro", -2.0 * CYCLED)).values():
        assert fit.best > 0.99
        assert fit.scale == pytest.approx(0.5, abs=0.01)
        np.testing.assert_array_equal(fit.axes, -CYCLED.T)
