"""Tuning on logs with truth: it helps where it can, looks at nothing held back, and says so."""

from dataclasses import replace

import numpy as np
import pytest

from attest import config, observers, pipeline, tuning
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.tuning import Errors, Plan, scoring
from attest.tuning.knobs import configured

SLACK = ["gains.k_p=0.01"]
"""A gain that follows the vectors late."""
OLD = ["gains.direction_noise=1", "gains.gyro_noise=0.074", "gains.bias_walk=0.001"]
SHORT = Plan(generations=6)


@pytest.fixture(scope="module")
def log(sample_logs):
    return sample_logs / "quadcopter.tlog"


@pytest.fixture(scope="module")
def slack():
    return pipeline.configure("cgo", SLACK)


@pytest.fixture(scope="module")
def tuned(log, slack):
    return tuning.tune([log], slack, SHORT)


def test_bad_gains_become_better_on_what_was_held_back(tuned):
    assert tuned.worthwhile
    assert tuned.held_back.tuned < 0.9 * tuned.held_back.start
    assert tuned.training.tuned <= tuned.held_back.tuned


def test_scores_are_those_of_run(tuned, log, slack, tmp_path):
    assert pipeline.run(log, slack).metrics.total.rmse == pytest.approx(tuned.training.start)
    found = tmp_path / "tuned.yaml"
    found.write_text(tuning.yaml_of_tuning(tuned, slack), encoding="utf-8")
    again = pipeline.configure(str(found))
    assert again == tuned.configuration(slack)
    assert pipeline.run(log, again).metrics.total.rmse == pytest.approx(tuned.training.tuned)


@pytest.mark.parametrize("metric", ["heading", "inclination"])
def test_metric_is_that_of_run(log, slack, metric):
    found = tuning.tune([log], slack, Plan(metric=metric, generations=1))
    expected = getattr(pipeline.run(log, slack).metrics, metric).rmse
    assert found.training.start == pytest.approx(expected)


def test_with_the_starting_gains_blocks_together_are_the_whole(tuned):
    assert tuned.held_back.start == pytest.approx(tuned.training.start)
    assert [fold.held_back for fold in tuned.folds] == [f"block {i} of 4" for i in (1, 2, 3, 4)]


@pytest.mark.parametrize("jobs", [1, 3])
def test_same_seed_gives_the_same_whatever_the_lanes(tuned, log, slack, jobs):
    again = tuning.tune([log], slack, replace(SHORT, jobs=jobs))
    assert tuning.yaml_of_tuning(again, slack) == tuning.yaml_of_tuning(tuned, slack)


def test_another_seed_draws_others(tuned, log, slack):
    assert tuning.tune([log], slack, replace(SHORT, seed=1)).values != tuned.values


@pytest.mark.parametrize("key", ["apply_heading_offset", "apply_misalignment", None])
def test_what_is_held_back_is_not_looked_at(log, monkeypatch, key):
    given = pipeline.configure("cgo", [*SLACK, *([f"evaluation.{key}=true"] if key else [])])
    prepare = scoring.prepare
    plan = Plan(generations=3)
    clean = tuning.tune([log], given, plan)

    def spoilt(*arguments, **options):
        found = prepare(*arguments, **options)
        last = scoring.in_time(found, plan.folds) == plan.folds - 1
        turned = quaternion.multiply(np.array([0.6, 0.0, 0.8, 0.0]), found.q_ref)
        q_ref = np.where(last[:, np.newaxis], turned[::-1], found.q_ref)
        return replace(found, q_ref=np.where(np.isfinite(found.q_ref), q_ref, np.nan))

    monkeypatch.setattr(scoring, "prepare", spoilt)
    other = tuning.tune([log], given, plan)
    assert other.folds[-1].values == clean.folds[-1].values
    assert other.folds[-1].training == clean.folds[-1].training
    assert other.folds[-1].error.start > 10.0 * clean.folds[-1].error.start
    assert other.values != clean.values


def test_of_several_logs_each_is_held_back_in_its_turn(sample_logs, slack):
    logs = [sample_logs / name for name in ("quadcopter.tlog", "quadcopter.BIN", "quadcopter.ulg")]
    found = tuning.tune(logs, slack, replace(SHORT, generations=2))
    assert [fold.held_back for fold in found.folds] == [log.name for log in logs]
    alone = [pipeline.run(log, slack).metrics.total.rmse for log in logs]
    assert found.training.start == pytest.approx(np.mean(alone))
    assert [fold.error.start for fold in found.folds] == pytest.approx(alone)
    assert found.folds[0].training.start == pytest.approx(np.mean(alone[1:]))
    assert found.held_back.tuned == pytest.approx(
        np.mean([fold.error.tuned for fold in found.folds])
    )


