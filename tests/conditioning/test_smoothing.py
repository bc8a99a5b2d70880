"""The stages of smoothing, and what they do with magnetometers and accelerometers gone wrong."""

import re
from dataclasses import replace

import numpy as np
import pytest
from flights import FIELD, G, at, flight, gyro, recording, resting, seen, stamps, tumbling
from numpy.testing import assert_allclose

from attest.conditioning import condition, smoothing
from attest.conditioning.measured import Measured
from attest.config import Conditioning
from attest.geometry import quaternion
from attest.observers import fts
from attest.recording import Signal

CONFIG = fts.Config()
MINUTES = 120.0


def angle_deg(q, r):
    """Return the angle between attitudes."""
    return np.rad2deg(2.0 * np.arccos(np.clip(np.abs(np.sum(q * r, axis=1)), 0.0, 1.0)))


def inclination_deg(q, r):
    """Return the angle between the verticals."""
    up, known = (quaternion.to_matrix(each)[:, 2] for each in (q, r))
    return np.rad2deg(np.arccos(np.clip(np.sum(up * known, axis=1), -1.0, 1.0)))


TURNED = (
    r"the field turns against the gyroscope, by up to (\d+)° from one 5 s to the next, first at "
    r"(\d+) s: disturbed, stuck or late; heading is doubtful since"
)


def turned(notes):
    """Return by how many degrees and from when, s, the field is doubted to turn."""
    told = [re.fullmatch(TURNED, note.text) for note in notes if note.doubt]
    (found,) = [tuple(map(int, match.groups())) for match in told if match]
    return found


def texts(notes):
    return "\n".join(note.text for note in notes)


def north(q):
    """Turn the truth to the magnetic north that a log without a place is taken against."""
    heading = 0.5 * np.arctan2(FIELD[1], FIELD[0])
    return quaternion.multiply(np.array([np.cos(heading), 0.0, 0.0, -np.sin(heading)]), q)


def observed(log, config=CONFIG):
    """Return the errors in attitude and tilt of ``fts``, degrees, and the notes."""
    samples, notes = condition(log, config)
    q = fts.estimate(samples, config).q
    truth = north(log.references["TRUTH"].q)
    return angle_deg(q, truth), inclination_deg(q, truth), notes


def with_mag(log, change):
    """Return a log whose magnetometer's values, (j, 3), are changed, given seconds too."""
    mag = log.signals["mag"]
    y = change(mag.y.copy(), at(mag.t))
    return replace(log, signals=log.signals | {"mag": Signal(mag.t, y, mag.source)})


def test_a_clean_log_stays_clean():
    error, _, notes = observed(flight(duration=60.0))
    assert error[0] < 1.0
    assert error.max() < 1.0
    told = texts(notes)
    assert "accelerometer low-passed over 0.67 s, and up to " in told
    assert "magnetometer low-passed over 0.67 s, and up to " in told
    assert told.count("s as the gyroscope's bias became known") == 2


def test_the_first_second_is_sane_from_noisy_samples():
    log = flight(duration=30.0)
    rng = np.random.default_rng(3)
    noisy = {
        name: replace(signal, y=signal.y + scale * rng.normal(size=signal.y.shape))
        for (name, signal), scale in zip(log.signals.items(), (0.01, 1.0, 2e-6), strict=True)
    }
    error, _, _ = observed(replace(log, signals=noisy))
    assert error[100:].max() < 5.0
    assert error[1000:].max() < 2.5


def test_magnetometer_never_tilts():
    log = flight(duration=60.0)
    wrong = with_mag(log, lambda y, _: y @ np.diag([1.0, -1.0, 0.3]))
    _, tilt, _ = observed(wrong)
    assert tilt.max() < 0.5


def test_a_field_that_changes_on_the_way_tilts_nothing_and_is_told():
    def change(y, seconds):
        return y + np.where(seconds[:, np.newaxis] > 60.0, [0.0, 0.0, 30e-6], 0.0)

    log = flight(duration=240.0)
    error, tilt, notes = observed(with_mag(log, change))
    assert tilt.max() < 0.5
    assert error[:6000].max() < 1.5
    assert "unlike the field before it" in texts(notes)


