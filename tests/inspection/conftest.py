"""Simulated flights, as they are read."""

import pytest

from attest import readers, simulation


@pytest.fixture(scope="module", params=["handheld", "quadcopter", "fixed-wing"])
def log(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / f"{request.param}.csv"
    simulation.write(path, simulation.simulate(request.param))
    return readers.read(path)
