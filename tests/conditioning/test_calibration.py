"""A magnetometer's hard and soft iron, found where the log tells it and left alone where not."""

from dataclasses import replace

import numpy as np
import pytest
from flights import FIELD, angle_deg, at, flight, recording, tumbling
from numpy.testing import assert_allclose

from attest import config
from attest.conditioning import calibration, condition
from attest.conditioning.calibration import Verdict
from attest.conditioning.iron import Iron
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.observers import fts
from attest.recording import Signal

HARD = np.array([6e-6, -3e-6, 4e-6])
SOFT = np.array([[1.04, 0.02, -0.01], [0.02, 0.97, 0.015], [-0.01, 0.015, 0.99]])
LONG = 160.0


def tossing(seconds):
    """Attitude that turns about all axes, as far as a hand turns a sensor."""
    roll = 2.5 * np.sin(0.35 * seconds) + 0.3 * np.sin(2.3 * seconds)
    pitch = 1.2 * np.sin(0.27 * seconds + 1.0)
    yaw = 3.0 * np.sin(0.11 * seconds) + 0.6 * np.sin(1.1 * seconds + 0.4)
    return quaternion.from_euler(roll, pitch, yaw)


def turntable(seconds):
    """Attitude that turns about the vertical only."""
    zero = np.zeros_like(seconds)
    return quaternion.from_euler(zero, zero, 0.4 * seconds + np.sin(0.5 * seconds))


def irons(m, hard=HARD, soft=SOFT):
    """Return what a magnetometer with iron reads of a field."""
    return m @ np.linalg.inv(soft).T + hard


def worn(log, change=irons, noise=0.0):
    """Return the log with a magnetometer that is changed, given values, and seconds where asked."""
    mag = log.signals["mag"]
    y = change(mag.y) + noise * np.random.default_rng(1).normal(size=mag.y.shape)
    return replace(log, signals=log.signals | {"mag": Signal(mag.t, y, mag.source)})


def settings(calibrate):
    """Return the observer's configuration."""
    magnetometer = config.Magnetometer(calibrate=calibrate)
    return fts.Config(conditioning=config.Conditioning(magnetometer=magnetometer))


def note(log, calibrate="auto"):
    """Return what conditioning says of the calibration."""
    _, notes = condition(log, settings(calibrate))
    (told,) = [n for n in notes if "used as it is" in n.text or "hard iron" in n.text]
    return told


def error_deg(log, calibrate, skip=2000):
    """Return the RMS error of the attitude."""
    wanted = settings(calibrate)
    q = fts.estimate(condition(log, wanted)[0], wanted).q
    heading = 0.5 * np.arctan2(FIELD[1], FIELD[0])
    turn = np.array([np.cos(heading), 0.0, 0.0, -np.sin(heading)])
    truth = quaternion.multiply(turn, log.references["TRUTH"].q)
    return np.sqrt(np.mean(angle_deg(q, truth)[skip:] ** 2))


def verdict(log, monkeypatch):
    """Return the verdict that conditioning comes to."""
    seen = []
    judge = calibration.judge
    monkeypatch.setattr(calibration, "judge", lambda field: seen.append(judge(field)) or seen[-1])
    condition(log, settings("auto"))
    return seen[0]


@pytest.mark.parametrize("noise", [0.0, 0.3e-6])
def test_hard_and_soft_iron_are_recovered(monkeypatch, noise):
    found = verdict(worn(flight(tossing, duration=LONG), noise=noise), monkeypatch)
    assert isinstance(found, Verdict)
    assert found.against == ""
    scale = 3.0 / np.trace(SOFT)  # which the field's own strength would tell
    assert_allclose(found.iron.soft, SOFT * scale, atol=2e-3 + 3e3 * noise)
    assert_allclose(found.iron.hard, HARD, atol=0.1e-6 + 0.5 * noise)


def test_the_heading_is_right_by_it():
    log = worn(flight(tossing, duration=LONG), noise=0.3e-6)
    assert error_deg(log, "off") > 2.0
    assert error_deg(log, "auto") < 0.5


def test_it_is_found_for_a_late_magnetometer():
    log = worn(flight(tossing, duration=LONG, late=0.1))
    assert "late against the gyroscope" in "".join(n.text for n in condition(log, fts.Config())[1])
    assert note(log).text.startswith("magnetometer: hard iron +6.0, -3.0, +4.0 µT and soft iron")


def test_turns_about_the_vertical_tell_what_matters_to_them(monkeypatch):
    log = worn(flight(turntable, duration=LONG), lambda y: y + HARD)
    found = verdict(log, monkeypatch)
    assert found.against == ""
    assert_allclose(found.iron.hard, [*HARD[:2], 0.0], atol=0.2e-6)
    assert_allclose(found.iron.soft, np.eye(3))
    assert np.isinf(found.deviation[2])
    assert error_deg(log, "auto") < 1.0


def test_rest_tells_nothing():
    def resting(seconds):
        return quaternion.from_euler(*(np.full(np.shape(seconds), a) for a in (0.1, -0.2, 0.7)))

    told = note(worn(flight(resting, duration=LONG), noise=0.3e-6))
    assert told.text == "magnetometer used as it is: the log's motion does not tell it"
    assert not told.doubt


def test_a_short_log_tells_nothing():
    assert note(worn(flight(duration=30.0))).text == (
        "magnetometer used as it is: the log has too little of it: 8 x 8 s are needed"
    )


