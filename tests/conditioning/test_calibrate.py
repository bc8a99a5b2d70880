"""What ``attest calibrate`` tells of each sensor, and that ``attest run`` takes it."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from flights import SECOND, START, G, flight, gyro, recording, resting, seen, stamps, tumbling
from numpy.testing import assert_allclose

from attest import config, pipeline, simulation
from attest.cli import cli
from attest.conditioning import attitudes, calibrate, calibrated, condition
from attest.conditioning.calibrate import _gyroscope
from attest.errors import ConfigError
from attest.observers import fts
from attest.recording import Signal
from attest.report import text_of_calibration

BIAS, SCALE = np.array([0.1, -0.2, 0.15]), np.array([1.01, 0.985, 1.005])


def attitudes_at_rest(faces, noise=0.01, each=200):
    """Return a specific force at rest along each of some directions, and where it rests."""
    rng, parts = np.random.default_rng(2), []
    for face in faces:
        up = np.asarray(face, float) / np.linalg.norm(face)
        parts += [np.tile(G * up / SCALE + BIAS, (each, 1)), rng.normal(size=(20, 3))]
    force = np.concatenate(parts)
    still = np.tile(np.arange(each + 20) < each, len(faces))
    return force + noise * rng.normal(size=force.shape), still


FACES = [s * row for s in (1.0, -1.0) for row in np.eye(3)]
CORNERS = [[1, 1, 1], [-1, 1, 1], [1, -1, -1]]


def test_rests_in_several_attitudes_tell_bias_and_scale():
    fit = attitudes.find(*attitudes_at_rest([*FACES, *CORNERS]))
    assert isinstance(fit, attitudes.Fit)
    assert fit.rests == 9
    assert_allclose(fit.bias, BIAS, atol=0.005)
    assert_allclose(fit.scale, SCALE, atol=0.001)
    assert (np.abs(fit.bias - BIAS) < 4.0 * fit.bias_std).all()


@pytest.mark.parametrize(
    ("faces", "told"),
    [
        ([], "not observable: rests in 0 of 6 attitudes, well apart, that are needed"),
        (FACES[:5], "not observable: rests in 5 of 6 attitudes, well apart, that are needed"),
        ([FACES[0]] * 9, "not observable: rests in 1 of 6 attitudes, well apart, that are needed"),
        (
            [[np.cos(a), np.sin(a), 1.0] for a in np.arange(0.0, 6.0, 0.8)],
            "not observable: the 8 attitudes at rest are not spread well enough",
        ),
    ],
)
def test_too_few_rests_tell_nothing(faces, told):
    force, still = attitudes_at_rest(faces) if faces else (np.zeros((9, 3)), np.zeros(9, bool))
    assert attitudes.find(force, still) == told


def test_rests_that_are_none_tell_nothing():
    force, still = attitudes_at_rest([*FACES, *CORNERS])
    told = attitudes.find(3.0 * force, still)
    assert told == "not told: rests in 9 attitudes do not fit one bias and scale"


def test_a_log_tells_the_gyroscopes_bias():
    log = flight(resting, duration=30.0, bias=(0.01, -0.02, 0.005))
    found = calibrate(log, fts.Config())
    keys = found["configuration"]["conditioning"]
    assert_allclose(keys["gyroscope"]["bias"], [0.01, -0.02, 0.005], atol=1e-4)
    assert "scale" not in keys["gyroscope"]
    assert found["sensors"]["gyroscope"]["told"].startswith("bias +0.57 ± 0.01, -1.15 ± 0.01, ")


def test_what_is_configured_is_found_anew():
    log = flight(resting, duration=30.0, bias=(0.01, -0.02, 0.005))
    known = config.Conditioning(gyroscope=config.Gyroscope(bias=(0.5, 0.5, 0.5), correct=False))
    assert calibrate(log, fts.Config(conditioning=known)) == calibrate(log, fts.Config())


def test_a_calibration_is_found_anew_whatever_its_certainty():
    log = flight(resting, duration=30.0, bias=(0.01, -0.02, 0.005))
    before = calibrated(fts.Config(), calibrate(log, fts.Config()))
    assert before.conditioning.gyroscope.bias_std < 0.003
    assert calibrate(log, before) == calibrate(log, fts.Config())


def test_what_is_written_is_known_to_run_from_the_start():
    log = flight(resting, duration=30.0, bias=(0.01, -0.02, 0.005))
    made = calibrated(fts.Config(), calibrate(log, fts.Config()))
    samples, _ = condition(log, made)
    assert_allclose(
        samples.bias, np.broadcast_to((0.01, -0.02, 0.005), (len(samples.t), 3)), atol=1e-4
    )


def test_only_what_is_known_of_the_gyroscope_is_written():
    prior = config.Conditioning()
    std = np.concatenate([np.full(3, 0.0002), np.full(9, 0.003)])
    x = np.concatenate([np.full(3, 0.01), np.full(9, 0.002)])
    assert _gyroscope(np.array([x, std]), prior, "")["configuration"] == {
        "bias": [0.01, 0.01, 0.01],
        "bias_std": 0.0002,
    }
    std[0], std[[3, 8]] = np.deg2rad(0.25), 0.0003
    some = _gyroscope(np.array([x, std]), prior, "for want of turns")
    assert "configuration" not in some  # an axis that is not known is not taken for a true one
    assert "scale and misalignment not told, for want of turns" in some["told"]
    std[[7, 11]] = 0.0003
    found = _gyroscope(np.array([x, std]), prior, "")
    assert found["configuration"] == {
        "scale": [[0.002, 0.0, 0.0], [0.0, 0.002, 0.002], [0.0, 0.0, 0.002]],
        "scale_std": 0.003,
    }
    assert "4 of 9 known and the others zero" in found["told"]


def test_a_known_bias_is_taken_off_from_the_start():
    log = flight(bias=(0.01, -0.02, 0.005))
    for correct in (True, False):
        known = config.Gyroscope(bias=(0.01, -0.02, 0.005), bias_std=0.0, correct=correct)
        wanted = fts.Config(conditioning=config.Conditioning(gyroscope=known))
        samples, _ = condition(log, wanted)
        assert_allclose(samples.bias[0], (0.01, -0.02, 0.005), atol=1e-9)
        assert_allclose(samples.rate[0], gyro(tumbling, stamps(100.0, 1.0)).y[0], atol=1e-4)


def test_a_known_scale_is_taken_off():
    log = flight()
    S = np.array([[0.02, 0.0, 0.01], [0.0, -0.01, 0.0], [0.0, 0.005, 0.0]])
    signal = log.signals["gyro"]
    wrong = Signal(signal.t, signal.y @ np.linalg.inv(np.eye(3) - S).T, signal.source)
    known = config.Gyroscope(scale=tuple(map(tuple, S.tolist())), correct=False)
    wanted = fts.Config(conditioning=config.Conditioning(gyroscope=known))
    samples, _ = condition(replace(log, signals={**log.signals, "gyro": wrong}), wanted)
    assert_allclose(samples.rate, signal.y, atol=1e-12)


def test_a_known_accelerometer_is_put_right():
    log = flight()
    signal = log.signals["accel"]
    wrong = Signal(signal.t, signal.y / SCALE + BIAS, signal.source)
    known = config.Accelerometer(bias=tuple(BIAS.tolist()), scale=tuple(SCALE.tolist()))
    wanted = fts.Config(conditioning=config.Conditioning(accelerometer=known))
    samples, _ = condition(replace(log, signals={**log.signals, "accel": wrong}), wanted)
    right, _ = condition(log, fts.Config())
    assert_allclose(samples.body, right.body, atol=1e-9)


def test_a_log_of_a_gyroscope_alone_tells_nothing():
    log = recording({"gyro": gyro(tumbling, stamps(100.0, 10.0))})
    found = calibrate(log, fts.Config())
    assert {name: each["told"] for name, each in found["sensors"].items()} == {
        "gyroscope": "not told: the log has no accelerometer that tells rest or gravity",
        "accelerometer": "not told: the log has none, or too little of it",
        "magnetometer": "not told: the log has none",
    }
    own = fts.Config(gains=fts.Gains(k_p=0.9))
    assert calibrated(own, found) == own
    text = text_of_calibration({"log": "a.csv", **found}, own)
    nothing = "# Nothing of it is to be applied: the configuration is as it was\nobserver: fts\n"
    assert nothing in text
    assert text.endswith(config.dump(own))


def test_a_magnetometer_alone_beside_the_gyroscope_is_calibrated():
    t = stamps(100.0, 160.0)

    def tossing(seconds):
        return tumbling(2.0 * seconds)

    mag = seen(tossing, t, [20e-6, 2e-6, 40e-6])
    worn = Signal(t, mag.y + np.array([5e-6, -4e-6, 3e-6]), "MAG")
    found = calibrate(recording({"gyro": gyro(tossing, t), "mag": worn}), fts.Config())
    keys = found["configuration"]["conditioning"]["magnetometer"]["calibrate"]
    assert_allclose(keys["hard_iron"], [5.0, -4.0, 3.0], atol=0.1)


def test_the_command_writes_yaml_that_run_takes(tmp_path, sample_logs):
    log, output = str(sample_logs / "quadcopter.tlog"), tmp_path / "mine.yaml"
    done = CliRunner().invoke(cli, ["calibrate", log, "--output", str(output)])
    assert done.exit_code == 0, done.output
    assert done.stdout == output.read_text()
    assert done.stdout.startswith("# Sensors of ")
    assert "as far as it tells them\n# gyroscope: bias +1.13 ± 0.02, " in done.stdout
    gyroscope = yaml.safe_load(done.stdout)["conditioning"]["gyroscope"]
    assert_allclose(np.rad2deg(gyroscope["bias"]), [1.13, -0.87, 0.57], atol=0.005)
    assert gyroscope["bias_std"] < 0.001
    assert CliRunner().invoke(cli, ["config", "check", str(output)]).exit_code == 0


OWN = """
observer: fts
gains: {k_p: 0.9}
conditioning: {smoothing: {accel_s: 1.5}, magnetometer: {disturbance: 0.3}}
"""


@pytest.mark.parametrize("observer", [OWN, "paper/fts", "vqf", "smoother"])
def test_the_yaml_is_the_one_it_was_made_from_and_the_calibration(tmp_path, sample_logs, observer):
    own, output = tmp_path / "own.yaml", tmp_path / "mine.yaml"
    own.write_text(OWN)
    name = str(own) if observer is OWN else observer
    log, more = str(sample_logs / "quadcopter.tlog"), "conditioning.max_age_s=0.5"
    arguments = [log, "-o", name, "--set", more, "--end", "40", "--output", str(output), "--json"]
    done = CliRunner().invoke(cli, ["calibrate", *arguments])
    assert done.exit_code == 0, done.output
    made = config.effective(pipeline.configure(str(output)))
    keys = json.loads(done.stdout)["configuration"]["conditioning"]
    assert list(keys) == ["gyroscope"]
    assert made["conditioning"]["gyroscope"].items() >= keys["gyroscope"].items()
    given = config.effective(pipeline.configure(name, [more]))
    given["conditioning"]["gyroscope"] |= keys["gyroscope"]
    assert made == given


def test_the_command_refuses_what_run_would_not_take(sample_logs, tmp_path):
    output = str(tmp_path / "mine.txt")
    log = str(sample_logs / "quadcopter.tlog")
    done = CliRunner().invoke(cli, ["calibrate", log, "--output", output])
    assert str(done.exception) == (
        f"--output {output}: name a .yaml file, such as --observer takes."
    )


def test_the_command_speaks_json(sample_logs):
    log = str(sample_logs / "quadcopter.tlog")
    done = CliRunner().invoke(cli, ["calibrate", log, "--json"])
    document = json.loads(done.stdout)
    assert set(document) == {"configuration", "log", "observer", "sensors", "warnings"}
    assert document["sensors"]["magnetometer"]["applied"] is False
    assert document["sensors"]["accelerometer"]["told"].startswith("not observable")


def test_the_logs_doubts_are_shown(tmp_path):
    made = simulation.simulate("handheld")
    degrees = Signal(made.signals["gyro"].t, np.rad2deg(made.signals["gyro"].y))
    simulation.write(tmp_path / "a.csv", replace(made, signals={**made.signals, "gyro": degrees}))
    done = CliRunner().invoke(cli, ["calibrate", str(tmp_path / "a.csv")])
    (line,) = [line for line in done.stdout.splitlines() if "its unit seems to be deg/s" in line]
    assert line.startswith("#  ! ")
    assert yaml.safe_load(done.stdout)["observer"] == "fts"
    done = CliRunner().invoke(cli, ["calibrate", str(tmp_path / "a.csv"), "--json"])
    assert any("deg/s" in note["text"] for note in json.loads(done.stdout)["warnings"])


def test_a_line_break_in_a_name_stays_in_the_comment():
    note = {"text": "topic\nobserver: vae", "count": 1}
    document = {"log": "a\nobserver: vae", "sensors": {}, "warnings": [note]}
    assert text_of_calibration(document, fts.Config()).count("\nobserver:") == 1


def test_gaps_and_restarts_are_survived():
    log = flight(duration=40.0)
    late = {
        name: Signal(s.t + (s.t > START + 20 * SECOND) * 60 * SECOND, s.y, s.source)
        for name, s in log.signals.items()
    }
    assert "gyroscope" in calibrate(recording(late), fts.Config())["sensors"]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({}, "scale and misalignment not told, for want of turns"),
        (
            {"velocity": Signal(stamps(5.0, 20.0), np.zeros((100, 3)))},
            "not told, as gravity is no mean of a vehicle's force, and the log has a velocity",
        ),
    ],
)
def test_why_turns_tell_nothing_is_said(change, why):
    log = flight(resting)
    found = calibrate(replace(log, signals={**log.signals, **change}), fts.Config())
    assert why in found["sensors"]["gyroscope"]["told"]


@pytest.mark.shared
def test_a_slow_gyroscope_is_the_reason_where_it_is(shared):
    log = shared / "tlog" / "bluerov2_bad_crc.tlog"
    given = pipeline.configure("fts")
    recording_ = pipeline.read(log, given)
    held = {name: s for name, s in recording_.signals.items() if name != "velocity"}
    found = calibrate(replace(recording_, signals=held), given)
    assert "as the gyroscope is too slow for its motion" in found["sensors"]["gyroscope"]["told"]


def test_an_observer_of_feature_points_has_no_sensor_to_calibrate(sample_logs):
    with pytest.raises(ConfigError, match="relative_fts: takes feature points, and no sensor"):
        cli.main(
            ["calibrate", str(sample_logs / "quadcopter.csv"), "-o", "relative_fts"],
            standalone_mode=False,
        )
