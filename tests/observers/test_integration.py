from dataclasses import replace

import numpy as np
import observing
import papers
import pytest
from flights import angle_deg, samples
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from observing import IDENTITY, H
from papers_rigid import biased
from scipy.spatial.transform import Rotation
from strategies import rotations, vectors

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion, so3
from attest.observers import integration

CONFIG = integration.Config()


def without_vectors(t, gyro, **other):
    return samples(t, gyro, np.empty((len(t), 0, 3)), np.empty((1, 0, 3)), **other)


def turned(rates, h, q=IDENTITY):
    """Return SciPy's product of R_{i+1} = R_i exp(h_i rates_i), as quaternions."""
    R = [Rotation.from_quat(quaternion.to_xyzw(q))]
    for rate, h_i in zip(rates, h, strict=True):
        R.append(R[-1] * Rotation.from_rotvec(h_i * rate))
    return quaternion.from_xyzw(np.array([R_i.as_quat() for R_i in R]))


@given(seed=st.integers(0, 999), q=rotations, scale=st.sampled_from([0.01, 1.0, 30.0]))
def test_it_is_scipys_product_of_the_mean_rates_of_irregular_steps(seed, q, scale):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.integers(1, 50_000_000, 40))
    gyro = scale * rng.normal(size=(40, 3))
    made = without_vectors(t, gyro)
    found = integration.estimate(made, observing.starting(CONFIG, q))
    expected = turned(0.5 * (gyro[1:] + gyro[:-1]), np.diff(t) * 1e-9, q)
    assert np.deg2rad(angle_deg(found.q, expected)).max() < 1e-9
    assert_allclose(found.angular_velocity, gyro)
    assert found.gyro_bias is None


@given(Omega=vectors(), q=rotations)
def test_at_a_constant_rate_it_is_the_closed_form(Omega, q):
    n = 200
    made = without_vectors(np.arange(n) * 10_000_000, np.tile(Omega, (n, 1)))
    found = integration.estimate(made, observing.starting(CONFIG, q))
    R = quaternion.to_matrix(q)
    for i in (0, 1, 50, n - 1):
        closed = R @ papers.exp(i * H * Omega)
        assert_allclose(quaternion.to_matrix(found.q[i]), closed, atol=1e-10)


def test_its_error_is_of_second_order_in_the_step():
    def rate(t):
        return np.stack([np.sin(3.0 * t), np.cos(2.0 * t), 0.5 * np.ones_like(t)], axis=1)

    ends = []
    for h in (0.02, 0.01, 0.005, 0.000625):
        t = np.arange(round(2.0 / h) + 1) * round(h * 1e9)
        start = observing.starting(CONFIG, IDENTITY)
        ends.append(integration.estimate(without_vectors(t, rate(t * 1e-9)), start).q[-1])
    errors = angle_deg(np.array(ends[:3]), ends[3])
    assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.05)


def test_sub_steps_change_nothing():
    rng = np.random.default_rng(1)
    t, gyro = np.arange(20) * 100_000_000, rng.normal(size=(20, 3))
    one, many = (
        integration.estimate(without_vectors(t, gyro, substeps=np.full(20, parts)), CONFIG)
        for parts in (1, 10)
    )
    assert one.q.tobytes() == many.q.tobytes()


def test_the_configured_bias_is_taken_off():
    Omega, beta = observing.motion(500), np.array([0.1, -0.2, 0.05])
    t = np.arange(500) * 10_000_000
    start = observing.starting(CONFIG, IDENTITY)
    plain = integration.estimate(without_vectors(t, Omega), start)
    chosen = observing.starting(CONFIG, IDENTITY, beta)
    off = integration.estimate(without_vectors(t, Omega + beta), chosen)
    assert angle_deg(plain.q, off.q).max() < 1e-6
    assert_allclose(off.angular_velocity, Omega, atol=1e-14)


