"""What a row tells of a run."""

from types import SimpleNamespace

import numpy as np
import pytest

from attest import pipeline, simulation
from attest.batch import rows
from attest.report.summary import _sensors
from attest.samples import Sensors
from attest.simulation.degrade import Degradation, degrade


@pytest.fixture(scope="module")
def summary_of(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rows")
    flight = degrade(
        simulation.simulate("handheld", 1), Degradation(bias={"mag": (5e-6, 0.0, -3e-6)})
    )
    simulation.write(folder / "flight.csv", flight)

    def summary(observer, **changed):
        configuration = pipeline.configure(observer, [f"{k}={v}" for k, v in changed.items()])
        return pipeline.run(folder / "flight.csv", configuration).summary

    return summary


def figures(summary):
    return rows._figures(summary)


def test_hard_iron_is_a_figure_of_the_row(summary_of):
    row = figures(summary_of("cgo"))
    found = [row[f"hard_iron_{axis}_ut"] for axis in "xyz"]
    assert found == pytest.approx([5.0, 0.0, -3.0], abs=0.3)
    assert row["iron"] == "applied"
    assert row["mag_latency_s"] == 0.0


def test_what_an_observer_finds_of_the_sensors_is_told_in_their_units():
    constants = {"hard_iron": np.array([0.1, 0.0, -0.2]), "gyro_scale": np.diag([0.01, 0.0, -0.02])}
    samples = SimpleNamespace(
        sensors=Sensors(mag_latency_s=0.02),
        names=("accel", "mag"),
        length=np.array([[9.8, 49e-6], [9.8, 50e-6], [9.8, 51e-6], [9.8, 9.0]]),
        valid=np.array([[True, True], [True, True], [True, True], [True, False]]),
    )
    result = SimpleNamespace(samples=samples, estimates=SimpleNamespace(constants=constants))
    assert _sensors(result) == {
        "gyro_scale": [0.01, 0.0, -0.02],
        "mag_latency_s": 0.02,
        "hard_iron_ut": pytest.approx([5.0, 0.0, -10.0]),
        "soft_iron": None,
        "iron": "applied",
    }


def test_iron_as_configured_says_so(summary_of):
    given = "{hard_iron: [1, 2, 3], soft_iron: [[1, 0, 0], [0, 0.9, 0], [0, 0, 1]]}"
    row = figures(summary_of("cgo", **{"conditioning.magnetometer.calibrate": given}))
    assert [row[f"hard_iron_{axis}_ut"] for axis in "xyz"] == pytest.approx([1.0, 2.0, 3.0])
    assert (row["iron"], row["soft_iron"]) == ("given", pytest.approx(0.1))


def test_what_is_not_looked_for_is_empty(summary_of):
    row = figures(summary_of("cgo", **{"conditioning.magnetometer.calibrate": "off"}))
    assert row["iron"] is row["hard_iron_x_ut"] is row["soft_iron"] is row["gyro_scale_x"] is None
