"""How often a steady series is called changed, and a changed one is not."""

from itertools import permutations
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import false_discovery_control, rankdata

from attest.fleet import change

DRAWS = {
    "normal": lambda rng, n: rng.normal(size=n),
    "student 2": lambda rng, n: rng.standard_t(2, n),
    "cauchy": lambda rng, n: rng.standard_cauchy(n),
    "lognormal": lambda rng, n: rng.lognormal(0.0, 1.0, n),
    "three values": lambda rng, n: rng.integers(0, 3, n).astype(float),
    "mostly zero": lambda rng, n: np.where(rng.random(n) < 0.7, 0.0, rng.normal(5.0, 1.0, n)),
}


@pytest.mark.parametrize("draw", DRAWS.values(), ids=DRAWS)
def test_steady_series_is_hardly_ever_called_changed(draw):
    rng, series = np.random.default_rng(1), 4000
    chances = [change.chance(draw(rng, 30), 1000) for _ in range(series)]
    found = np.mean(np.array(chances) <= change.CHANCE)
    assert found <= 0.01
    # of a chance that is right, the share below a bound is the bound
    assert np.mean(np.array(chances) <= 0.05) <= 0.05 + 4 * np.sqrt(0.05 * 0.95 / series)


def test_step_of_three_deviations_midway_through_twenty_flights_is_found():
    rng, series, found, near = np.random.default_rng(2), 400, 0, 0
    for _ in range(series):
        x = rng.normal(size=20) + 3.0 * (np.arange(20) >= 10)
        flagged = change.chance(x, 1000) <= change.CHANCE
        found += flagged
        near += flagged and abs(change.split(x)[0] - 10) <= 2
    assert found >= near >= 0.95 * series


@pytest.mark.parametrize(("count", "first"), [(45, 40), (45, 5), (45, 20), (30, 25), (100, 90)])
def test_step_of_ten_deviations_is_placed_at_its_flight(count, first):
    rng = np.random.default_rng(3)
    for _ in range(200):
        x = rng.normal(size=count) + 10.0 * (np.arange(count) >= first)
        assert change.split(x)[0] == first


def brute_force(x):
    """Return the statistic, transcribed: the largest difference of mean ranks by its deviation."""
    r, n, found = rankdata(x), len(x), [(0.0, -change.SIDE)]
    for parts in (1, 2, 4):
        for begin in range(2 * parts - 1):
            first, last = begin * n // (2 * parts), (begin + 2) * n // (2 * parts)
            if parts > 1 and last - first < change.SHORTEST:
                continue
            for k in range(first + change.SIDE, last - change.SIDE + 1):
                one, other = r[first:k], r[k:last]
                deviation = r.std(ddof=1) * np.sqrt(1 / len(one) + 1 / len(other))
                found.append((round(abs(one.mean() - other.mean()) / deviation, 9), -k))
    return max(found)


values = st.lists(st.integers(-5, 5).map(float), min_size=6, max_size=60).map(np.array)


@given(values.filter(lambda x: len(set(x)) > 1))
def test_statistic_is_the_largest_rank_sum_by_its_deviation(x):
    assert change.split(x)[1] == pytest.approx(brute_force(x)[0])


@given(values.filter(lambda x: len(set(x)) > 1), st.integers(1, 9))
def test_unit_and_origin_do_not_matter(x, scale):
    assert change.split(scale * x + 7.0) == change.split(x)


@pytest.mark.parametrize("x", [[0, 1, 2, 6, 7, 8, 9], [0, 0, 1, 5, 5, 5, 2], [3, 1, 2, 2, 9, 1, 0]])
def test_chance_is_the_share_of_orders_that_look_as_changed(x):
    x = np.array(x, float)
    observed = brute_force(x)[0]
    all_orders = [brute_force(np.array(order))[0] for order in permutations(x)]
    exact = np.mean(np.array(all_orders) >= observed - 1e-9)
    # after `SEEN` orders: by a fifth or so
    assert change.chance(x, 100_000) == pytest.approx(exact, rel=0.7)


def test_nothing_is_told_of_equal_values_or_too_few():
    assert change.chance(np.zeros(30), 1000) == 1.0
    assert change.chance(np.arange(5.0), 1000) == 1.0


@pytest.mark.parametrize(("zeros", "ones"), [(37, 3), (27, 3), (55, 3)])
@pytest.mark.parametrize("orders", [10_000, 400_000])
def test_chance_of_few_values_among_many_equal_ones_is_no_less_than_it_is(zeros, ones, orders):
    x = np.repeat([0.0, 1.0], [zeros, ones])
    at_an_end = 2.0 / comb(len(x), ones)  # of all, or of a half that they are in
    assert 0.3 * at_an_end <= change.chance(x, orders) <= max(4 * at_an_end, 5 / orders)


@given(values)
def test_deviations_are_those_from_the_median_of_the_first_values(x):
    expected = [np.abs(x[:k] - np.median(x[:k])).sum() for k in range(1, len(x) + 1)]
    assert change.deviations(x) == pytest.approx(expected)


def test_clear_change_of_many_flights_needs_no_orders():
    x = np.arange(20_000) % 7 + 100.0 * (np.arange(20_000) > 9_000)
    assert change.chance(x, 400_000) == 1.0 / 400_001
    assert change.split(x)[0] == 9_001


@given(st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=60))
def test_threshold_is_that_of_benjamini_and_hochberg(chances):
    limit = change.threshold(chances)
    adjusted = false_discovery_control(chances)
    expected = (adjusted <= change.SHARE_BY_CHANCE) & (np.array(chances) <= change.CHANCE)
    assert [p <= limit for p in chances] == expected.tolist()
