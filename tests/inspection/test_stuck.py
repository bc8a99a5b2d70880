"""A sensor that stands still, and what only looks like it."""

from dataclasses import replace

import numpy as np
import pytest
from flights import FIELD, at, flight, gyro, recording, resting, seen, stamps

from attest import inspection, pipeline, readers, simulation
from attest.geometry import quaternion
from attest.observers import fts
from attest.recording import Signal


def told(log):
    """Return the texts of what is doubted of a sensor that stands still."""
    return [n.text for n in inspection.doubts(log) if n.doubt and "stands still" in n.text]


def with_mag(log, change, name="mag"):
    """Return a log whose magnetometer's values, (j, 3), are changed, given seconds too."""
    signal = log.signals[name]
    y = change(signal.y, (signal.t - signal.t[0]) * 1e-9)
    return replace(log, signals={**log.signals, name: Signal(signal.t, y, signal.source)})


def held(y, seconds, since, until):
    """Return what stays what it was for a while."""
    last = np.arange(len(y))
    last[(seconds > since) & (seconds <= until)] = np.flatnonzero(seconds <= since)[-1]
    return y[last]


def test_a_magnetometer_that_is_stuck_is_told_with_how_long(log):
    s = (log.signals["mag"].t - log.signals["mag"].t[0]) * 1e-9
    text = "the magnetometer stands still for {:.0f} s while the gyroscope turns: it is stuck"
    assert told(with_mag(log, lambda y, _: y * 0.0 + y[:1])) == [text.format(s[-1])]
    first, last = np.searchsorted(s, (24.0, 24.0 + s[-1] / 3.0))
    part = with_mag(log, lambda y, s: held(y, s, s[first], s[last]))
    assert told(part) == [text.format(s[last] - s[first])]
    assert told(log) == []


@pytest.fixture(scope="module")
def handheld(tmp_path_factory):
    """Return a log of something that turns about all axes."""
    path = tmp_path_factory.mktemp("logs") / "handheld.csv"
    simulation.write(path, simulation.simulate("handheld"))
    return readers.read(path)


def test_an_accelerometer_that_is_stuck_is_told(handheld):
    stuck = with_mag(handheld, lambda y, s: held(y, s, 20.0, 40.0), "accel")
    (text,) = told(stuck)
    assert text.startswith("the accelerometer stands still for ")
    assert text.endswith("s while the gyroscope turns: it is stuck")


@pytest.mark.parametrize("without", [(), ("mag",)])
def test_a_gyroscope_that_is_stuck_is_told(handheld, without):
    stuck = with_mag(handheld, lambda y, s: held(y, s, 20.0, 30.0), "gyro")
    kept = {name: s for name, s in stuck.signals.items() if name not in without}
    (text,) = told(replace(stuck, signals=kept))
    assert text.startswith("the gyroscope stands still for 10 s while the other sensors turn")


def test_a_turntable_that_no_noise_disturbs_is_not_stuck():
    rate, t = np.array([0.0, 0.6, 0.8]), stamps(100.0, 60.0)
    turned = quaternion.exp(np.outer((t - t[0]) * 1e-9, rate))
    back = quaternion.conjugate(turned)
    log = recording(
        {
            "gyro": Signal(t, np.tile(rate, (len(t), 1)), "gyro"),
            "mag": Signal(t, quaternion.rotate(back, FIELD), "mag"),
        }
    )
    assert told(log) == []


def test_a_slow_magnetometer_that_is_logged_often_is_not_stuck(log):
    for rate in (20.0, 5.0, 1.0):
        slow = with_mag(log, lambda y, s, r=rate: y[np.searchsorted(s, np.floor(s * r) / r)])
        assert told(slow) == []


@pytest.mark.parametrize("bias", [(0.0, 0.0, 0.0), (0.0873, -0.0873, 0.0873)])
def test_a_coarse_magnetometer_at_rest_is_not_stuck_however_large_the_bias(bias):
    t = stamps(100.0, 60.0)
    rates = gyro(resting, t, bias)
    noisy = replace(rates, y=rates.y + 0.01 * np.random.default_rng(0).normal(size=rates.y.shape))
    coarse = seen(resting, t, FIELD)
    signals = {"gyro": noisy, "mag": replace(coarse, y=np.round(coarse.y, 6))}
    assert told(recording(signals)) == []


def test_a_bias_that_wanders_for_an_hour_turns_nothing():
    t = stamps(10.0, 3600.0)
    rates = gyro(resting, t, (0.01, 0.0, 0.0))
    rates.y[:, 1] += 2e-6 * at(t)
    assert told(recording({"gyro": rates, "mag": seen(resting, t, FIELD)})) == []


def test_what_happens_in_a_gap_of_the_gyroscope_is_not_known():
    t = stamps(100.0, 60.0)
    rates = gyro(resting, t)
    rates.y[1999] = [2.0, -2.0, 1.0]
    heard = (t < t[2000]) | (t > t[5000])
    signals = {"gyro": Signal(t[heard], rates.y[heard]), "mag": seen(resting, t, FIELD)}
    assert told(recording(signals)) == []


def test_a_turn_about_the_field_leaves_it_as_it_is():
    axis = FIELD / np.linalg.norm(FIELD)

    def about(seconds):
        return quaternion.exp(np.outer(2.0 * np.sin(0.3 * seconds), axis))

    log = flight(about, duration=60.0)
    assert told(with_mag(log, lambda y, _: np.round(y, 7))) == []


def test_a_magnetometer_beyond_the_gyroscope_tells_nothing():
    log = flight(duration=20.0)
    mag = log.signals["mag"]
    later = Signal(mag.t + 10**12, mag.y * 0.0 + mag.y[:1], mag.source)
    assert told(replace(log, signals={**log.signals, "mag": later})) == []
    assert at(later.t)[0] > 900.0


@pytest.mark.shared
@pytest.mark.slow
def test_no_recorded_log_is_told_to_be_stuck(shared, sample_logs):
    logs = [*sample_logs.glob("quadcopter*")]
    for pattern in ("tlog/b*.tlog", "tlog/q*.tlog", "dataflash/*", "ulog/*", "csv/*.csv"):
        logs += shared.glob(pattern)
    logs += [*shared.glob("rosbag1/*"), *shared.glob("rosbag2/*")]
    for path in logs:
        if "truth" not in path.name:
            assert told(pipeline.read(path, fts.Config())) == []
