import numpy as np
import pytest
from flights import FIELD, at, body, rate, stamps, tumbling
from numpy.testing import assert_allclose

from attest.conditioning import drift

T = stamps(100.0, 300.0)
H = np.concatenate([[0.0], np.diff(T) * 1e-9])
TRUE = rate(tumbling, at(T) - 0.005)
ACCEL = body(tumbling, at(T), [0.0, 0.0, -9.8])
MAG = body(tumbling, at(T), FIELD)
NONE = np.empty((0, 3))
NO, YES = np.zeros(len(T), bool), np.ones(len(T), bool)
FIRST = np.arange(len(T)) == 0
S = 1e-3 * np.array([[3.0, -2.0, 1.0], [2.5, -4.0, 0.5], [-1.0, 2.0, 3.5]])
BIAS = np.array([0.01, -0.02, 0.015])


def measured(bias=BIAS, S=S):
    """Return the gyroscope whose Omega_m - b - S Omega_m is the truth."""
    return (TRUE + bias) @ np.linalg.inv(np.eye(3) - S).T


def known(bias=0.01, scale=0.004):
    return np.array([np.zeros(12), [bias] * 3 + [scale] * 9])


def room():
    return np.empty((len(T), 3)), np.empty((len(T), 3)), np.empty(len(T))


def follow(gyro, *still, rest=NO, restart=FIRST, start=None):
    force, field = (*(still or (ACCEL,)), NONE)[:2]
    before = known() if start is None else start
    return drift.follow(H, gyro, force, field, rest, restart, before, room())


def test_bias_scale_and_misalignment_show_in_the_drift_of_gravity():
    at_, bias, _, found = follow(measured(), start=known(0.03, 0.004))
    assert_allclose(found[0, :3], BIAS, atol=5e-4)
    assert_allclose(found[0, 3:], S.ravel(), atol=2e-3)
    # gravity does not tell turns about itself, so that some of S stays as it was thought to be
    assert np.abs(at_ - TRUE)[-6000:].mean() < 0.7 * np.abs(measured(0.0 * BIAS) - TRUE).mean()
    assert_allclose(bias[-1], BIAS, atol=5e-4)


def test_a_large_bias_is_believed_where_the_field_drifts_alike():
    large = np.array([0.05, -0.06, 0.04])
    found = follow(measured(large), ACCEL, MAG, start=known(0.03)).known
    assert_allclose(found[0, :3], large, atol=2e-3)


def test_what_is_said_to_be_known_covers_what_is_wrong():
    found = follow(measured(), start=known(0.03, 0.004)).known
    wrong = np.concatenate([BIAS, S.ravel()]) - found[0]
    assert (np.abs(wrong) < 4.0 * found[1] + 1e-4).all()


def test_how_well_the_bias_is_known_at_each_sample_is_what_the_end_says():
    found = follow(measured(), start=known(0.03, 0.004))
    assert found.deviation[0] == 0.03
    assert (np.diff(found.deviation) <= 1e-9).all()
    assert found.deviation[-1] == pytest.approx(found.known[1, :3].max(), rel=0.02)


def test_a_gyroscope_without_error_is_left_alone():
    at_, _, _, found = follow(TRUE)
    assert_allclose(at_, TRUE, atol=2e-4)
    assert_allclose(found[0], 0.0, atol=2e-4)


def test_at_rest_the_gyroscope_reads_its_bias():
    still = np.tile(BIAS, (len(T), 1))
    at_, _, _, found = follow(still, np.tile([0.0, 0.0, 9.8], (len(T), 1)), rest=YES)
    assert_allclose(found[0, :3], BIAS, atol=2e-4)
    assert_allclose(at_[1000:], 0.0, atol=5e-4)


def test_what_comes_later_changes_nothing():
    gyro = measured()
    whole = follow(gyro)[0]
    spoilt = gyro.copy()
    spoilt[20_000:] += 0.5
    assert_allclose(follow(spoilt)[0][:20_000], whole[:20_000], atol=0)


def test_accelerations_of_a_vehicle_that_cancel_do_not_show():
    push = 2.0 * np.sin(2.0 * np.pi * 0.5 * at(T))[:, np.newaxis] * [1.0, 0.5, 0.0]
    accel = ACCEL + body_of(push)
    found = follow(measured(), accel).known
    assert_allclose(found[0, :3], BIAS, atol=3e-3)


def body_of(vectors):
    return np.array([body(tumbling, at(T[i : i + 1]), v)[0] for i, v in enumerate(vectors)])


def test_what_is_not_gravity_is_not_compared():
    found = drift.follow(H, measured(), NONE, NONE, NO, FIRST, known(), room()).known
    assert_allclose(found[0], 0.0, atol=0)


@pytest.mark.parametrize("field", [(MAG,), ()])
def test_a_steady_turn_of_the_force_is_no_bias_once_rest_has_told_it(field):
    """As in a plane that stands, and then circles."""
    turn = 0.3 * np.maximum(at(T) - 20.0, 0.0)
    bank = np.where(at(T) < 20.0, 0.0, 4.0)
    force = np.stack([bank * np.cos(turn), bank * np.sin(turn), np.full(len(T), -9.8)], axis=1)
    rested = at(T) < 20.0
    gyro = np.where(rested[:, np.newaxis], 0.0, TRUE)
    found = follow(gyro, body_of(force), *field, rest=rested, start=known(0.03)).known
    assert np.abs(found[0, :3]).max() < 2e-3


@pytest.mark.parametrize("gap", [5_000, 15_000])
def test_no_direction_is_compared_across_a_restart(gap):
    restart = FIRST | (np.arange(len(T)) == gap)
    gyro = measured().copy()
    found = follow(gyro, np.where(np.arange(len(T))[:, np.newaxis] < gap, ACCEL, -ACCEL)).known
    apart = follow(
        gyro, np.where(np.arange(len(T))[:, np.newaxis] < gap, ACCEL, -ACCEL), restart=restart
    ).known
    truth = np.concatenate([BIAS, S.ravel()])
    assert np.linalg.norm(apart[0] - truth) < np.linalg.norm(found[0] - truth)