def test_more_logs_than_folds_are_held_back_together(sample_logs, slack):
    logs = [sample_logs / name for name in ("quadcopter.tlog", "quadcopter.BIN", "quadcopter.ulg")]
    found = tuning.tune(logs, slack, Plan(folds=2, generations=1))
    assert [fold.held_back for fold in found.folds] == [
        "quadcopter.tlog, quadcopter.ulg",
        "quadcopter.BIN",
    ]


def test_log_that_cannot_be_used_is_left_out_and_told(sample_logs, slack, tmp_path):
    bad = tmp_path / "bad.tlog"
    bad.write_bytes(b"nothing of use")
    worse = tmp_path / "worse.tlog"
    logs = [sample_logs / "quadcopter.tlog", bad, sample_logs / "quadcopter.ulg"]
    found = tuning.tune(logs, slack, Plan(generations=1))
    assert list(found.failed) == [str(bad)]
    assert len(found.folds) == 2
    said = f"left out: {found.failed[str(bad)]}"
    assert said in tuning.text_of_tuning(found, slack)
    assert f"# {said}" in tuning.yaml_of_tuning(found, slack)
    with pytest.raises(ReadError, match=r"none of 2 logs can be used\. .*bad\.tlog"):
        tuning.tune([bad, worse], slack, SHORT)


def test_log_that_is_named_twice_is_refused(log, slack):
    with pytest.raises(ConfigError, match="named twice, so that it cannot be held back"):
        tuning.tune([log, log.parent / "." / log.name], slack, SHORT)


def test_keys_of_conditioning_are_tuned_by_conditioning_again(log):
    start = pipeline.configure("wahba", ["conditioning.smoothing.mag_s=0.01"])
    plan = Plan(key=("conditioning.smoothing.mag_s",), factor=1e3, generations=3)
    found = tuning.tune([log], start, plan)
    assert found.training.tuned < found.training.start
    run = pipeline.run(log, configured(start, found.knobs, found.values))
    assert run.metrics.total.rmse == pytest.approx(found.training.tuned)


def test_candidates_that_diverge_are_the_worst(log, slack, monkeypatch):
    observer = observers.get("cgo")

    def fragile(samples, given):
        if given.gains.k_p < 0.05:
            raise ConfigError("cgo: the estimate is no number any more")
        return observer.estimate(samples, given)

    monkeypatch.setattr(observers, "get", lambda _: replace(observer, estimate=fragile))
    found = tuning.tune([log], slack, SHORT)
    assert found.training.start == np.inf
    assert np.isfinite(found.training.tuned)
    assert found.worthwhile
    assert "no number" in tuning.text_of_tuning(found, slack)


def test_observer_that_never_runs_says_why(log):
    given = pipeline.configure("cgo", ["weights.w={sun: 2.0}"])
    with pytest.raises(ConfigError, match="names sun, and none is used"):
        tuning.tune([log], given, Plan(generations=2))


def test_gains_that_are_not_worth_it_are_not_given(tuned, slack):
    chance = replace(tuned, held_back=Errors(start=1.0, tuned=0.995))
    assert not chance.worthwhile
    assert chance.configuration(slack) == slack
    assert "# Tuning is NOT worthwhile" in tuning.yaml_of_tuning(chance, slack)
    assert tuning.describe(chance, slack)["configuration"] == config.effective(slack)


@pytest.mark.parametrize(("nearer", "worthwhile"), [(2, False), (3, True)])
def test_gains_are_worth_it_in_most_folds_only(tuned, slack, nearer, worthwhile):
    folds = tuple(
        replace(fold, error=Errors(start=2.0, tuned=1.0 if i < nearer else 2.1))
        for i, fold in enumerate(tuned.folds)
    )
    found = replace(tuned, folds=folds, held_back=Errors(start=2.0, tuned=1.5))
    assert found.worthwhile is worthwhile
    if not worthwhile:
        said = "nearer in 2 of 4 folds, which is not most of them. The starting values are kept."
        assert said in tuning.text_of_tuning(found, slack)


def test_key_that_folds_do_not_agree_on_is_doubted(tuned, slack):
    doubt = "! gains.k_p is 0.012 to 1.77 between the folds: the data do not tell it"
    values = [((k_p,), (0.001,)) for k_p in (0.5, 0.012, 1.77, 0.4)]
    folds = tuple(replace(f, values=v) for f, v in zip(tuned.folds, values, strict=True))
    text = tuning.text_of_tuning(replace(tuned, folds=folds), slack)
    assert doubt in text
    assert "gains.k_i is" not in text


def test_log_without_a_direction_is_left_out(sample_logs, slack):
    bare = sample_logs / "quadcopter_truth.csv"
    found = tuning.tune([sample_logs / "quadcopter.ulg", bare], slack, Plan(generations=1))
    assert [log.path.name for log in found.logs] == ["quadcopter.ulg"]
    said = f"{bare}: no direction beside the gyroscope, so that no gain matters. Leave it out."
    assert found.failed == {str(bare): said}
    assert f"! left out: {said}" in tuning.text_of_tuning(found, slack)


