import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from strategies import anywhere, rotations, small

from attest.evaluation import errors
from attest.geometry import quaternion

near = st.floats(-1.0, 1.0)


def scipy_of(q):
    return Rotation.from_quat(quaternion.to_xyzw(q))


@given(rotations, rotations)
def test_total_error_is_the_angle_that_scipy_finds(q, r):
    total = errors.angles(errors.attitude_error(q, r))[0]
    assert_allclose(total, (scipy_of(q) * scipy_of(r).inv()).magnitude(), atol=1e-7)


@given(rotations, rotations)
def test_inclination_is_the_angle_between_the_two_verticals(q, r):
    inclination = errors.angles(errors.attitude_error(q, r))[2]
    turned = (scipy_of(q) * scipy_of(r).inv()).apply([0.0, 0.0, 1.0])
    expected = np.arctan2(np.hypot(turned[0], turned[1]), turned[2])
    assert_allclose(inclination, expected, atol=1e-7)


@given(rotations, rotations)
def test_total_is_made_of_heading_and_inclination(q, r):
    total, heading, inclination = errors.angles(errors.attitude_error(q, r))
    product = np.cos(0.5 * heading) * np.cos(0.5 * inclination)
    assert_allclose(np.cos(0.5 * total), product, atol=1e-12)
    assert max(heading, inclination) <= total + 1e-12


@given(rotations)
def test_errors_are_angles_up_to_half_a_turn_for_either_sign(q_e):
    ours = errors.angles(q_e)
    assert (ours >= 0.0).all()
    assert (ours <= np.pi + 1e-12).all()
    assert_allclose(errors.angles(-q_e), ours, atol=1e-15)


@given(small)
def test_small_errors_keep_their_digits(q_e):
    assert_allclose(errors.angles(q_e)[0], 1e-7, rtol=1e-9)


@given(near)
def test_a_turn_about_the_vertical_is_heading_alone(psi):
    total, heading, inclination = errors.angles(quaternion.exp(np.array([0.0, 0.0, psi])))
    assert_allclose([total, heading, inclination], [abs(psi), abs(psi), 0.0], atol=1e-12)


@given(near, near)
def test_a_turn_about_a_level_axis_is_inclination_alone(x, y):
    total, heading, inclination = errors.angles(quaternion.exp(np.array([x, y, 0.0])))
    tilt = np.hypot(x, y)
    assert_allclose([total, heading, inclination], [tilt, 0.0, tilt], atol=1e-12)


@given(rotations, rotations, near)
def test_the_error_is_in_the_world(q, r, psi):
    """A heading added in the world is a heading error, however the body is turned."""
    off = quaternion.multiply(quaternion.exp(np.array([0.0, 0.0, psi])), r)
    assert_allclose(
        errors.angles(errors.attitude_error(off, r)), [abs(psi), abs(psi), 0], atol=1e-7
    )
    body = errors.attitude_error(quaternion.multiply(q, r), quaternion.multiply(r, r))
    assert_allclose(np.linalg.norm(body), 1.0, atol=1e-12)


def test_statistics_are_numpys():
    e = np.random.default_rng(0).exponential(size=501)
    s = errors.statistics(e)
    assert s.rmse == pytest.approx(np.sqrt(np.mean(e * e)))
    assert s.mean == pytest.approx(e.mean())
    assert s.median == pytest.approx(np.median(e))
    assert s.p95 == pytest.approx(np.percentile(e, 95))
    assert s.max == e.max()


@given(anywhere)
def test_mean_rotation_of_one_is_itself_for_any_signs(q):
    signs = np.array([[1.0], [-1.0], [1.0]])
    mean = errors.mean_rotation(signs * q)
    assert_allclose(abs(mean @ q), 1.0, atol=1e-12)
    assert mean[0] >= 0.0


def test_mean_rotation_is_scipys():
    spread = Rotation.from_rotvec(0.3 * np.random.default_rng(1).normal(size=(200, 3)))
    turned = spread * Rotation.from_rotvec([1.0, -2.0, 0.5])
    ours = errors.mean_rotation(quaternion.from_xyzw(turned.as_quat()))
    assert_allclose((scipy_of(ours) * turned.mean().inv()).magnitude(), 0.0, atol=1e-9)


@given(st.floats(-3.1, 3.1), st.integers(0, 50))
def test_a_constant_heading_is_found_among_noise(psi, seed):
    noise = 0.1 * np.random.default_rng(seed).normal(size=(400, 3))
    q_e = quaternion.multiply(quaternion.exp(np.array([0.0, 0.0, psi])), quaternion.exp(noise))
    off = errors.heading_offset(q_e) - psi
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 0.05


@given(st.floats(-3.1, 3.1))
def test_a_constant_heading_that_is_taken_out_leaves_nothing(psi):
    q_e = np.stack([quaternion.exp(np.array([0.0, 0.0, psi]))] * 3)
    assert errors.heading_offset(q_e) == pytest.approx(psi, abs=1e-12)
    assert errors.angles(errors.turned(q_e, psi)).max() < 1e-12


@given(st.integers(0, 50))
def test_no_other_heading_leaves_a_smaller_error(seed):
    noise = np.random.default_rng(seed).normal(size=(20, 4))
    q_e = quaternion.normalize(noise + np.array([3.0, 0.0, 0.0, 0.0]))
    psi = errors.heading_offset(q_e)

    def left(turn):
        return np.sum(np.sin(0.5 * errors.angles(errors.turned(q_e, turn))[:, 0]) ** 2)

    assert left(psi) <= min(left(psi + off) for off in np.linspace(-3.0, 3.0, 61)) + 1e-12


@pytest.mark.parametrize(
    ("total", "first"),
    [
        ([9, 8, 3, 2, 1], 2),
        ([9, 1, 9, 1, 1], 3),
        ([1, 1, 1], 0),
        ([9, 9, 9], None),
        ([1, 1, 5.0], None),
        ([1], 0),
    ],
)
def test_settling_is_from_where_the_error_stays_below_the_bound(total, first):
    assert errors.settling(np.array(total, float), 5.0) == first