@pytest.mark.parametrize("strength", [0.7, 1.6])
def test_a_field_that_stays_changed_is_held_off_and_then_accepted(strength):
    turned = np.deg2rad(30.0)
    R = np.array([[np.cos(turned), -np.sin(turned), 0.0], [np.sin(turned), np.cos(turned), 0.0]])
    elsewhere = strength * np.array([*(R[:, :2] @ FIELD[:2]), 0.6 * FIELD[2]])
    log = flight(duration=400.0)
    other = seen(tumbling, log.signals["mag"].t, elsewhere)
    log = with_mag(log, lambda y, s: np.where(s[:, np.newaxis] > 60.0, other.y, y))
    error, tilt, notes = observed(log)
    assert tilt.max() < 0.5
    assert error[: 66 * 100].max() < 10.0
    assert error[-1] == pytest.approx(30.0, abs=3.0)
    assert "unlike the field before it" in texts(notes)


def test_a_field_that_turns_at_the_same_strength_and_dip_is_told():
    half = np.deg2rad(35.0)
    elsewhere = quaternion.rotate(np.array([np.cos(half), 0.0, 0.0, np.sin(half)]), FIELD)
    log = flight(duration=120.0)
    other = seen(tumbling, log.signals["mag"].t, elsewhere)
    log = with_mag(log, lambda y, s: np.where(s[:, np.newaxis] > 62.0, other.y, y))
    _, tilt, notes = observed(log)
    assert tilt.max() < 0.5
    angle, since = turned(notes)
    assert 35 <= angle <= 70
    assert since == 65


def test_a_passing_magnet_turns_the_heading_little():
    def magnet(y, seconds):
        near = (seconds > 60.0) & (seconds < 70.0)
        return y + np.where(near[:, np.newaxis], [40e-6, -60e-6, 20e-6], 0.0)

    error, _, notes = observed(with_mag(flight(duration=MINUTES), magnet))
    assert error.max() < 8.0
    assert error[9000:].max() < 2.0
    assert "unlike the field before it" in texts(notes)


def test_a_magnetometer_that_is_stuck_leaves_the_tilt_alone_and_is_told():
    _, tilt, notes = observed(with_mag(flight(duration=60.0), lambda y, _: y * 0.0 + y[:1]))
    assert tilt.max() < 0.5
    angle, since = turned(notes)
    assert angle > 90
    assert since <= 20
    assert "magnetometer sample unlike the field before it, believed the less" in texts(
        [note for note in notes if note.doubt]
    )


def test_without_a_magnetometer_the_tilt_is_right_and_heading_is_said_to_drift():
    log = flight(duration=60.0)
    signals = {name: signal for name, signal in log.signals.items() if name != "mag"}
    _, tilt, notes = observed(replace(log, signals=signals))
    assert tilt.max() < 0.5
    assert "'accel' is the only direction" in texts(notes)


def test_a_magnetometer_that_comes_ten_seconds_late_is_told():
    log = flight(duration=60.0)
    mag = log.signals["mag"]
    late = replace(log, signals=log.signals | {"mag": Signal(mag.t + 10 * 10**9, mag.y, "M")})
    _, tilt, notes = observed(late)
    assert tilt.max() < 0.5
    angle, since = turned(notes)
    assert angle > 90
    assert since <= 25
    assert "magnetometer sample unlike the field before it, believed the less" in texts(
        [note for note in notes if note.doubt]
    )


def test_of_a_clean_magnetometer_no_turn_is_told():
    _, _, notes = observed(flight(duration=60.0))
    assert "the field turns" not in texts(notes)


def test_a_clipping_accelerometer_leaves_the_attitude_sane():
    log = flight(duration=60.0)
    accel = log.signals["accel"]
    clipped = Signal(accel.t, np.clip(accel.y, -0.9 * G, 0.9 * G), accel.source)
    error, tilt, _ = observed(replace(log, signals=log.signals | {"accel": clipped}))
    assert tilt.max() < 8.0
    assert error.max() < 10.0


@pytest.mark.parametrize("bias", [(0.0873, 0.0, 0.0), (0.03, -0.06, 0.05), (0.0, 0.0, 0.0873)])
def test_a_bias_from_the_first_sample_is_overcome(bias):
    error, tilt, notes = observed(flight(duration=240.0, bias=bias))
    assert error.max() < 15.0
    assert error[7_200:].max() < 5.0
    assert error[12_000:].max() < 2.0
    assert tilt[6_000:].max() < 2.0
    assert any(note.doubt for note in notes if "gyroscope: bias" in note.text)


