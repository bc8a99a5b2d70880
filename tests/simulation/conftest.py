"""Flights that several tests look at, flown once."""

from functools import cache

import pytest

from attest import simulation


@pytest.fixture(scope="session")
def simulated():
    """Return a function of scenario and seed that flies each once."""
    return cache(simulation.simulate)