def test_a_clean_magnetometer_is_left_alone():
    log = worn(flight(tossing, duration=LONG), lambda y: y, noise=0.3e-6)
    assert note(log).text.endswith("it would change the heading by 0.0° only")


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_magnet_for_a_part_of_the_log_is_not_taken_off(share):
    log = flight(tossing, duration=LONG)
    on = at(log.signals["mag"].t)[:, np.newaxis] > (1.0 - share) * LONG
    log = worn(log, lambda y: y + np.where(on, [0.0, 0.0, 12e-6], 0.0), noise=0.3e-6)
    assert "used as it is" in note(log).text


def test_a_disturbed_place_does_not_spoil_it(monkeypatch):
    log = flight(tossing, duration=LONG)
    near = np.abs(at(log.signals["mag"].t) - 70.0)[:, np.newaxis] < 8.0
    log = worn(log, lambda y: irons(y + np.where(near, [15e-6, 0.0, -10e-6], 0.0)))
    found = verdict(log, monkeypatch)
    assert_allclose(found.iron.hard, HARD, atol=0.7e-6)


def test_iron_that_matters_little_is_left_alone():
    log = worn(flight(tossing, duration=LONG), lambda y: y + 0.02 * HARD)
    assert note(log).text == (
        "magnetometer used as it is: hard iron +0.1, -0.1, +0.1 µT found, but it would change the "
        "heading by 0.2° only"
    )


def test_a_given_calibration_is_taken_off():
    log = worn(flight(tossing, duration=LONG))
    right = config.Iron(hard_iron=(6.0, -3.0, 4.0), soft_iron=tuple(map(tuple, SOFT.tolist())))
    told = note(log, right)
    assert told.text.startswith(
        "magnetometer: hard iron +6.0, -3.0, +4.0 µT and soft iron up to 4.0 % taken off as "
        "configured, misfit -"
    )
    assert not told.doubt
    assert error_deg(log, right) < 1.0


def test_a_wrong_calibration_is_doubted_and_never_tilts():
    log = flight(tossing, duration=LONG)
    wrong = config.Iron(hard_iron=(15.0, -10.0, 30.0))
    told = note(log, wrong)
    assert told.doubt
    assert told.text.endswith("worse than without it")
    samples, _ = condition(log, settings(wrong))
    up = quaternion.to_matrix(fts.estimate(samples, settings(wrong)).q)[:, 2]
    true = quaternion.to_matrix(log.references["TRUTH"].q)[:, 2]
    assert np.rad2deg(np.arccos(np.clip(np.sum(up * true, axis=1), -1.0, 1.0)))[2000:].max() < 1.0


def test_a_log_of_stretches_is_judged_by_each():
    log = worn(flight(tossing, duration=LONG))
    halves = {
        name: Signal(s.t + (at(s.t) > 80.0) * 60_000_000_000, s.y, s.source)
        for name, s in log.signals.items()
    }
    told = note(recording(halves))
    assert told.text.startswith("magnetometer: hard iron +6.0, -3.0, +4.0 µT")


@pytest.mark.parametrize("scale", [1e-12, 1e6])
def test_fields_of_any_size_are_survived(scale):
    log = worn(flight(tumbling, duration=LONG), lambda y: y / np.abs(y).max() * scale * 0.9)
    condition(log, settings("auto"))


def test_off_is_off_as_yaml_reads_it():
    given = {"observer": "fts", "conditioning": {"magnetometer": {"calibrate": False}}}
    checked = config.validate(fts.Config, given, "mine.yaml")
    assert checked.conditioning.magnetometer.calibrate == "off"
    _, notes = condition(worn(flight(tossing, duration=LONG)), checked)
    assert not [n for n in notes if "iron" in n.text or "used as it is" in n.text]


def test_a_soft_iron_that_mirrors_is_refused():
    soft = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
    given = {
        "observer": "fts",
        "conditioning": {"magnetometer": {"calibrate": {"soft_iron": soft}}},
    }
    with pytest.raises(ConfigError) as error:
        config.validate(fts.Config, given, "mine.yaml")
    assert "it mirrors or flattens what is measured" in str(error.value)


def test_a_given_calibration_comes_from_yaml():
    soft = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.9]]
    given = {"hard_iron": [1, 2, 3], "soft_iron": soft}
    document = {"observer": "fts", "conditioning": {"magnetometer": {"calibrate": given}}}
    checked = config.validate(fts.Config, document, "mine.yaml").conditioning.magnetometer
    assert checked.calibrate.hard_iron == (1.0, 2.0, 3.0)
    assert checked.calibrate.soft_iron[2][2] == 0.9


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            "maybe",
            "'conditioning.magnetometer.calibrate' is \"maybe\". It must be: 'auto', 'large', "
            "'off' or False or an object.",
        ),
        (
            {"hard_iron": [1, 2]},
            "'conditioning.magnetometer.calibrate.hard_iron.2' is missing. Add it.",
        ),
        (
            {"hard": [1, 2, 3]},
            "unknown key 'conditioning.magnetometer.calibrate.hard'. Did you mean 'hard_iron'? "
            "Known: hard_iron, soft_iron.",
        ),
    ],
)
def test_what_is_no_calibration_is_refused(given, message):
    document = {"observer": "fts", "conditioning": {"magnetometer": {"calibrate": given}}}
    with pytest.raises(ConfigError) as error:
        config.validate(fts.Config, document, "mine.yaml")
    assert str(error.value) == f"mine.yaml: {message}"


def test_iron_is_taken_off():
    m = np.array([[1.0, 2.0, 3.0]])
    assert_allclose(Iron(HARD, SOFT).off(irons(m)), m)
