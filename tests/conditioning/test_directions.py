import numpy as np
from flights import FIELD, at, body, rate, resting, stamps, tumbling
from numpy.testing import assert_allclose
from scipy.signal import butter, lfilter

from attest.conditioning import directions, frame
from attest.geometry import quaternion

T = stamps(100.0, 60.0)
H = np.concatenate([[0.0], np.diff(T) * 1e-9])
NO = np.arange(len(T)) == 0
NONE = np.empty((0, 3))
D = frame.integrate(T, rate(tumbling, at(T) + 0.005))
STILL = np.tile([1.0, 0.0, 0.0, 0.0], (len(T), 1))


def low_passed(y, tau=3.0, weight=None, restart=NO, D=D):
    out = np.empty_like(y)
    weight = np.ones(len(y)) if weight is None else weight
    length = np.linalg.norm(y, axis=1)
    unit = y / np.maximum(length, 1e-30)[:, np.newaxis]
    vectors, tau, valid = (
        (unit, length, np.empty((0, 3))),
        np.full(len(y), tau),
        np.ones(len(y), bool),
    )
    directions.low_pass(H, D, vectors, weight, restart, tau, out, valid)
    return out


def direction(y):
    """Scale to unit length."""
    return y / np.maximum(np.linalg.norm(y, axis=-1, keepdims=True), 1e-30)


def believed(along, across, scale=0.1, valid=None, restart=NO, moving=0.0):
    out, gyro = np.empty(len(T)), np.full((len(T), 3), moving)
    valid = np.ones(len(T), bool) if valid is None else valid
    y = np.stack([np.zeros(len(T)), across, along], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (len(T), 1))
    field = (direction(y), np.linalg.norm(y, axis=1), up)
    directions.belief(H, field, gyro, valid, restart, scale, out)
    return out


def test_a_direction_of_the_world_is_left_as_it_is_however_the_body_turns():
    y = body(tumbling, at(T), FIELD)
    assert_allclose(low_passed(y), direction(y), atol=1e-4)


def test_noise_falls_and_no_turn_is_blurred():
    y = body(tumbling, at(T), [0.0, 0.0, -9.8])
    noisy = y + np.random.default_rng(0).normal(size=y.shape)
    assert np.abs(low_passed(noisy) - direction(y))[1000:].std() < 0.01


def test_it_is_the_butterworth_filter_of_second_order():
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(T), 1))
    y = np.tile([0.0, 0.0, 1.0], (len(T), 1))
    y[2000:] = [1.0, -2.0, 0.5]
    b, a = butter(2, np.sqrt(2.0) / 3.0, fs=2.0 * np.pi * 100.0)
    stepped = y[0] + lfilter(b, a, y - y[0], axis=0)
    assert_allclose(low_passed(y, D=still), direction(stepped), atol=0.02)


def test_at_first_it_is_the_mean():
    y = np.array([0.0, 1.0, 2.0]) + np.random.default_rng(1).normal(size=(len(T), 3))
    found, second = low_passed(y, D=STILL), int(np.sum(at(T) < 1.0))
    for i in (0, second - 1):  # in the first second of all of it, from its first sample
        assert_allclose(found[i], direction(y[:second].mean(axis=0)), atol=0.01)
    assert_allclose(found[2 * second], direction(y[: 2 * second + 1].mean(axis=0)), atol=0.01)


def test_turns_of_the_first_second_do_not_blur_it():
    y = body(tumbling, at(T), FIELD)
    assert_allclose(low_passed(y)[:100], direction(y[:100]), atol=1e-3)


def test_what_has_no_weight_is_held_in_the_gyroscopes_frame():
    y = body(tumbling, at(T), FIELD)
    spoilt = y.copy()
    spoilt[3000:] = [1e-3, 0.0, 0.0]
    weight = np.where(np.arange(len(T)) < 3000, 1.0, 0.0)
    assert_allclose(low_passed(spoilt, weight=weight), direction(y), atol=1e-3)


def test_after_a_restart_nothing_is_left_of_before():
    y = body(resting, at(T), FIELD)
    y[:3000] = [1.0, 2.0, 3.0]
    restart = NO | (np.arange(len(T)) == 3000)
    found = low_passed(y, restart=restart, D=STILL)
    assert_allclose(found[3000], direction(y[3000]), atol=1e-12)
    assert_allclose(found[2999], direction(y[2999]), atol=1e-12)


def test_a_field_as_usual_is_believed_and_a_disturbed_one_is_not():
    along, across = np.full(len(T), -40.0), np.full(len(T), 20.0)
    assert_allclose(believed(along, across), 1.0)
    across[3000:3200] += 10.0
    weight = believed(along, across)
    assert weight[3000] < 0.2
    assert weight[3300] > 0.9


def test_half_is_believed_at_the_scale():
    along, across = np.full(len(T), -30.0), np.full(len(T), 40.0)
    along[3000] += 5.0
    assert_allclose(believed(along, across, scale=0.1)[3000], 0.5, atol=1e-9)


def test_a_field_that_stays_changed_is_believed_again():
    along, across = np.full(len(T), -40.0), np.full(len(T), 20.0)
    across[1500:] += 6.0
    weight = believed(along, across)
    assert weight[1500] < 0.5
    assert weight[-1] > 0.6


def test_strength_is_compared_as_a_share_so_that_units_do_not_matter():
    rng = np.random.default_rng(2)
    along, across = -40.0 + rng.normal(size=len(T)), 20.0 + rng.normal(size=len(T))
    assert_allclose(believed(along, across), believed(1e-6 * along, 1e-6 * across), rtol=1e-9)


def test_turned_frames_give_turned_vectors():
    y = body(tumbling, at(T), FIELD) + 1e-5 * np.random.default_rng(5).normal(size=(len(T), 3))
    q = quaternion.normalize(np.array([0.3, -0.5, 0.1, 0.8]))
    assert_allclose(low_passed(y, D=quaternion.multiply(q, D)), low_passed(y), atol=1e-12)


def test_another_field_that_stays_while_the_body_moves_is_the_usual_one_after_a_while():
    along = np.where(at(T) < 20.0, 30.0, 50.0)
    across = np.full(len(T), 20.0)
    still, moving = (believed(along, across, moving=rate) for rate in (0.0, 0.5))
    assert still[-1] < 0.2
    assert moving[at(T) < 43.0][-1] < 0.2
    assert moving[at(T) > 48.0].min() > 0.9


def test_a_wrong_field_at_the_start_does_not_starve_the_right_one():
    along = np.where(at(T) < 5.0, 300.0, 40.0)
    belief = believed(along, np.full(len(T), 20.0), moving=0.5)
    assert belief[at(T) > 50.0].min() > 0.9


def test_memory_that_grows_starts_from_what_there_is():
    y = body(tumbling, at(T), FIELD)
    drifting = frame.integrate(T, rate(tumbling, at(T) + 0.005) + np.array([0.0, 0.0, 0.0873]))
    tau = np.where(at(T) < 10.0, 0.3, 9.0)
    out = low_passed(y, tau, D=drifting)
    off = np.rad2deg(np.arccos(np.clip(np.sum(out * direction(y), axis=1), -1.0, 1.0)))
    assert off[:1000].max() < 2.0
    assert off[1000:1030].max() < 2.0
