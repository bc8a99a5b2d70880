"""What the smoother says that it did, and where it doubts itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import observing
import pytest
from flights import FIELD, G, at, flight, gyro, recording, resting, seen, stamps, tumbling
from hypothesis import given, settings

from attest import pipeline, simulation
from attest.conditioning import condition
from attest.geometry import quaternion
from attest.observers import smoother
from attest.recording import Signal

CONFIG = smoother.Config()


def noisy(log):
    """Return a log whose sensors are as noisy as real ones."""
    rng, std = np.random.default_rng(3), {"gyro": 0.003, "accel": 0.05, "mag": 3e-7}
    signals = {
        name: replace(s, y=s.y + std[name] * rng.normal(size=s.y.shape))
        for name, s in log.signals.items()
    }
    return replace(log, signals=signals)


def with_mag(log, change):
    """Return a log whose magnetometer's values, (j, 3), are changed, given seconds too."""
    mag = log.signals["mag"]
    y = change(mag.y.copy(), at(mag.t)[:, np.newaxis])
    return replace(log, signals=log.signals | {"mag": Signal(mag.t, y, mag.source)})


def notes(log):
    samples, _ = condition(log, CONFIG)
    return smoother.notes(samples, smoother.estimate(samples, CONFIG), CONFIG)


def doubts(log):
    return [note.text for note in notes(log) if note.doubt]


def test_of_a_clean_flight_it_says_what_it_did_and_doubts_nothing():
    log = noisy(flight(duration=60.0, bias=(0.02, -0.01, 0.01)))
    told = notes(log)
    rest, gyroscope, accelerometer, iron, field = (note.text for note in told)
    assert not any(note.doubt for note in told)
    assert rest == "at rest nowhere in the log, as far as is told"
    assert gyroscope.startswith("gyroscope: bias +1.1")
    assert "°/s at the end, scale and misalignment up to" in gyroscope
    assert accelerometer == "accelerometer used as it is: the whole log tells no bias or scale"
    assert iron.startswith("magnetometer")
    assert field.startswith("magnetic field: dip +63.")
    assert field.endswith("nowhere so far off that it counts for less than half")


def test_rest_is_told():
    t = stamps(100.0, 30.0)
    signals = {
        "gyro": gyro(resting, t, (0.01, -0.02, 0.005)),
        "accel": seen(resting, t, [0.0, 0.0, -G]),
        "mag": seen(resting, t, FIELD),
    }
    first, second, *_ = notes(noisy(recording(signals)))
    assert first.text == (
        "at rest 100% of the log: the velocity is zero there, and the gyroscope reads its bias"
    )
    assert "bias +0.57, -1.15, +0.29 °/s at the end" in second.text
    assert not doubts(noisy(recording(signals)))


def test_hard_iron_is_told_and_is_no_turn_of_the_field():
    iron = np.array([3e-6, -2e-6, 2.5e-6])
    log = with_mag(noisy(flight(duration=60.0)), lambda y, _: y + iron)
    share = 100.0 * iron / np.linalg.norm(FIELD)
    (told,) = [note.text for note in notes(log) if note.text.startswith("magnetometer")]
    found = [float(x) for x in told.split("hard iron ")[1].split(" %")[0].split(",")]
    assert found == pytest.approx(share, abs=2.0)
    assert not doubts(log)


def test_large_hard_iron_is_taken_off_first_and_the_document_has_all_of_it():
    iron, clean = np.array([2e-5, -1e-5, 1.5e-5]), noisy(flight(duration=120.0))
    log = with_mag(clean, lambda y, _: y + iron)
    samples, before = condition(log, CONFIG)
    assert any("hard iron +2" in note.text and "taken off" in note.text for note in before)
    found = smoother.estimate(samples, CONFIG)
    bare = smoother.estimate(condition(clean, CONFIG)[0], CONFIG)
    between = quaternion.multiply(found.q, quaternion.conjugate(bare.q))
    assert np.rad2deg(np.linalg.norm(quaternion.log(between), axis=1)).max() < 1.0
    opened = pipeline.Opened(replace(log, path=Path(__file__)), None, {})
    told = pipeline.observe(opened, CONFIG).summary["sensors"]
    assert told["iron"] == "applied"
    assert told["hard_iron_ut"] == pytest.approx(1e6 * iron, abs=0.5)


