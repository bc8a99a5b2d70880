from dataclasses import replace

import numpy as np
import pytest
from flights import SECOND, START, at, flight, rate, resting, stamps, tumbling
from flights import samples as samples_of
from numpy.testing import assert_allclose

from attest.config import Evaluation
from attest.errors import ConfigError
from attest.estimates import Estimates
from attest.evaluation import choose, evaluate
from attest.geometry import quaternion
from attest.recording import Reference

T = stamps(50.0, 60.0)
AS_IT_IS = Evaluation()


def estimates_of(q, t=T, attitude=tumbling, bias=(0.0, 0.0, 0.0)):
    n = len(t)
    return Estimates(
        observer="fts",
        t=t,
        q=quaternion.continuous(q),
        angular_velocity=rate(attitude, at(t)),
        gyro_bias=np.broadcast_to(bias, (n, 3)),
        s_norm=np.zeros(n),
        cost=np.zeros(n),
        updated=np.ones((n, 0), np.bool_),
    )


def made_samples(t=T, attitude=tumbling, bias=(0.0, 0.0, 0.0)):
    gyro = rate(attitude, at(t)) + np.array(bias)
    return samples_of(t, gyro, np.empty((len(t), 0, 3)), np.empty((1, 0, 3)))


def reference_of(t=T, attitude=tumbling, kind="truth", shift=0):
    return Reference("SIMSTATE", kind, t + shift, quaternion.continuous(attitude(at(t))))


def score(q=None, reference=None, config=AS_IT_IS, **other):
    q = tumbling(at(T)) if q is None else q
    reference = reference or reference_of()
    return evaluate(made_samples(), estimates_of(q, **other), reference, config)


def test_a_perfect_estimate_has_no_error():
    metrics, notes = score()
    assert metrics.total.max < 1e-5
    assert metrics.scored == len(T)
    assert metrics.settling_time_s == 0.0
    assert metrics.after_settling == metrics.total
    assert (metrics.reference, metrics.kind, notes) == ("SIMSTATE", "truth", ())


def test_errors_are_in_degrees_and_told_apart():
    off = quaternion.from_euler(np.array(0.0), np.array(0.02), np.array(0.1))
    metrics, _ = score(quaternion.multiply(off, tumbling(at(T))))
    assert metrics.heading.median == pytest.approx(np.rad2deg(0.1), rel=1e-3)
    assert metrics.inclination.median == pytest.approx(np.rad2deg(0.02), rel=1e-3)
    assert metrics.total.median == pytest.approx(np.rad2deg(np.hypot(0.1, 0.02)), rel=1e-3)
    halves = np.cos(np.deg2rad(metrics.error_deg) / 2)
    assert_allclose(halves[:, 0], halves[:, 1] * halves[:, 2], atol=1e-12)


def test_a_constant_heading_offset_is_told_and_the_error_without_it():
    turn = quaternion.exp(np.array([0.0, 0.0, -0.3]))
    metrics, _ = score(quaternion.multiply(turn, tumbling(at(T))))
    assert metrics.heading_offset_deg == pytest.approx(np.rad2deg(-0.3), abs=1e-6)
    assert metrics.total.rmse == pytest.approx(np.rad2deg(0.3), abs=1e-6)
    assert metrics.without_heading_offset.max < 1e-4


def test_a_constant_heading_offset_is_taken_out_on_request():
    turn = quaternion.exp(np.array([0.0, 0.0, -0.3]))
    q = quaternion.multiply(turn, tumbling(at(T)))
    metrics, _ = score(q, config=Evaluation(apply_heading_offset=True))
    assert metrics.total.max < 1e-4
    assert metrics.heading_offset_deg == pytest.approx(np.rad2deg(-0.3), abs=1e-6)


MOUNTED = quaternion.exp(np.array([0.05, -0.1, 0.2]))


def test_a_sensor_mounted_askew_is_told_as_misalignment():
    metrics, _ = score(quaternion.multiply(tumbling(at(T)), MOUNTED))
    assert_allclose(metrics.misalignment, MOUNTED, atol=1e-9)
    assert metrics.misalignment_deg == pytest.approx(np.rad2deg(np.linalg.norm([0.05, 0.1, 0.2])))
    assert metrics.total.median > 10.0


def test_misalignment_is_taken_out_on_request():
    q = quaternion.multiply(tumbling(at(T)), MOUNTED)
    metrics, _ = score(q, config=Evaluation(apply_misalignment=True))
    assert metrics.total.max < 1e-4
    assert_allclose(metrics.misalignment, MOUNTED, atol=1e-9)


@pytest.mark.parametrize("delay_ms", [-400, 13, 250])
def test_a_time_offset_is_told_and_taken_out_on_request_only(delay_ms):
    late = reference_of(shift=delay_ms * 1_000_000)
    metrics, notes = score(reference=late)
    assert metrics.time_offset_s == pytest.approx(delay_ms * 1e-3, abs=0.005)
    assert notes == ()
    shifted, notes = score(reference=late, config=Evaluation(apply_time_offset=True))
    assert shifted.time_offset_s == metrics.time_offset_s
    assert shifted.total.rmse < 0.5
    assert shifted.total.rmse < metrics.total.rmse
    assert "'SIMSTATE' shifted by" in notes[0].text
    assert "as asked" in notes[0].text


def test_at_rest_no_time_offset_is_told_or_applied():
    reference = reference_of(attitude=resting)
    asked = Evaluation(apply_time_offset=True)
    metrics, notes = score(resting(at(T)), reference, asked, attitude=resting)
    assert metrics.time_offset_s is None
    assert notes == ()