@given(case=observing.cases(n=6))
def test_vectors_are_its_start_and_its_diagnostics_and_nothing_else(case):
    made = case.samples()
    found = integration.estimate(made, CONFIG)
    bent = made.body.copy()
    bent[1:] = quaternion.rotate(quaternion.exp(np.ones(3)), bent[1:])
    other = integration.estimate(replace(made, body=bent), CONFIG)
    assert found.q.tobytes() == other.q.tobytes()
    for i in range(6):
        e, u = papers.joined(case.E.T, bent[i].T)
        R, k = quaternion.to_matrix(other.q[i]), np.diag(CONFIG.weights.k)
        s = papers.s_L(R, papers.L(e, u, k))
        assert_allclose(other.s_norm[i], np.linalg.norm(s), atol=1e-6)
        assert_allclose(other.cost[i], papers.cost(R, e, u, k), atol=1e-6)
    assert found.cost[0] < 1e-6


def test_it_starts_from_the_first_vectors_also_where_they_come_later():
    Omega = observing.motion(400)
    middles = 0.5 * (Omega[1:] + Omega[:-1])
    q = turned(middles, np.full(399, H), quaternion.exp(np.array([0.5, -0.2, 0.8])))
    valid = np.arange(400)[:, np.newaxis] >= np.array([0, 150, 200])
    made = observing.sampled(Omega, observing.seen(q, np.eye(3)), np.eye(3), valid=valid)
    assert angle_deg(integration.estimate(made, CONFIG).q, q).max() < 1e-6


@given(case=observing.cases(), Q=rotations)
def test_a_run_does_not_care_how_the_world_is_turned(case, Q):
    there = case.in_a_turned_world(Q)
    found = [integration.estimate(c.samples(), c.start(CONFIG)).q for c in (case, there)]
    assert angle_deg(quaternion.multiply(Q, found[0]), found[1]).max() < 1e-6


@given(case=observing.cases(), Q=rotations)
def test_a_run_does_not_care_how_the_sensors_sit_in_the_body(case, Q):
    there = case.in_a_turned_body(Q)
    found = [biased(integration.estimate(c.samples(), c.start(CONFIG))) for c in (case, there)]
    observing.assert_turned_body(*found, Q, atol=1e-6)


@pytest.mark.slow
def test_attitude_stays_a_rotation_over_a_million_steps_without_projection():
    n = 1_000_000
    gyro = np.random.default_rng(1).normal(size=(n, 3))
    out = np.empty((n, 12))
    start = so3.as_quaternion(IDENTITY)
    integration.run(np.full(n, H), gyro, gyro, np.zeros((n, 10)), start, (0.0, 0.0, 0.0), out)
    assert np.abs(np.linalg.norm(out[:, :4], axis=1) - 1.0).max() < 1e-10


def test_a_restart_starts_from_the_vectors_of_the_new_stretch():
    made, q = observing.restarted(np.zeros(3))
    found = integration.estimate(made, CONFIG)
    assert angle_deg(found.q, q)[[0, 2000]].max() < 1e-6
    alone = observing.sampled(made.gyro[2000:], made.body[2000:], np.eye(3))
    assert angle_deg(found.q[2000:], integration.estimate(alone, CONFIG).q).max() < 1e-9


def test_a_body_that_does_not_turn_stays_where_it_is():
    found = integration.estimate(observing.at_rest(50), observing.starting(CONFIG, IDENTITY))
    assert_allclose(found.q, np.broadcast_to(IDENTITY, (50, 4)))


def test_steps_of_a_nanosecond_change_next_to_nothing():
    made = without_vectors(np.arange(3), np.ones((3, 3)))
    q = quaternion.exp(np.ones(3))
    found = integration.estimate(made, observing.starting(CONFIG, q))
    assert_allclose(found.q, np.broadcast_to(q, (3, 4)), atol=1e-8)


@settings(max_examples=150)
@given(made=observing.any_samples())
def test_no_measurement_makes_a_nan(made):
    observing.assert_sound(biased(integration.estimate(made, CONFIG)))


def test_a_gain_is_refused_for_there_are_none():
    with pytest.raises(ConfigError, match=r"my\.yaml: unknown key 'gains\.k_p'"):
        config.validate(
            integration.Config, {"observer": "integration", "gains": {"k_p": 1}}, "my.yaml"
        )
