import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from attest import simulation
from attest.geometry import quaternion
from attest.simulation import sensors, trajectory
from attest.simulation.quadcopter import BOOT


@pytest.fixture(scope="module")
def flight():
    return simulation.simulate("quadcopter")


def seconds(t):
    return (t - BOOT) * 1e-9


def test_sensors_stand_still_before_take_off(flight):
    gyro, accel = flight.signals["gyro"], flight.signals["accel"]
    still = seconds(gyro.t) < 4.0
    assert_allclose(gyro.y[still].mean(axis=0), flight.constants["gyro_bias"], atol=2e-3)
    expected = np.array([0.0, 0.0, -9.80665]) + flight.constants["accel_bias"]
    assert_allclose(accel.y[still].mean(axis=0), expected, atol=0.03)


def test_gyro_integrates_to_the_truth(flight):
    gyro = flight.signals["gyro"]
    t, rate = seconds(gyro.t), gyro.y - flight.constants["gyro_bias"]
    steps = quaternion.exp(np.diff(t)[:, np.newaxis] * 0.5 * (rate[1:] + rate[:-1]))
    q = trajectory.attitude(t[:1])[0]
    for step in steps:
        q = quaternion.multiply(q, step)
    error = quaternion.log(quaternion.multiply(q, quaternion.conjugate(flight.q[-1])))
    assert np.degrees(np.linalg.norm(error)) < 5.0


def test_the_motors_shake_in_flight(flight):
    accel = flight.signals["accel"]
    t = seconds(accel.t)
    shake = accel.y - trajectory.specific_force(t)
    assert np.all(shake[t < 4.0].std(axis=0) < 0.2)
    assert np.all(shake[(t > 8.0) & (t < 57.0)].std(axis=0) > 0.4)
    assert np.abs(shake).max() < 5.0


def test_the_field_is_the_models_but_for_the_steel(flight):
    mag = flight.signals["mag"]
    t, strength = seconds(mag.t), np.linalg.norm(mag.y, axis=-1)
    north, east, down = sensors.magnetic_field()
    assert np.degrees(np.arctan2(east, north)) == pytest.approx(3.6, abs=0.2)
    assert np.degrees(np.arctan2(down, np.hypot(north, east))) == pytest.approx(63.5, abs=0.3)
    near = np.abs(t - 22.0) < 4.0
    earth = np.linalg.norm([north, east, down])
    assert_allclose(strength[~near], earth, atol=2.5e-6)
    assert 10e-6 < strength[near].max() - earth < 15e-6


def test_navigation_is_late_and_near(flight):
    position, velocity = flight.signals["position"], flight.signals["velocity"]
    place, speed, _ = trajectory.kinematics(seconds(position.t) - 0.1)
    assert_allclose(sensors.local(position.y), place, atol=1.0)
    assert_allclose(velocity.y, speed, atol=0.25)
    assert_allclose(sensors.geodetic(sensors.local(position.y)), position.y, rtol=0, atol=1e-9)


def test_the_autopilot_is_a_little_wrong(flight):
    error = quaternion.multiply(flight.autopilot, quaternion.conjugate(flight.q))
    north, east, heading = np.degrees(quaternion.log(error)).T
    assert_allclose(heading, 3.0, atol=0.6)
    assert 1.0 < np.hypot(north, east).max() < 2.0


def test_truth_is_exact_at_its_stamps(flight):
    assert_array_equal(flight.t % 10**6, 0)
    dots = np.sum(flight.q * trajectory.attitude(seconds(flight.t)), axis=-1)
    assert_allclose(np.abs(dots), 1.0, atol=1e-14)
    assert np.all(np.sum(flight.q[1:] * flight.q[:-1], axis=-1) > 0.9)


def test_the_seed_draws_the_noise_only(flight):
    again, other = (simulation.simulate("quadcopter", seed) for seed in (0, 1))
    assert_array_equal(flight.signals["gyro"].y, again.signals["gyro"].y)
    assert not np.array_equal(flight.signals["gyro"].t, other.signals["gyro"].t)
    assert other.seed == 1