def test_a_bias_that_is_larger_than_expected_is_doubted_and_is_no_turn_of_the_field():
    (told,) = doubts(noisy(flight(duration=60.0, bias=(0.0873, 0.0, 0.0))))
    assert told.startswith("gyroscope: bias +5.0")


def test_a_field_that_turns_at_the_same_strength_and_dip_is_told():
    half = np.deg2rad(35.0)
    elsewhere = quaternion.rotate(np.array([np.cos(half), 0.0, 0.0, np.sin(half)]), FIELD)
    log = noisy(flight(duration=120.0))
    other = seen(tumbling, log.signals["mag"].t, elsewhere)
    told = doubts(with_mag(log, lambda y, s: np.where(s > 62.0, other.y, y)))
    assert any(text.startswith("the field turns against the gyroscope, by up to") for text in told)
    assert any("first at 65 s" in text for text in told)


def test_a_field_that_is_off_for_long_is_told():
    (told,) = doubts(
        with_mag(noisy(flight(duration=60.0)), lambda y, s: y + (s > 45.0) * [0.0, 0.0, 8e-6])
    )
    assert told.endswith(
        "in 25% of the log so far off that it counts for less than half: heading is doubtful"
    )


def test_a_magnetometer_that_stands_still_leaves_heading_uncertain():
    (told,) = doubts(with_mag(noisy(flight(duration=60.0)), lambda y, _: y * 0.0 + y[:1]))
    assert told.startswith("heading is uncertain by over 10° in 100% of the log, by up to 1")


def test_a_short_log_cannot_tell_tilt_which_is_no_fault_of_the_field():
    samples, _ = condition(noisy(flight(resting, duration=2.0)), CONFIG)
    found = smoother.estimate(samples, CONFIG)
    assert not [note for note in smoother.notes(samples, found, CONFIG) if note.doubt]
    assert np.rad2deg(np.sqrt(found.states["attitude_covariance"][:, 5])).max() > 10.0


@settings(deadline=None, max_examples=60)
@given(made=observing.any_samples())
def test_of_any_measurements_there_is_something_to_say(made):
    made = replace(made, names=("accel", "mag", *made.names[2:])[: len(made.names)])
    told = smoother.notes(made, smoother.estimate(made, CONFIG), CONFIG)
    assert not any("nan" in note.text for note in told)


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize(
    "name",
    [
        "dataflash/bluerov2.BIN",
        "dataflash/plane_truncated.BIN",
        "tlog/bluerov2.tlog",
        "tlog/bluerov2_bad_crc.tlog",
        "tlog/quadplane_sitl.tlog",
        "ulog/auav_x21.ulg",
        "ulog/sitl_groundtruth.ulg",
    ],
)
def test_recorded_flights_whose_attitude_is_right_are_not_doubted(shared, name):
    assert not doubts(pipeline.read(shared / name, CONFIG))


def test_sample_logs_are_not_doubted(sample_logs):
    for log in sorted(sample_logs.glob("quadcopter*")):
        if "truth" not in log.name:
            assert not doubts(pipeline.read(log, CONFIG))


def test_the_doubts_of_a_reference_are_those_of_the_run(tmp_path):
    made = simulation.simulate("handheld")
    mag = made.signals["mag"]
    late = Signal(mag.t + 10 * 10**9, mag.y, mag.source)
    simulation.write(tmp_path / "late.csv", replace(made, signals={**made.signals, "mag": late}))
    settings = ("evaluation.reference=smoother",)
    found = pipeline.run(tmp_path / "late.csv", pipeline.configure("cgo", settings))
    told = [note.text for note in found.notes if note.doubt]
    assert any(text.startswith("reference 'smoother': the field turns against") for text in told)