def yawing(seconds):
    """Attitude that turns about the vertical only, so that gravity tells nothing of it."""
    zero = np.zeros(np.shape(seconds))
    return quaternion.from_euler(zero, zero, 1.5 * np.sin(0.31 * seconds))


def test_a_bias_about_the_vertical_is_overcome_where_gravity_tells_nothing_of_it():
    error, tilt, notes = observed(flight(yawing, duration=120.0, bias=(0.0, 0.0, 0.0873)))
    assert error.max() < 10.0
    assert tilt.max() < 1.0
    assert "low-passed over 0.67 s" in texts(notes)


def test_a_bias_is_told_by_rest():
    t = stamps(100.0, 30.0)
    signals = {
        "gyro": gyro(resting, t, (0.01, -0.02, 0.005)),
        "accel": seen(resting, t, [0.0, 0.0, -G]),
        "mag": seen(resting, t, FIELD),
    }
    samples, notes = condition(recording(signals), CONFIG)
    assert_allclose(samples.bias[-1], (0.01, -0.02, 0.005), atol=1e-4)
    assert "at rest 95%" in texts(notes)
    estimates = fts.estimate(samples, CONFIG)
    assert_allclose(estimates.gyro_bias[-1], (0.01, -0.02, 0.005), atol=1e-3)
    assert_allclose(estimates.angular_velocity[-1], 0.0, atol=1e-3)


def test_each_stage_can_be_left_out():
    raw = Conditioning.model_validate(
        {
            "gyroscope": {"sample": "begins", "correct": False},
            "smoothing": {"accel_s": None, "mag_s": None},
            "magnetometer": {"decouple_tilt": False, "disturbance": None, "latency_s": 0.0},
        }
    )
    log = flight(duration=20.0)
    samples, notes = condition(log, fts.Config(conditioning=raw))
    assert samples.bias is None
    assert_allclose(samples.gyro, log.signals["gyro"].y, atol=0)
    assert_allclose(samples.body[:, 0], log.signals["accel"].y / G, atol=1e-12)
    assert "low-passed" not in texts(notes)


def test_memory_is_short_where_the_gyroscope_is_too_slow():
    t = stamps(4.0, 60.0)
    quick = Signal(t, np.random.default_rng(0).normal(size=(len(t), 3)), "GYRO")
    signals = {"gyro": quick, "accel": seen(resting, t, [0.0, 0.0, -G])}
    _, notes = condition(recording(signals), CONFIG)
    assert "too slow for its motion" in texts(notes)


def test_how_long_the_frame_is_relied_on_is_a_random_walks_law():
    h, rng = np.full(10_000, 0.01), np.random.default_rng(1)
    rate = np.cumsum(rng.normal(scale=0.05, size=(10_000, 3)), axis=0)
    divided, whole = 0.005, 0.01
    once = smoothing.longest_memory(h, rate, divided)
    assert smoothing.longest_memory(h, 2.0 * rate, divided) == pytest.approx(once / 4.0)
    once = smoothing.longest_memory(h, rate, whole)
    assert smoothing.longest_memory(h, 2.0 * rate, whole) == pytest.approx(once / 16.0)
    assert smoothing.longest_memory(h, np.ones((10_000, 3)), divided) == np.inf


def test_what_is_pushed_hard_is_remembered_for_longer_than_the_frame_is_good():
    good, rng = 0.25, np.random.default_rng(1)
    walk = smoothing.FRAME_ERROR**2 / good
    for std in (0.1, 0.2, 0.3):
        length = G * (1.0 + std * rng.normal(size=100_000))
        none = np.empty((0, 3))
        accel = Measured(none, none, np.ones(len(length), np.bool_), length)
        found = smoothing.worthwhile(good, accel)
        taus = np.geomspace(0.5, 2.0, 201) * found
        harm = 2.0 * (std * smoothing.PUSH / taus) ** 2 + walk * taus
        assert taus[np.argmin(harm)] == pytest.approx(found, rel=0.02)
    still = Measured(none, none, np.ones(9, np.bool_), np.full(9, G))
    assert smoothing.worthwhile(good, still) == 0.0
