"""Covariance adaptation: the tutorial's equations, and what a search must do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from attest.tuning import search
from attest.tuning.search import POINTS, Spread

sizes = st.integers(1, 6)
seeds = st.integers(0, 1000)


def bowl(middle, stretch):
    """Return a quadratic function with its least value at a point, long and narrow aslant."""
    n = len(middle)
    Q, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((n, n)))
    H = Q @ np.diag(np.geomspace(1.0, stretch, n)) @ Q.T
    return lambda points: np.einsum("ij,jk,ik->i", points - middle, H, points - middle)


@given(n=sizes, seed=seeds)
def test_finds_the_bottom_of_a_narrow_bowl(n, seed):
    middle = np.random.default_rng(seed).uniform(0.2, 0.8, n)
    found, value = search.least(bowl(middle, 100.0), np.full(n, 0.5), 200, seed)
    assert_allclose(found, middle, atol=0.01)
    assert value < 1e-3


@given(n=sizes, seed=seeds)
def test_stays_inside_and_finds_a_bottom_at_the_border(n, seed):
    asked = []
    outside = bowl(np.full(n, 1.4), 1.0)
    found, _ = search.least(
        lambda points: asked.append(points) or outside(points), np.full(n, 0.5), 100, seed
    )
    every = np.concatenate(asked)
    assert every.min() >= 0.0
    assert every.max() <= 1.0
    assert_allclose(found, 1.0, atol=1e-3)


@given(n=sizes, seed=seeds, generations=st.integers(0, 3))
def test_is_never_worse_than_the_start_and_repeats_itself(n, seed, generations):
    def rough(points):
        return np.sin(1e3 * points).sum(axis=1)

    start = np.full(n, 0.3)
    found = [search.least(rough, start, generations, seed) for _ in range(2)]
    assert_allclose(found[0][0], found[1][0], rtol=0.0)
    assert found[0][1] == rough(found[0][0][np.newaxis])[0] <= rough(start[np.newaxis])[0]


def test_goes_around_what_has_no_value():
    middle = np.array([0.7, 0.4])

    def holed(points):
        return np.where(points[:, 0] + points[:, 1] < 0.9, np.inf, bowl(middle, 1.0)(points))

    found, _ = search.least(holed, np.array([0.2, 0.2]), 100, 0)
    assert_allclose(found, middle, atol=0.01)


def test_start_is_what_is_left_where_nothing_has_a_value():
    start = np.array([0.2, 0.9])
    found, value = search.least(lambda points: np.full(len(points), np.inf), start, 30, 0)
    assert found is start
    assert value == np.inf


def test_tells_the_best_of_each_generation():
    told = []
    search.least(bowl(np.array([0.7, 0.4]), 1.0), np.array([0.2, 0.2]), 5, 0, told.append)
    assert len(told) == 5
    assert told == sorted(told, reverse=True)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_learning_is_that_of_the_tutorial(n):
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n, n))
    before = Spread(
        m=rng.random(n),
        C=A @ A.T + np.eye(n),
        p_s=0.1 * rng.standard_normal(n),
        p_c=0.1 * rng.standard_normal(n),
        sigma=0.17,
        count=3,
    )
    points, values = rng.random((POINTS, n)), rng.standard_normal(POINTS)
    after = search.learnt(before, search.rates_of(n), points, values)

    # Fig. 6 and Table 1, transcribed
    lam, mu = POINTS, POINTS // 2
    w = np.array([np.log((lam + 1) / 2) - np.log(i) for i in range(1, mu + 1)])
    w /= w.sum()
    mu_eff = w.sum() ** 2 / (w**2).sum()
    c_s = (mu_eff + 2) / (n + mu_eff + 5)
    d_s = 1 + 2 * max(0, np.sqrt((mu_eff - 1) / (n + 1)) - 1) + c_s
    c_c = (4 + mu_eff / n) / (n + 4 + 2 * mu_eff / n)
    c_1 = 2 / ((n + 1.3) ** 2 + mu_eff)
    c_mu = min(1 - c_1, 2 * (1 / 4 + mu_eff + 1 / mu_eff - 2) / ((n + 2) ** 2 + 2 * mu_eff / 2))
    chi = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
    best = points[np.argsort(values)][:mu]
    y = [(x - before.m) / before.sigma for x in best]
    y_w = sum(w_i * y_i for w_i, y_i in zip(w, y, strict=True))
    D2, B = np.linalg.eigh(before.C)
    root = B @ np.diag(D2**-0.5) @ B.T
    p_s = (1 - c_s) * before.p_s + np.sqrt(c_s * (2 - c_s) * mu_eff) * root @ y_w
    long = np.linalg.norm(p_s) / np.sqrt(1 - (1 - c_s) ** (2 * 4))
    h = 1.0 if long < (1.4 + 2 / (n + 1)) * chi else 0.0
    p_c = (1 - c_c) * before.p_c + h * np.sqrt(c_c * (2 - c_c) * mu_eff) * y_w
    C = (1 + c_1 * (1 - h) * c_c * (2 - c_c) - c_1 - c_mu) * before.C + c_1 * np.outer(p_c, p_c)
    C = C + c_mu * sum(w_i * np.outer(y_i, y_i) for w_i, y_i in zip(w, y, strict=True))
    step = c_s / d_s * (np.linalg.norm(p_s) / chi - 1)

    assert_allclose(after.m, before.m + before.sigma * y_w)
    assert_allclose(after.p_s, p_s)
    assert_allclose(after.p_c, p_c)
    assert_allclose(after.C, C)
    assert_allclose(after.sigma, before.sigma * np.exp(min(1.0, step)))
