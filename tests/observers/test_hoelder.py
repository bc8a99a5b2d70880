import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from attest.observers import hoelder

EXPONENTS = (0.0, 1.0 - 1.0 / 1.1, 0.3, 0.4999)


@pytest.mark.parametrize("a", EXPONENTS)
def test_a_table_gives_the_power_over_the_whole_range(a):
    table = hoelder.powers(a)
    cells = 1.0 + np.arange(hoelder.CELLS) / hoelder.CELLS
    edges = np.concatenate([cells, np.nextafter(cells, 0.0), np.nextafter(cells, 2.0)])
    x = (edges * 2.0 ** np.arange(-1030, 1023)[:, np.newaxis]).ravel()
    x = x[x > 0.0]
    found = np.array([hoelder.raised(each, table) for each in x[:: 1 + len(x) // 100_000]])
    exact = np.array([math.pow(each, -a) for each in x[:: 1 + len(x) // 100_000]])
    np.testing.assert_allclose(found, exact, rtol=1e-14)


@given(x=st.floats(1e-30, 1e19), a=st.floats(0.0, 0.5))
def test_a_table_gives_the_power(x, a):
    assert hoelder.raised(x, hoelder.powers(a)) == pytest.approx(math.pow(x, -a), rel=1e-14)


@pytest.mark.parametrize("a", EXPONENTS)
@pytest.mark.parametrize("x", [5e-324, 1e-310, 2.0**-100, 2.0**64, 1e308, np.inf, np.nan])
def test_a_table_gives_the_power_of_what_it_does_not_hold(x, a):
    with np.errstate(divide="ignore"):
        exact = np.float64(x) ** -a
    assert hoelder.raised(x, hoelder.powers(a)) == pytest.approx(exact, rel=1e-14, nan_ok=True)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="plain Python raises at zero")
def test_a_table_gives_the_power_of_zero():
    assert hoelder.raised(0.0, hoelder.powers(0.3)) == np.inf


@pytest.mark.parametrize("size", [0.0, 1e-20, 1e-3, 5.0])
def test_a_vectors_factor_is_the_same_by_a_table(size):
    x = (size, -0.5 * size, 0.1 * size)
    by_table = hoelder.tabled(x, hoelder.powers(0.09))
    assert by_table == pytest.approx(hoelder.power(x, 0.09), rel=1e-14)