def test_logs_of_one_flight_are_doubted_on_whatever_clock_and_axes(sample_logs, slack):
    names = ("quadcopter.tlog", "quadcopter.bag", "quadcopter.ulg")
    logs = [scoring.prepare(sample_logs / n, slack, 0.0, reconditioned=False) for n in names]
    said = "the same flight as quadcopter.tlog: held back, it is known by that one"
    doubted = [said in log.doubts for log in scoring.doubted_copies(logs, 3)]
    assert doubted == [False, True, True]
    together = [said in log.doubts for log in scoring.doubted_copies(logs, 2)]
    assert together == [False, True, False]  # the first and the third are held back together


def test_other_turns_or_another_length_are_another_flight(sample_logs, slack):
    one = scoring.prepare(sample_logs / "quadcopter.tlog", slack, 0.0, reconditioned=False)
    turned = replace(one, samples=replace(one.samples, gyro=one.samples.gyro[::-1]))
    longer = replace(one, samples=replace(one.samples, t=one.samples.t * 11 // 10))
    for other in (turned, longer):
        assert not any(
            "the same flight as" in doubt
            for doubt in scoring.doubted_copies([one, other], 2)[1].doubts
        )


@pytest.mark.parametrize(
    ("utc", "vehicle", "doubted"),
    [
        ((50, 150), ("tlog", "1"), True),
        ((50, 150), ("tlog", "2"), False),
        ((50, 150), ("ulog", ""), True),
        ((100, 150), ("tlog", "1"), False),
        (None, ("tlog", "1"), False),
    ],
)
def test_logs_of_one_time_are_doubted(sample_logs, slack, utc, vehicle, doubted):
    one = scoring.prepare(sample_logs / "quadcopter.tlog", slack, 0.0, reconditioned=False)
    one = replace(one, utc=(0, 100), vehicle=("tlog", "1"))
    turned = replace(one.samples, gyro=one.samples.gyro[::-1])
    other = replace(one, samples=turned, utc=utc, vehicle=vehicle)
    said = (
        "its time overlaps that of quadcopter.tlog: if that is the same flight, it is known by it"
    )
    assert (said in scoring.doubted_copies([one, other], 2)[1].doubts) is doubted


def test_too_short_a_search_is_not_worth_it(tuned, slack):
    hasty = replace(tuned, plan=replace(tuned.plan, generations=2))
    assert not hasty.worthwhile
    said = "and 2 generations tell little: raise --generations."
    assert said in tuning.text_of_tuning(hasty, slack)


def test_autopilots_attitude_is_said_not_to_be_truth(log):
    given = pipeline.configure("cgo", ["evaluation.reference=ATTITUDE"])
    found = tuning.tune([log], given, Plan(generations=1))
    said = "an autopilot's attitude is not truth: what is tuned towards it becomes like it"
    assert f"! {said}" in tuning.text_of_tuning(found, given)
    assert f"# {said}" in tuning.yaml_of_tuning(found, given)


def test_name_with_a_line_break_stays_in_the_comment(tuned, slack):
    (log,) = tuned.logs
    named = replace(tuned, logs=(replace(log, path=log.path.with_name("a\nobserver: vae")),))
    text = tuning.yaml_of_tuning(named, slack)
    assert text.count("\nobserver:") == 1
    assert "# " in text


def test_beginning_can_be_left_out(log, slack):
    found = tuning.tune([log], slack, Plan(skip=30.0, generations=1))
    result = pipeline.run(log, slack)
    late = result.samples.t - result.samples.t[0] >= 30_000_000_000
    error = result.metrics.error_deg[late & np.isfinite(result.metrics.error_deg[:, 0]), 0]
    assert found.training.start == pytest.approx(np.sqrt(np.mean(error**2)))


def test_one_block_with_a_reference_is_too_little(log, slack, monkeypatch):
    def only_ends(*arguments, real=scoring.in_time):
        return np.where(real(*arguments) == 0, 0, scoring.NOWHERE)

    monkeypatch.setattr(scoring, "in_time", only_ends)
    with pytest.raises(ReadError, match="the reference is in one block of time only"):
        tuning.tune([log], slack, Plan(generations=1))


@pytest.mark.shared
def test_flight_of_a_quadplane_is_held_back_with_gain(shared):
    """3.08° to 2.49°."""
    path, given = shared / "tlog" / "quadplane_sitl.tlog", pipeline.configure("mekf", OLD)
    found = tuning.tune([path], given, Plan(generations=8))
    assert found.worthwhile
    assert found.held_back.start < 3.3
    assert found.held_back.tuned < 2.6
