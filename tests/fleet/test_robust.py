"""Slopes and odd values against SciPy."""

import numpy as np
import pytest
from scipy.stats import t as student
from scipy.stats import theilslopes

from attest.fleet import robust


def test_slope_is_that_of_theil_and_sen():
    rng = np.random.default_rng(3)
    t, x = np.sort(rng.uniform(0, 9, 60)), rng.normal(size=60)
    assert robust.slope(t, x) == pytest.approx(theilslopes(x, t)[0])


def test_slope_of_many_flights_is_near_whatever_a_fifth_of_them_is():
    rng = np.random.default_rng(4)
    t = np.sort(rng.uniform(0, 10, 5000))
    x = 2.0 * t + rng.normal(size=5000)
    x[rng.random(5000) < 0.2] = 1e3
    assert robust.slope(t, x) == pytest.approx(2.0, abs=0.3)


def test_no_slope_where_time_stands_still():
    assert np.isnan(robust.slope(np.zeros(4), np.arange(4.0)))


@pytest.mark.parametrize("freedom", [6.3, 13.3, 70.0])
@pytest.mark.parametrize("value", [0.1, 1.0, 3.0, 8.0])
def test_tail_is_that_of_student(value, freedom):
    assert robust.student(value, freedom) == pytest.approx(2 * student.sf(value, freedom), rel=0.15)


@pytest.mark.parametrize("n", [10, 20, 60])
def test_normal_flights_are_hardly_ever_odd(n):
    rng, flights = np.random.default_rng(5), 40_000
    chances = np.concatenate([robust.odd(rng.normal(size=n)) for _ in range(flights // n)])
    assert np.mean(chances < 1e-3) < 3e-3
    assert np.sum(chances * flights < 0.05) <= 2


def test_odd_flight_is_told_and_those_that_do_not_scatter_are_not():
    x = np.append(np.random.default_rng(6).normal(size=20), 15.0)
    assert np.argmin(robust.odd(x)) == 20
    assert robust.odd(x)[20] < 1e-6
    assert (robust.odd(np.append(np.zeros(20), 9.0)) == 1.0).all()
