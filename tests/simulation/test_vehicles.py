"""The vehicles that are no quadcopter: true to themselves, and as difficult as they say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from vqf import offlineVQF

from attest.geometry import quaternion
from attest.simulation import curves, docking, fixed_wing, handheld, sensors, spacecraft

NAMES = ("fixed-wing", "handheld", "spacecraft", "docking")


@pytest.fixture(scope="module")
def flights(simulated):
    return {name: simulated(name, seed=0) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_angular_velocity_turns_the_attitude(flights, name):
    flight = flights[name]
    steps = quaternion.multiply(quaternion.conjugate(flight.q[:-1]), flight.q[1:])
    h = np.diff(flight.t)[:, np.newaxis] * 1e-9
    omega = flight.omega
    mean = 0.5 * (omega[1:] + omega[:-1])
    # the trapezoid's error is h²/12 |Omega''|, most for the hand's tremor of 9 Hz
    assert np.sqrt(np.mean((quaternion.log(steps) / h - mean) ** 2)) < 5e-3
    assert_allclose(np.linalg.norm(flight.q, axis=-1), 1.0, atol=1e-12)


@pytest.mark.parametrize("name", ["fixed-wing", "handheld", "docking"])
def test_velocity_moves_the_place(flights, name):
    flight = flights[name]
    h = np.diff(flight.t)[:, np.newaxis] * 1e-9
    mean = 0.5 * (flight.velocity[1:] + flight.velocity[:-1])
    assert_allclose(np.diff(flight.position, axis=0) / h, mean, atol=0.03)


@pytest.mark.parametrize(("module", "duration"), [(fixed_wing, 300.0), (handheld, 120.0)])
def test_the_accelerometer_feels_acceleration_less_gravity(module, duration):
    t = np.linspace(1.0, duration - 1.0, 997)
    if module is fixed_wing:
        a = (fixed_wing.velocity(t + 1e-3) - fixed_wing.velocity(t - 1e-3)) / 2e-3
    else:
        at = handheld.place
        a = (at(t + 1e-3) - 2.0 * at(t) + at(t - 1e-3)) / 1e-6
    R = quaternion.to_matrix(module.attitude(t))
    felt = np.einsum("nji,nj->ni", R, a - [0.0, 0.0, 9.80665])
    assert_allclose(module.specific_force(t), felt, atol=0.01)


def test_fixed_wing_banks_so_that_it_feels_no_side_force(flights):
    t = flights["fixed-wing"].t * 1e-9
    felt = fixed_wing.specific_force(t)
    assert np.degrees(np.abs(np.arctan2(felt[:, 1], -felt[:, 2]))).max() < 2.5  # gusts
    roll = np.degrees(quaternion.to_euler(flights["fixed-wing"].q)[:, 0])
    assert np.median(roll[(t > 60) & (t < 110)]) == pytest.approx(35.0, abs=1.0)
    assert np.median(roll[(t > 145) & (t < 190)]) == pytest.approx(-45.0, abs=1.0)
    position = flights["fixed-wing"].position
    assert_allclose(position[0], [0.0, 0.0, -100.0], atol=1e-9)
    assert np.all(position[:, 2] < -50.0)


def test_fixed_wing_gps_is_late_and_in_wind(flights):
    velocity = flights["fixed-wing"].signals["velocity"]
    late = fixed_wing.velocity(velocity.t * 1e-9 - 0.25)
    assert_allclose((velocity.y - late).std(axis=0), 0.1, rtol=0.1)
    airspeed = np.linalg.norm(late - flights["fixed-wing"].constants["wind"], axis=-1)
    assert_allclose(airspeed, 22.0, atol=1e-9)
    position = sensors.local(flights["fixed-wing"].signals["position"].y)
    assert_allclose(position, fixed_wing.place(velocity.t * 1e-9 - 0.25), atol=6.0)


def test_an_independent_filter_agrees_with_the_hand(flights):
    flight, flip = flights["handheld"], np.array([1.0, -1.0, -1.0])
    given = (
        np.ascontiguousarray(flight.signals[name].y * flip) for name in ("gyro", "accel", "mag")
    )
    q = offlineVQF(*given, 0.01)["quat9D"]
    half = np.sqrt(0.5)  # from east-north-up and forward-left-up
    q = quaternion.multiply(np.array([0.0, half, half, 0.0]), q)
    q = quaternion.multiply(q, np.array([0.0, 1.0, 0.0, 0.0]))
    north, east, heading = np.degrees(
        quaternion.log(quaternion.multiply(q, quaternion.conjugate(flight.q)))
    ).T
    assert np.hypot(north, east).max() < 3.0
    assert np.median(heading) == pytest.approx(-3.6, abs=0.5)  # declination: no place is known


def test_the_hand_rests_and_the_laptop_bends_the_field(flights):
    flight = flights["handheld"]
    t = flight.t * 1e-9
    for start, end in handheld.RESTS:
        still = (t >= start) & (t < end - 0.01)
        assert_allclose(flight.omega[still], 0.0, atol=1e-9)
    strength = np.linalg.norm(flight.signals["mag"].y, axis=-1)
    near = (t > 72.0) & (t < 84.0)
    earth = np.linalg.norm(sensors.magnetic_field())
    assert_allclose(strength[~near], earth, atol=4e-6)
    assert np.abs(strength[near] - earth).max() > 15e-6
    assert 20.0 > np.linalg.norm(flight.signals["accel"].y, axis=-1).max() > 12.0


def test_spacecraft_is_a_rigid_body_and_its_bias_drifts(flights):
    flight = flights["spacecraft"]
    J, Omega = np.array(spacecraft.J), flight.omega
    tau = flight.signals["torque"].y + flight.truth["disturbance_torque"].y
    rate = (Omega[2:] - Omega[:-2]) / 0.2
    assert_allclose(rate, ((np.cross(J * Omega, Omega) + tau) / J)[1:-1], atol=1e-5)
    bias = flight.truth["gyro_bias"].y
    assert_allclose(bias[0], flight.constants["gyro_bias"], atol=1e-12)
    assert_allclose(bias[-1] - bias[0], spacecraft.DRIFT, atol=1e-12)
    assert_allclose((flight.signals["gyro"].y - Omega - bias).std(axis=0), 3e-4, rtol=0.1)


def test_spacecraft_sees_sun_and_stars(flights):
    flight = flights["spacecraft"]
    for name, std_deg in (("sun", 0.5), ("star1", 0.02), ("star2", 0.02)):
        signal = flight.signals[name]
        q = flight.q[np.searchsorted(flight.t, signal.t)]
        true = quaternion.rotate(quaternion.conjugate(q), np.array(flight.constants[name]))
        apart = np.degrees(np.linalg.norm(np.cross(signal.y, true), axis=-1))
        assert np.sqrt(np.mean(apart**2)) == pytest.approx(np.sqrt(2.0) * std_deg, rel=0.1)
        assert np.linalg.norm(flight.constants[name]) == pytest.approx(1.0)
    assert np.diff(flight.signals["sun"].t).max() == pytest.approx(80.2e9)


def test_docking_measures_the_points_in_the_observers_frame(flights):
    flight = flights["docking"]
    R = quaternion.to_matrix(flight.q)
    for name, p in docking.POINTS.items():
        signal = flight.signals[name]
        at = np.searchsorted(flight.t, signal.t)
        a = np.einsum("nji,nj->ni", R[at], np.array(p) - flight.position[at])
        assert_allclose((signal.y - a).std(axis=0), 0.003, rtol=0.1)
        assert flight.constants[name] == p
    distance = np.linalg.norm(flight.position, axis=-1)
    assert distance[0] > 8.0
    assert distance[-1] == pytest.approx(1.6, abs=0.1)


def test_docking_hides_points_until_two_are_left(flights):
    flight = flights["docking"]
    visible = sum(np.isin(flight.t, signal.t).astype(int) for signal in flight.signals.values())
    t = flight.t * 1e-9
    assert_array_equal(visible[(t >= 34.0) & (t < 38.0)], 2)
    assert np.all(visible[(t < 34.0) | (t >= 38.0)] >= 3)


def test_curves_are_smooth_and_their_integrals():
    t = np.linspace(-1.0, 5.0, 601)
    h = 1e-4
    slope = (curves.ramp(t + h, 0.5, 3.0) - curves.ramp(t - h, 0.5, 3.0)) / (2 * h)
    assert_allclose(slope, curves.step(t, 0.5, 3.0), atol=1e-8)
    assert_allclose(curves.window(t, 0.0, 4.0, 1.0)[[0, 300, 600]], [0.0, 1.0, 0.0], atol=1e-12)
