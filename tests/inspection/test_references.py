"""References that are of another time, flight, form, body or world: each is told as what it is."""

from dataclasses import replace

import advised
import numpy as np
import pytest
from flights import SECOND, at, flight, tumbling

from attest import inspection, pipeline, preview, simulation
from attest.config import Evaluation
from attest.geometry import quaternion
from attest.inspection import clocks
from attest.recording import Reference

WORLD = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
FLU = np.array([0.0, 1.0, 0.0, 0.0])
CYCLED = np.array([0.5, 0.5, 0.5, 0.5])
SAME = np.array([1.0, 0.0, 0.0, 0.0])
OTHERWISE = "the reference ref does not turn as the gyroscope does"


def told(log):
    """Return the texts of what is doubted."""
    return [note.text for note in inspection.doubts(log)]


def referred(log, *, t=None, q=None, world=None):
    """Return a log whose reference has other stamps or attitudes, or is of a file of its own."""
    ref = log.references["ref"]
    t, q = ref.t if t is None else t, ref.q if q is None else q
    return replace(log, references={"ref": Reference("ref", "truth", t, q, world)})


def brought(log, world, body):
    """Return the log's attitudes in another world and of another body."""
    q = quaternion.multiply(world, log.references["ref"].q)
    return quaternion.continuous(quaternion.multiply(q, body))


def without(log, *names):
    """Return a log without some signals."""
    signals = {name: s for name, s in log.signals.items() if name not in names}
    return replace(log, signals=signals)


@pytest.mark.parametrize("late", [-20.0, -3.0, -1.0, 1.5, 8.0, 25.0])
def test_a_shifted_reference_is_told_with_its_shift(log, late):
    (text,) = told(referred(log, t=log.references["ref"].t + round(late * SECOND)))
    is_so, taken = ("late", "earlier") if late > 0.0 else ("early", "later")
    assert text.startswith(
        f"the reference ref is {is_so}: it turns as the gyroscope does when taken "
        f"{abs(late):.1f} s {taken}"
    )
    if abs(late) < 1.9:
        assert text.endswith(": try --set evaluation.apply_time_offset=true")
        return
    key, _, shift = advised.assignments(text)[0].partition("=")
    assert (key, float(shift)) == ("evaluation.reference_shift_s", pytest.approx(-late, abs=0.1))
    wrong = referred(log, t=log.references["ref"].t + round(late * SECOND))
    mended = clocks.in_time(wrong, Evaluation(reference_shift_s=float(shift)))
    assert told(mended) == []
    further = replace(mended, details={"reference_shift_s": 100.0}, references=wrong.references)
    (text,) = told(further)
    assert float(text.rpartition("=")[2]) == pytest.approx(100.0 - late, abs=0.1)


@pytest.mark.parametrize("witness", ["magnetometer", "accelerometer"])
def test_a_reference_of_another_flight_is_told_where_a_vector_confirms_the_gyroscope(witness):
    log = flight(duration=60.0)
    t = log.references["TRUTH"].t
    other = quaternion.continuous(tumbling(at(t) * 0.8 + 400.0))
    log = replace(log, references={"ref": Reference("ref", "truth", t, other)})
    (text,) = told(without(log, "accel" if witness == "magnetometer" else "mag"))
    confirmed = f"{OTHERWISE}, which the {witness} confirms: it may be of another flight or time"
    assert text == confirmed
    assert told(without(log, "accel", "mag")) == []


def test_a_flight_of_another_scenario_is_no_reference(log):
    name = "fixed-wing" if "handheld" in str(log.path) else "handheld"
    other = simulation.simulate(name)
    start = log.signals["gyro"].t[0]
    q = quaternion.continuous(other.q)
    (text,) = told(referred(log, t=other.t - other.t[0] + start, q=q))
    assert text.startswith(f"{OTHERWISE}, which the magnetometer confirms")


