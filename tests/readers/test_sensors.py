"""Units and axes that the user tells of the sensors of any log."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from attest import pipeline
from attest.errors import ConfigError
from attest.geometry import frames

CSV = "time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n"


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(CSV)
    return path


def read(path, *sets):
    return pipeline.read(path, pipeline.configure("fts", sets))


def notes(recording):
    return {note.text: note.doubt for note in recording.notes}


def test_axes_of_each_signal_are_taken_as_told(log):
    recording = read(log, "input.axes.gyro=[y,-x,z]", "input.axes.accel=[-x,y,z]")
    assert_array_equal(recording.signals["gyro"].y[0], [2, -1, 3])
    assert_array_equal(recording.signals["accel"].y[0], [-4, 5, 6])
    told = notes(recording)
    assert told["gyro along (y, -x, z) of its own axes, as input.axes says"] is False
    mirrored = "accel along (-x, y, z) of its own axes, as input.axes says, which mirrors them"
    assert told[mirrored] is False
    assert recording.details["axes"] == {"gyro": ("y", "-x", "z"), "accel": ("-x", "y", "z")}


def test_units_of_a_log_that_should_be_si_are_taken_as_told(sample_logs):
    right = read(sample_logs / "quadcopter.bag")
    sets = ["input.unit.gyro=deg/s", "input.unit.accel=mg", "input.unit.mag=gauss"]
    recording = read(sample_logs / "quadcopter.bag", *sets)
    for name, factor in (("gyro", np.pi / 180.0), ("accel", 9.80665e-3), ("mag", 1e-4)):
        assert_allclose(recording.signals[name].y, right.signals[name].y * factor, rtol=1e-12)
    assert {f"{name} as input.unit says" for name in ("gyro in deg/s,", "mag in gauss,")} <= {
        *notes(recording)
    }


def test_what_a_log_does_not_have_is_told(log):
    told = notes(read(log, "input.axes.mag=[y,x,z]", "input.unit.gyro=deg/s"))
    assert told["input.axes.mag means nothing here, the log has no mag: left out"] is True
    has = "csv has input.csv.gyro.unit, and so on"
    assert told[f"input.unit means nothing here, {has}: left out"] is True


def test_a_reader_mends_no_unit_that_is_told(sample_logs):
    recording = read(sample_logs / "quadcopter.bag", "input.unit.mag=uT")
    assert np.median(np.linalg.norm(recording.signals["mag"].y, axis=1)) < 1e-9


def test_what_is_no_turn_of_axes_is_refused():
    for axes in ("[x,x,z]", "[x,-x,y]"):
        with pytest.raises(ConfigError) as caught:
            pipeline.configure("fts", [f"input.axes.gyro={axes}"])
        assert str(caught.value).endswith(
            ": each of x, y, z is needed once, with or without a minus."
        )
    with pytest.raises(ConfigError, match=r"'input.axes.gyro.2' is \"w\". It must be: 'x', 'y'"):
        pipeline.configure("fts", ["input.axes.gyro=[x,y,w]"])


@pytest.mark.parametrize("letters", [("x", "y", "z"), ("-z", "x", "-y"), ("y", "x", "z")])
def test_axes_are_written_as_they_are_read(letters):
    P = frames.signed(letters)
    assert frames.letters(P) == letters
    assert abs(np.linalg.det(P)) == pytest.approx(1.0)
