import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.stats import kstest

from attest.simulation import noise

N = 200_000


def rng():
    return np.random.default_rng(7)


def density(x):
    return np.exp(-1.0 / (1.0 - x * x))


def test_bump_has_its_distribution():
    area = quad(density, -1, 1)[0]
    spread = np.sqrt(quad(lambda x: x * x * density(x), -1, 1)[0] / area)
    x = noise.bump(2.0, (5000,), rng()) * spread / 2.0

    def cumulated(values):
        return np.array([quad(density, -1, value)[0] / area for value in values])

    assert kstest(x, cumulated).pvalue > 0.01


def test_bump_has_its_deviation_and_its_bounds():
    x = noise.bump(np.radians(30.0), (N, 3), rng())
    assert x.shape == (N, 3)
    assert_allclose(x.std(axis=0), np.radians(30.0), rtol=0.01)
    assert_allclose(x.mean(axis=0), 0.0, atol=0.005)
    assert np.abs(x).max() < 2.515 * np.radians(30.0)
    assert abs(np.corrcoef(x.T)[0, 1]) < 0.01


@pytest.mark.parametrize(
    ("draw", "mean", "std", "low", "high"),
    [
        (noise.uniform, 0.0, 0.05 / np.sqrt(3.0), -0.05, 0.05),
        (noise.rand, 0.025, 0.05 / np.sqrt(12.0), 0.0, 0.05),
        (noise.normal, 0.0, 0.05, -1.0, 1.0),
    ],
)
def test_draws_have_mean_deviation_and_bounds(draw, mean, std, low, high):
    x = draw(0.05, (N,), rng())
    assert x.mean() == pytest.approx(mean, abs=5e-4)
    assert x.std() == pytest.approx(std, rel=0.01)
    assert low <= x.min() < x.max() < high
    assert_array_equal(x, draw(0.05, (N,), rng()))


def test_sinusoids_have_their_lines_and_no_others():
    t = np.arange(1000) * 1e-3
    x = noise.sinusoids(t, {1.0: 1.2, 10.0: 0.7, 100.0: 0.5}, (2, 3), rng())
    assert x.shape == (1000, 2, 3)
    spectrum = 2.0 * np.abs(np.fft.rfft(x, axis=0)) / len(t)
    lines = np.zeros(501)
    lines[[1, 10, 100]] = 1.2, 0.7, 0.5
    assert_allclose(spectrum, np.broadcast_to(lines[:, None, None], spectrum.shape), atol=1e-10)
    phases = np.angle(np.fft.rfft(x, axis=0)[10])
    assert len(np.unique(np.round(phases, 6))) == 6


def test_a_wave_at_the_sampling_rate_is_a_constant():
    x = noise.sinusoids(np.arange(500) * 0.01, {100.0: 0.5}, (3,), rng())
    assert_allclose(x, np.broadcast_to(x[0], x.shape), atol=1e-9)


def test_turned_errs_by_its_angle_about_either_axis_across():
    u = np.array([0.0, 0.6, 0.8])
    v = noise.turned(u, noise.normal(np.radians(1.0), (N, 3), rng()))
    assert_allclose(np.linalg.norm(v, axis=-1), 1.0, atol=1e-12)
    across = np.degrees(v @ np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6]]).T)
    assert_allclose(across.std(axis=0), 1.0, rtol=0.01)
    assert_allclose(across.mean(axis=0), 0.0, atol=0.01)