def test_a_reference_that_does_not_move_is_told(log):
    q = log.references["ref"].q
    confirmed = "which the magnetometer confirms: it is stuck, or slow"
    (text,) = told(referred(log, q=np.tile(q[0], (len(q), 1))))
    assert text == f"the reference ref does not move while the gyroscope turns, {confirmed}"
    half = np.where(np.arange(len(q))[:, np.newaxis] < len(q) // 2, q, q[len(q) // 2])
    (text,) = told(referred(log, q=half))
    assert text.startswith("the reference ref does not move in ")
    assert text.endswith(f"% of the gyroscope's turns, {confirmed}")
    # nothing says that the gyroscope is not the one that is wrong
    assert told(without(referred(log, q=np.tile(q[0], (len(q), 1))), "mag", "accel")) == []


def test_a_reference_of_a_body_at_rest_may_stand_still():
    assert told(flight(lambda s: tumbling(0.0 * s))) == []


@pytest.mark.parametrize(("read", "right"), [("ned", "enu"), ("enu", "ned")])
def test_a_trajectory_of_another_world_is_told_with_the_option_that_mends_it(log, read, right):
    wrong = referred(log, q=brought(log, WORLD, FLU), world=read)
    body = {"ned": "forward-right-down", "enu": "forward-left-up"}[right]
    said = f"{OTHERWISE}: it seems to be {right} with a body {body}, taken for {read}"
    # of a log whose axes the option leaves as they are
    option = f": try --world {right}"
    assert told(replace(wrong, format="tlog")) == [said + option]
    assert told(replace(wrong, format="csv")) == [said + (option if right == "ned" else "")]
    assert told(referred(log, q=brought(log, WORLD, FLU)))[0].startswith(f"{OTHERWISE}: it seems")


@pytest.mark.parametrize(
    ("body", "axes"), [(FLU, "(x, -y, -z)"), (WORLD, "(y, x, -z)"), (CYCLED, "(z, x, y)")]
)
def test_other_axes_of_the_body_are_named(log, body, axes):
    wrong = referred(log, q=brought(log, SAME, body), world="ned")
    (text,) = told(wrong)
    said = f"{OTHERWISE}: it seems to be of a body with other axes, of which {axes} would fit: "
    assert text.startswith(said)
    assert [*advised.axes(text)] == ["gyro", "accel", "mag"]
    assert told(replace(advised.mended(wrong, text), notes=())) == []
    assert told(without(wrong, "mag", "accel")) == [
        f"{OTHERWISE}: its axes and the gyroscope's differ, and would fit as {axes}"
    ]


@pytest.mark.parametrize(("world", "name"), [(FLU, "north-west-up"), (WORLD, "east-north-up")])
def test_another_world_alone_is_named_by_the_field(log, world, name):
    wrong = referred(log, q=brought(log, world, SAME))
    (text,) = told(wrong)
    assert text.startswith("the accelerometer's up is 1")
    assert text.endswith(f"one is inverted, or of another world, as {name}")
    (text,) = told(without(wrong, "mag"))
    assert text.endswith("one is inverted, or of another world")


@pytest.mark.parametrize("form", ["world to body", "(x, y, z, w)", "(w, x, y, z)"])
@pytest.mark.parametrize("world", [None, "enu"])
def test_a_form_is_named_as_it_is_in_the_file(log, form, world):
    q = log.references["ref"].q if world is None else brought(log, WORLD, FLU)
    change = {
        "world to body": quaternion.conjugate,
        "(x, y, z, w)": quaternion.to_xyzw,
        "(w, x, y, z)": quaternion.from_xyzw,
    }
    wrong = referred(log, q=quaternion.continuous(change[form](q)), world=world)
    if world is not None:  # as a file's attitudes are brought to the axes of the log
        wrong = referred(wrong, q=brought(wrong, WORLD, FLU), world=world)
    texts = told(wrong)
    assert f"{OTHERWISE}: it seems to be " in texts[0]
    assert form in texts[0]
    named = {"(x, y, z, w)": ["qz", "qw", "qx", "qy"], "(w, x, y, z)": ["qx", "qy", "qz", "qw"]}
    columns = ", ".join(f'"ref_{name}"' for name in named.get(form, []))
    option = f"--set 'input.csv.reference.columns=[{columns}]'"
    assert (option in texts[0]) == (world is None and form != "world to body")


def test_forms_that_fit_alike_are_left_open():
    log = flight(lambda s: quaternion.from_euler(0.0 * s, 0.0 * s, tumbling(s)[..., 3]))
    truth = log.references["TRUTH"]
    q = quaternion.continuous(quaternion.conjugate(truth.q))
    wrong = replace(log, references={"ref": Reference("ref", "truth", truth.t, q)})
    assert told(wrong) == [
        f"{OTHERWISE}: it is in another form, and the motion leaves open in which"
    ]


def test_a_trajectory_file_is_told_in_a_run(tmp_path):
    made = simulation.simulate("handheld")
    path = tmp_path / "log.csv"
    simulation.write(path, made)
    rows = [
        f"{t * 1e-9:.6f} 0 0 0 {x!r} {y!r} {z!r} {w!r}"
        for t, (w, x, y, z) in zip(made.t.tolist(), made.q.tolist(), strict=True)
    ]
    trajectory = tmp_path / "truth.txt"
    trajectory.write_text("\n".join(rows))
    wanted = [f"evaluation.reference={trajectory}"]
    texts = [n.text for n in preview.describe(path, pipeline.configure("fts", wanted))[0].notes]
    (text,) = (text for text in texts if "does not turn as" in text)
    assert text.endswith("taken for enu: try --world ned")
    mended = pipeline.configure("fts", [*wanted, "input.world=ned"])
    texts = [n.text for n in preview.describe(path, mended)[0].notes if n.doubt]
    assert not any("does not turn as" in text for text in texts)
