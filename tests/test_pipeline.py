"""Golden numbers: what one run finds on each log, to a stated tolerance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from attest import pipeline, simulation
from attest.errors import ReadError
from attest.recording import Signal
from attest.result import Result


def run(log: Path, *assignments: str) -> Result:
    return pipeline.run(log, pipeline.configure("fts", assignments))


def texts(result: Result) -> str:
    return "\n".join(note.text for note in result.notes)


@pytest.fixture(scope="module")
def quadcopter(sample_logs):
    return run(sample_logs / "quadcopter.tlog")


def test_sample_flight_is_within_a_degree_and_a_half_of_its_truth(quadcopter):
    metrics = quadcopter.metrics
    assert (metrics.reference, metrics.kind) == ("SIMSTATE", "truth")
    assert metrics.total.rmse < 1.5
    assert metrics.total.rmse == pytest.approx(1.37, abs=0.1)
    assert metrics.inclination.rmse == pytest.approx(0.70, abs=0.1)


def test_sample_flight_finds_its_gyroscope_bias(quadcopter):
    # the simulator adds (0.02, -0.015, 0.01) rad/s; truth and RAW_IMU are quantised and sampled
    assert quadcopter.metrics.bias_true == pytest.approx((0.02, -0.015, 0.01), abs=2e-3)
    assert quadcopter.metrics.bias_error < 0.001


def test_sample_flight_tells_of_its_outage_and_its_references(quadcopter):
    assert "gap in the gyroscope bridged by interpolation, the longest 1.54 s" in texts(quadcopter)
    assert list(quadcopter.recording.references) == ["SIMSTATE", "ATTITUDE"]
    assert quadcopter.summary["log"]["restarts"] == 0


def test_without_velocity_or_place_the_notes_say_what_is_taken_instead(sample_logs):
    result = run(
        sample_logs / "quadcopter.tlog",
        "vectors=[{signal: accel, reference: gravity}, {signal: mag, reference: north}]",
    )
    assert "accelerometer's reference: gravity, as asked" in texts(result)
    assert "magnetic reference: magnetic north, dip" in texts(result)
    assert result.metrics.total.rmse > 3.0  # it flies: gravity alone is no known vector


def test_reference_none_leaves_the_figures_of_consistency(sample_logs):
    result = run(sample_logs / "quadcopter.tlog", "evaluation.reference=none")
    assert result.metrics is None
    assert result.summary["metrics"] is None
    assert result.summary["consistency"]["s_norm_rms"] > 0.0
    assert result.summary["consistency"]["field_ut_median"] == pytest.approx(48.2, abs=1.0)


def test_start_and_end_cut_the_log(sample_logs):
    result = run(sample_logs / "quadcopter.tlog", "input.start_s=10", "input.end_s=20")
    # the velocity outside, which the gyroscope does not lead to, is not judged
    assert not any("velocity" in n.text and "left out" in n.text for n in result.notes)
    span = (result.estimates.t[-1] - result.estimates.t[0]) * 1e-9
    assert span == pytest.approx(10.0, abs=0.05)


def test_effective_configuration_reproduces_the_estimates_bit_for_bit(sample_logs, quadcopter):
    from attest import config
    from attest.observers import fts

    again = config.validate(fts.Config, quadcopter.configuration, "saved")
    estimates = pipeline.run(sample_logs / "quadcopter.tlog", again).estimates
    assert np.array_equal(estimates.q, quadcopter.estimates.q)


@pytest.mark.shared
def test_quadplane_is_within_three_degrees_of_the_simulator(shared):
    result = run(shared / "tlog" / "quadplane_sitl.tlog")
    metrics = result.metrics
    assert (metrics.reference, metrics.kind) == ("SIMSTATE", "truth")
    assert metrics.total.rmse == pytest.approx(2.35, abs=0.04)
    assert metrics.total.median == pytest.approx(1.2, abs=0.1)
    assert sum("reboot" in note.text for note in result.notes) == 1


@pytest.mark.shared
def test_plain_gravity_fails_on_a_quadplane_in_its_turns(shared):
    gravity = "vectors=[{signal: accel, reference: gravity}, {signal: mag}]"
    assert run(shared / "tlog" / "quadplane_sitl.tlog", gravity).metrics.total.rmse > 15.0


@pytest.mark.shared
def test_rov_is_within_three_degrees_of_its_autopilot_after_heading_offset(shared):
    result = run(shared / "tlog" / "bluerov2.tlog")
    metrics = result.metrics
    assert (metrics.reference, metrics.kind) == ("ATTITUDE", "autopilot")
    assert metrics.without_heading_offset.rmse == pytest.approx(2.79, abs=0.05)
    assert metrics.inclination.rmse == pytest.approx(1.75, abs=0.1)
    assert metrics.bias_true is None  # an autopilot's attitude tells no true bias


@pytest.mark.shared
def test_damaged_log_works_and_counts_its_bad_frames(shared):
    result = run(shared / "tlog" / "bluerov2_bad_crc.tlog")
    bad = next(note for note in result.notes if "bad frames" in note.text)
    assert bad.count == 1967
    assert result.metrics.inclination.rmse < 2.0


@pytest.mark.shared
@pytest.mark.parametrize("name", ["attitude_only.tlog", "one_message.tlog"])
def test_log_without_inertial_data_says_so_in_one_line(shared, name):
    with pytest.raises(ReadError, match="no gyroscope") as caught:
        run(shared / "tlog" / name)
    assert "\n" not in str(caught.value)
    assert str(shared / "tlog" / name) in str(caught.value)


def test_what_cannot_be_is_among_the_warnings_of_a_run(tmp_path):
    made = simulation.simulate("handheld")
    gyro = made.signals["gyro"]
    signals = {**made.signals, "gyro": Signal(gyro.t, np.rad2deg(gyro.y))}
    simulation.write(tmp_path / "flight.csv", replace(made, signals=signals))
    warnings = run(tmp_path / "flight.csv").summary["warnings"]
    assert any("its unit seems to be deg/s" in note["text"] for note in warnings)
