import numpy as np
import pytest
from flights import FIELD, at, gyro, resting, seen, stamps, tumbling

from attest.conditioning import frame, latency


def found(attitude, late, *, rate=20.0, noise=0.0, bias=(0.0, 0.0, 0.0), duration=60.0):
    t, t_mag = stamps(100.0, duration), stamps(rate, duration)
    mag = seen(attitude, t_mag, FIELD, late).y
    mag = mag + noise * np.linalg.norm(FIELD) * np.random.default_rng(0).normal(size=mag.shape)
    D = frame.integrate(t, frame.mean_of_ends(gyro(attitude, t, bias).y))
    return latency.find(t, D, t_mag, mag)


@pytest.mark.parametrize("late", [0.06, 0.12, 0.25, 0.4])
def test_a_late_magnetometer_is_found_out(late):
    assert found(tumbling, late) == pytest.approx(late, abs=0.01)


def test_latency_shows_through_noise_and_the_gyroscopes_bias():
    late = found(tumbling, 0.12, noise=0.02, bias=(0.05, -0.05, 0.05))
    assert late == pytest.approx(0.12, abs=0.02)


@pytest.mark.parametrize("rate", [5.0, 10.0, 50.0])
def test_latency_is_found_at_any_rate(rate):
    assert found(tumbling, 0.12, rate=rate) == pytest.approx(0.12, abs=0.02)


def test_a_magnetometer_in_time_is_left_alone():
    assert found(tumbling, 0.0) < 0.005
    assert found(tumbling, 0.0, noise=0.02) < 0.01


def test_a_magnetometer_ahead_of_time_has_no_latency():
    assert found(tumbling, -0.05) == 0.0


def test_at_rest_no_latency_can_be_told():
    assert found(resting, 0.12) == 0.0
    assert found(resting, 0.12, noise=0.05) == 0.0


def test_too_few_samples_tell_no_latency():
    assert found(tumbling, 0.12, duration=2.0) == 0.0
    t = stamps(100.0, 10.0)
    D = frame.integrate(t, frame.mean_of_ends(gyro(tumbling, t).y))
    assert latency.find(t, D, t[:1], np.ones((1, 3))) == 0.0


def test_a_field_that_is_not_constant_tells_no_latency():
    t, t_mag = stamps(100.0, 30.0), stamps(20.0, 30.0)
    D = frame.integrate(t, frame.mean_of_ends(gyro(tumbling, t).y))
    noise = np.random.default_rng(3).normal(size=(len(t_mag), 3))
    assert latency.find(t, D, t_mag, noise) == 0.0


def test_latency_is_the_same_wherever_time_begins():
    t, t_mag = stamps(100.0, 30.0), stamps(20.0, 30.0)
    mag = seen(tumbling, t_mag, FIELD, 0.12).y
    D = frame.integrate(t, frame.mean_of_ends(gyro(tumbling, t).y))
    here = latency.find(t, D, t_mag, mag)
    later = latency.find(t + 10**18, D, t_mag + 10**18, mag)
    assert here == pytest.approx(later, abs=1e-9)
    assert at(t)[0] == 0.0