def test_the_reference_is_never_interpolated_across_a_gap():
    seconds = at(T)
    kept = T[(seconds < 20.0) | (seconds > 25.0)]
    metrics, _ = score(reference=reference_of(kept))
    inside = (seconds >= 20.0) & (seconds <= 25.0)
    assert np.isnan(metrics.q_ref[inside]).all()
    assert np.isnan(metrics.error_deg[inside]).all()
    assert np.isfinite(metrics.error_deg[~inside]).all()
    assert metrics.scored == np.sum(~inside)
    bridged, _ = score(reference=reference_of(kept), config=Evaluation(longest_gap_s=6.0))
    assert bridged.scored == len(T)


def test_what_lies_outside_the_reference_is_not_scored():
    seconds = at(T)
    metrics, _ = score(reference=reference_of(T[(seconds > 10.0) & (seconds < 50.0)]))
    scored = np.isfinite(metrics.error_deg[:, 0])
    assert seconds[scored].min() > 10.0
    assert seconds[scored].max() < 50.0
    assert metrics.total.max < 1e-5


def test_a_slower_reference_is_interpolated_by_slerp():
    metrics, _ = score(reference=reference_of(stamps(10.0, 60.0)))
    assert metrics.scored >= len(T) - 5
    assert metrics.total.max < 0.3


def test_a_reference_that_shares_no_time_is_told_and_nothing_is_scored():
    metrics, notes = score(reference=reference_of(shift=1000 * SECOND))
    assert metrics is None
    assert [note.doubt for note in notes] == [True]
    assert "'SIMSTATE' shares no time with the estimate" in notes[0].text


def test_no_reference_scores_nothing():
    assert evaluate(made_samples(), estimates_of(tumbling(at(T))), None, AS_IT_IS) == (None, ())


def settling_estimate():
    """Start 40 degrees off and settle with a time constant of 3 s."""
    off = 0.7 * np.exp(-at(T) / 3.0)
    lean = quaternion.exp(off[:, np.newaxis] * np.array([0.6, 0.8, 0.0]))
    return quaternion.multiply(lean, tumbling(at(T)))


@pytest.mark.parametrize("bound", [1.0, 5.0, 20.0])
def test_settling_time_is_where_the_error_stays_below_the_bound(bound):
    metrics, _ = score(settling_estimate(), config=Evaluation(settling_bound_deg=bound))
    expected = 3.0 * np.log(np.rad2deg(0.7) / bound)
    assert metrics.settling_time_s == pytest.approx(expected, abs=0.03)
    assert metrics.settling_bound_deg == bound
    assert metrics.after_settling.max < bound
    assert metrics.after_settling.rmse < metrics.total.rmse


def test_an_estimate_that_never_settles_says_so():
    turn = quaternion.exp(np.array([0.0, 0.0, 0.3]))
    metrics, _ = score(quaternion.multiply(turn, tumbling(at(T))))
    assert metrics.settling_time_s is None
    assert metrics.after_settling is None


BIAS = (0.02, -0.01, 0.03)


def biased(kind, substeps=1):
    samples = replace(made_samples(bias=BIAS), substeps=np.full(len(T), substeps))
    estimates = estimates_of(tumbling(at(T)), bias=(0.02, -0.01, 0.0))
    return evaluate(samples, estimates, reference_of(kind=kind), AS_IT_IS)[0]


@pytest.mark.parametrize("substeps", [1, 4])
def test_true_bias_is_told_where_there_is_truth(substeps):
    metrics = biased("truth", substeps)
    assert_allclose(metrics.bias_true, BIAS, atol=1e-3)
    assert metrics.bias_error == pytest.approx(0.03, abs=1e-3)


def test_an_autopilots_estimate_is_no_truth_for_the_bias():
    metrics = biased("autopilot")
    assert metrics.kind == "autopilot"
    assert metrics.bias_true is None
    assert metrics.bias_error is None


def test_the_signs_of_quaternions_do_not_matter():
    flips = np.where(np.arange(len(T)) % 7 < 3, -1.0, 1.0)[:, np.newaxis]
    reference = reference_of()
    metrics, _ = score(reference=replace(reference, q=flips * reference.q))
    assert metrics.total.max < 1e-4


def log_of_two():
    log = flight(duration=1.0)
    truth = log.references["TRUTH"]
    own = Reference("ATTITUDE", "autopilot", truth.t, truth.q)
    return replace(log, references={"TRUTH": truth, "ATTITUDE": own})


def test_the_best_reference_is_taken_unless_one_is_named():
    log = log_of_two()
    assert choose(log, None).name == "TRUTH"
    assert choose(log, "ATTITUDE").name == "ATTITUDE"
    assert choose(log, "none") is None
    assert choose(replace(log, references={}), None) is None


def test_an_unknown_reference_is_refused_with_those_there_are():
    log = log_of_two()
    with pytest.raises(ConfigError, match=r"flight\.csv: no reference 'AHRS2'.*TRUTH, ATTITUDE"):
        choose(log, "AHRS2")
    with pytest.raises(ConfigError, match=r"no reference 'AHRS2'.*none"):
        choose(replace(log, references={}), "AHRS2")


def test_a_short_reference_is_scored_for_what_it_is():
    one = reference_of(T[100:101])
    metrics, _ = score(reference=one)
    assert metrics.scored == 1
    assert metrics.time_offset_s is None
    assert metrics.bias_true is None
    assert T[100] == START + 2 * SECOND
