import numpy as np
import pytest
from flights import START, Turning, at, stamps
from numpy.testing import assert_allclose

from attest.conditioning import specific_force as sf


def polynomial(seconds, *powers):
    return sum(np.outer(seconds**i, c) for i, c in enumerate(powers))


@pytest.mark.parametrize("rate", [5.0, 50.0])
def test_level_and_slope_of_a_straight_line_are_exact(rate):
    t, stamps_ = stamps(100.0, 20.0), stamps(rate, 20.0)
    a, b = np.array([1.0, -2.0, 30.0]), np.array([0.5, 0.0, -4.0])
    level, slope = sf.smooth(t, stamps_, polynomial(at(stamps_), a, b), 0.5)
    inside = at(t) < at(stamps_)[-1] + 0.5
    assert_allclose(level[inside], polynomial(at(t), a, b)[inside], atol=1e-9)
    assert_allclose(slope[inside], np.broadcast_to(b, slope.shape)[inside], atol=1e-9)


def test_slope_of_a_parabola_is_its_derivative_away_from_the_ends():
    t = stamps(50.0, 20.0)
    a = np.array([0.0, 1.0, -3.0])
    _, slope = sf.smooth(t, t, 0.5 * polynomial(at(t), a * 0, a * 0, a), 0.5)
    middle = slice(100, -100)
    assert_allclose(slope[middle], np.outer(at(t), a)[middle], atol=0.01)


def test_smoothing_is_the_gaussian_weighted_line_around_each_time():
    rng = np.random.default_rng(2)
    t, sigma = stamps(2.0, 6.0), 0.7003
    stamps_ = np.sort(rng.choice(np.arange(6_000), 200, replace=False)) * 1_000_000 + START
    y = rng.normal(size=(200, 3))
    level, slope = sf.smooth(t, stamps_, y, sigma)
    for i in range(len(t)):
        x = (stamps_ - t[i]) * 1e-9
        near = np.abs(x) <= 3.0 * sigma
        fit = np.polyfit(x[near], y[near], 1, w=np.exp(-0.25 * (x[near] / sigma) ** 2))
        assert_allclose(slope[i], fit[0], atol=1e-9)
        assert_allclose(level[i], fit[1], atol=1e-9)


def test_where_too_few_samples_are_in_reach_nothing_is_made_up():
    t = stamps(10.0, 20.0)
    stamps_ = t[:50]  # the first five seconds only
    level, slope = sf.smooth(t, stamps_, np.ones((50, 3)), 0.5)
    known = np.isfinite(level).all(axis=1)
    assert known[:50].all()
    assert not known[70:].any()
    assert (np.isfinite(slope) == np.isfinite(level)).all()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_samples_have_no_line(count):
    t = stamps(10.0, 1.0)
    level, slope = sf.smooth(t, t[:count], np.ones((count, 3)), 0.5)
    assert np.isnan(level).all()
    assert np.isnan(slope).all()


@pytest.mark.parametrize("lag", [-0.3, 0.0, 0.17, 0.5])
def test_the_lag_of_the_velocity_is_found(lag):
    t = stamps(50.0, 120.0)
    force = Turning(period=20.0).specific_force
    expected = np.linalg.norm(force(at(t) - lag), axis=1)
    measured = np.linalg.norm(force(at(t)), axis=1)
    measured += 0.1 * np.random.default_rng(0).normal(size=len(t))
    found, deviation = sf.find_lag(at(t), expected, measured)
    assert found == pytest.approx(lag, abs=0.02)
    assert deviation < 0.05


@pytest.mark.parametrize("seed", range(8))
def test_a_lag_that_little_motion_tells_counts_by_how_sure_it_is(seed):
    t = stamps(50.0, 6.0)
    force = Turning(period=20.0).specific_force
    blurred = np.convolve(np.random.default_rng(seed).normal(size=len(t)), np.ones(50) / 15.0)
    expected = np.linalg.norm(force(at(t) - 0.2), axis=1)
    found = sf.find_lag(at(t), expected, np.linalg.norm(force(at(t)), axis=1) + blurred[: len(t)])
    if found is not None:
        lag, deviation = found
        assert abs(lag - 0.2) < 3.0 * np.hypot(deviation, sf.USUAL)
        assert abs(lag) < abs(lag) * (1.0 + (deviation / sf.USUAL) ** 2) <= 1.0


def test_a_restart_makes_no_lag_more_certain():
    t, force = stamps(50.0, 6.0), Turning(period=20.0).specific_force
    noise = np.random.default_rng(0).normal(size=len(t))
    measured = (
        np.linalg.norm(force(at(t)), axis=1) + np.convolve(noise, np.ones(50) / 15.0)[: len(t)]
    )
    expected, x = np.linalg.norm(force(at(t) - 0.2), axis=1), at(t)
    lag, deviation = sf.find_lag(x, expected, measured)
    later = np.where(np.arange(len(x)) < len(x) // 2, 0.0, 1e4)
    again, then = sf.find_lag(x + later, expected, measured)
    assert (again, then) == (pytest.approx(lag, abs=0.1), pytest.approx(deviation, rel=0.2))


def test_the_lag_cannot_be_told_without_motion_or_where_nothing_fits():
    t = at(stamps(50.0, 60.0))
    rng = np.random.default_rng(1)
    still = 9.81 + 0.01 * rng.normal(size=len(t))
    assert sf.find_lag(t, still, still) is None
    noise = 9.81 + rng.normal(size=(2, len(t)))
    assert sf.find_lag(t, *noise) is None
    assert sf.find_lag(t, np.full(len(t), np.nan), still) is None
    assert sf.find_lag(t[:10], noise[0, :10], noise[0, :10]) is None


def test_lowest_is_the_vertex_of_the_parabola():
    assert sf.lowest(np.array([(x - 0.3) ** 2 for x in (-1, 0, 1)])) == pytest.approx(0.3)
    assert sf.lowest(np.array([1.0, 1.0, 1.0])) == 0.0


def test_velocity_explains_the_accelerometer_if_it_fits_no_worse_than_gravity():
    t = at(stamps(50.0, 60.0))
    measured = np.linalg.norm(Turning().specific_force(t), axis=1)
    assert sf.explains(measured, measured, 9.80665)
    assert not sf.explains(measured + 5.0, measured, 9.80665)
    assert not sf.explains(np.full(len(t), np.nan), measured, 9.80665)
    gaps = np.where(np.arange(len(t)) % 2, np.nan, measured)
    assert sf.explains(gaps, measured, 9.80665)
