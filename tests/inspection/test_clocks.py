"""A reference of another clock: by seconds that are told, or by where it turns as the log does."""

from dataclasses import replace

import numpy as np
import pytest
from flights import SECOND, flight, resting, tumbling

from attest import config, pipeline, preview
from attest.config import Evaluation
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.inspection import clocks
from attest.recording import Reference
from attest.simulation import simulate, write

DAY = 86_400.0


def early(log, shift, *, part=slice(None), body=None):
    """Return a log whose reference counts from elsewhere, seconds less, and of another body."""
    truth = next(iter(log.references.values()))
    t, q = truth.t[part] - round(shift * SECOND), truth.q[part]
    q = q if body is None else quaternion.continuous(quaternion.multiply(q, body))
    return replace(log, references={"ref": Reference("ref", "truth", t, q)})


@pytest.mark.parametrize("shift", [0.4, -100.0, 3.21 * DAY, -20_000.0 * DAY])
def test_the_shift_is_found_whatever_the_clock_and_the_body(log, shift):
    cut = slice(len(next(iter(log.references.values())).t) // 4, None)
    for part, body in ((slice(None), None), (cut, np.array([0.5, 0.5, 0.5, 0.5]))):
        found = clocks.in_time(
            early(log, shift, part=part, body=body), Evaluation(reference_shift_s="auto")
        )
        moved = found.references["ref"].t - next(iter(log.references.values())).t[part]
        assert np.abs(moved).max() < 0.05 * SECOND
        assert "s later, where it turns as the gyroscope does" in found.notes[-1].text


def test_seconds_are_added_as_they_are_told():
    log = early(flight(), 1234.5)
    shifted = clocks.in_time(log, Evaluation(reference_shift_s=1234.5))
    assert np.array_equal(shifted.references["ref"].t, flight().references["TRUTH"].t)
    assert shifted.notes[-1].text == (
        "reference ref: taken +1234.500 s later, as evaluation.reference_shift_s says"
    )
    assert clocks.in_time(log, Evaluation()) is log
    alone = Evaluation(reference="none", reference_shift_s=5.0)
    assert clocks.in_time(log, alone) is log


@pytest.mark.parametrize("attitude", [resting, lambda s: tumbling(s % 7.0), None])
def test_no_shift_is_made_up(attitude):
    log = flight(duration=60.0)
    other = flight(tumbling if attitude is None else attitude, duration=60.0)
    if attitude is None:  # another flight
        truth = other.references["TRUTH"]
        q = quaternion.continuous(tumbling(np.arange(len(truth.t)) * 0.013 + 400.0))
        other = replace(other, references={"ref": replace(truth, name="ref", q=q)})
    log = replace(log, references={"ref": next(iter(other.references.values()))})
    log = replace(log, signals=other.signals) if attitude is not None else log
    with pytest.raises(ReadError) as caught:
        clocks.in_time(log, Evaluation(reference_shift_s="auto"))
    assert str(caught.value).endswith(
        " turn as the gyroscope does. Give evaluation.reference_shift_s in seconds."
    )


def test_a_trajectory_of_another_clock_is_told_with_the_option_that_mends_it(tmp_path):
    made = simulate("handheld")
    write(tmp_path / "log.csv", made)
    t = (made.t - made.t[0]) * 1e-9 + 5_000.0
    rows = [
        f"{s:.6f} 0 0 0 {x!r} {y!r} {z!r} {w!r}"
        for s, (w, x, y, z) in zip(t.tolist(), made.q.tolist(), strict=True)
    ]
    (tmp_path / "truth.txt").write_text("\n".join(rows))
    wanted = [f"evaluation.reference={tmp_path / 'truth.txt'}", "input.world=ned"]
    recording, _ = preview.describe(tmp_path / "log.csv", pipeline.configure("fts", wanted))
    (text,) = (note.text for note in recording.notes if "shares no time" in note.text)
    assert text == (
        "reference 'truth.txt' shares no time with the estimate: nothing to score. If its clock "
        "is another one: --set evaluation.reference_shift_s=auto, or the seconds to add to it"
    )
    mended = pipeline.configure("fts", [*wanted, "evaluation.reference_shift_s=auto"])
    result = pipeline.run(tmp_path / "log.csv", mended)
    assert result.metrics.total.rmse < 5.0
    again = config.validate(type(mended), config.effective(mended), "again")
    assert again == mended


@pytest.mark.parametrize("value", ["5e9", "later", "null"])
def test_a_shift_that_is_none_is_refused(value):
    with pytest.raises(ConfigError, match=r"'evaluation.reference_shift_s' is "):
        pipeline.configure("fts", [f"evaluation.reference_shift_s={value}"])
