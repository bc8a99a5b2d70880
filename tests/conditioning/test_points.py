from itertools import combinations

import numpy as np
import pytest
from flights import SECOND, START, recording
from numpy.testing import assert_allclose, assert_array_equal

from attest.conditioning import condition, points
from attest.config import Conditioning, Input, Vector
from attest.errors import ReadError
from attest.geometry import quaternion
from attest.observers import relative_fts
from attest.recording import Note, Signal

PLACES = {
    "point1": (0.5, 0.0, 0.1),
    "point2": (0.0, 0.4, -0.2),
    "point3": (-0.3, 0.0, 0.6),
    "point4": (0.2, -0.5, 0.0),
}
"""Feature points on an object, m."""
FIRST_THREE = {name: PLACES[name] for name in list(PLACES)[:3]}
CENTRE = np.array([3.0, -1.0, 0.5])
HIDDEN = "step with a point hidden: the others are used"
FEW = "step with fewer than three points: the turn that they leave open goes on at its last rate"
LINE = "step whose visible points lie on one line: the turn about it is not observable"


def attitude(t):
    """Return an attitude that turns, observer's frame to object's, at stamps."""
    seconds = (t - START) * 1e-9
    return quaternion.exp(np.outer(seconds, [0.3, -0.2, 0.5]))


def seen_at(t, place, centre=CENTRE):
    """Return a point as it is measured at stamps."""
    return Signal(t, centre + quaternion.rotate(quaternion.conjugate(attitude(t)), place), "POINT")


def stamps(n, period=10_000_000, first=0):
    return START + first + np.arange(n) * period


def log(places=PLACES, n=100, without=None, **other):
    """Return a log of points at 100 Hz; without names the steps at which a point is not seen."""
    t, without = stamps(n), without or {}
    signals = {
        name: seen_at(np.delete(t, without.get(name, [])), np.array(place))
        for name, place in places.items()
    }
    return recording(signals | other)


def settings(places=PLACES, **sections):
    return relative_fts.Config(points=places, **sections)


def told(notes):
    return {note.text: (note.count, note.doubt) for note in notes}


def test_the_vectors_are_all_pairs_of_points_in_units_of_the_longest():
    made, notes = condition(log(), settings())
    pairs = list(combinations(PLACES, 2))
    d = np.array([np.subtract(PLACES[a], PLACES[b]) for a, b in pairs])
    longest = np.linalg.norm(d, axis=1).max()
    assert made.names == tuple(f"{a}-{b}" for a, b in pairs)
    assert_allclose(made.inertial, d[np.newaxis] / longest)
    assert made.body.shape == (100, 6, 3)
    turned = quaternion.rotate(attitude(made.t)[:, np.newaxis], made.body)
    assert_allclose(turned, np.broadcast_to(d / longest, (100, 6, 3)), atol=1e-12)
    assert made.valid.all()
    assert notes == ()


def test_there_is_no_gyroscope_and_what_belongs_to_one():
    made, _ = condition(log(), settings())
    assert np.isnan(made.gyro).all()
    assert made.gyro.shape == (100, 3)
    assert made.length is None
    assert made.torque is None
    assert made.restart.tolist() == [True] + [False] * 99
    assert made.substeps.tolist() == [1] * 100


def test_where_the_object_is_does_not_matter():
    t = stamps(10)
    far = {n: seen_at(t, np.array(p), 50.0 * CENTRE) for n, p in PLACES.items()}
    here, _ = condition(log(n=10), settings())
    there, _ = condition(recording(far), settings())
    assert_allclose(there.body, here.body, atol=1e-12)


def test_a_model_of_another_size_gives_vectors_of_the_same_lengths():
    large = {name: tuple(100.0 * np.array(place)) for name, place in PLACES.items()}
    here, _ = condition(log(n=10), settings())
    there, _ = condition(log(large, n=10), settings(large))
    assert_allclose(there.inertial, here.inertial, atol=1e-12)
    assert_allclose(there.body, here.body, atol=1e-12)


def test_pairs_of_a_hidden_point_are_not_valid_there():
    made, notes = condition(log(without={"point2": [3, 4, 5]}), settings())
    with_second = np.array(["point2" in name for name in made.names])
    assert with_second.sum() == 3
    away = np.isin(np.arange(100), [3, 4, 5])
    assert_array_equal(made.valid, ~(away[:, np.newaxis] & with_second))
    assert told(notes) == {HIDDEN: (3, False)}
    assert np.isfinite(made.body).all()


def test_steps_with_fewer_than_three_points_are_counted():
    without = {"point2": [3, 4, 5], "point3": [4, 5, 6], "point1": [5, 6]}
    made, notes = condition(log(without=without), settings())
    assert told(notes) == {HIDDEN: (4, False), FEW: (3, True)}
    assert made.valid.sum(axis=1)[2:8].tolist() == [6, 3, 1, 0, 1, 6]


def test_steps_of_points_on_a_line_are_counted():
    places = PLACES | {"point5": (0.25, 0.2, -0.05)}  # between the first two
    without = {"point3": [7, 8, 9], "point4": [8, 9, 10], "point5": [9]}
    _, notes = condition(log(places, without=without), settings(places))
    assert told(notes) == {HIDDEN: (4, False), FEW: (1, True), LINE: (1, True)}


def test_stamps_that_differ_make_steps_of_their_own():
    half = 5_000_000
    signals = {
        name: seen_at(stamps(10, first=half * (name == "point3")), np.array(place))
        for name, place in FIRST_THREE.items()
    }
    made, notes = condition(recording(signals), settings(FIRST_THREE))
    assert made.t.tolist() == stamps(20, half).tolist()
    assert made.names == ("point1-point2", "point1-point3", "point2-point3")
    assert made.valid[:, 0].tolist() == [True, False] * 10
    assert not made.valid[:, 1:].any()
    assert told(notes) == {HIDDEN: (20, False), FEW: (20, True)}


def test_one_point_at_half_the_rate_is_hidden_at_every_other_step():
    signals = {n: seen_at(stamps(20), np.array(p)) for n, p in PLACES.items()}
    signals["point4"] = seen_at(stamps(10, 20_000_000), np.array(PLACES["point4"]))
    made, notes = condition(recording(signals), settings())
    assert told(notes) == {HIDDEN: (10, False)}
    assert made.valid.sum(axis=1).tolist() == [6, 3] * 10


def test_start_and_end_cut_what_is_asked_for():
    made, _ = condition(log(), settings(input=Input(start_s=0.2, end_s=0.5)))
    assert_allclose([made.t[0] - START, made.t[-1] - START], [0.2 * SECOND, 0.5 * SECOND])
    assert len(made.t) == 31
    whole, _ = condition(log(), settings())
    assert_array_equal(made.body, whole.body[20:51])


def test_too_little_between_start_and_end_is_refused():
    with pytest.raises(ReadError) as caught:
        condition(log(), settings(input=Input(start_s=0.99)))
    assert str(caught.value) == (
        "flight.csv: feature points at 1 times between start and end; two are needed."
    )


def test_a_log_of_points_without_a_sample_is_refused():
    nothing = Signal(np.empty(0, np.int64), np.empty((0, 3)), "POINT")
    signals = dict.fromkeys(FIRST_THREE, nothing)
    with pytest.raises(ReadError, match="feature points at 0 times between start and end"):
        condition(recording(signals), settings(FIRST_THREE))


def test_a_missing_point_is_told_in_one_line():
    with pytest.raises(ReadError) as caught:
        condition(log(FIRST_THREE), settings())
    assert str(caught.value) == (
        "flight.csv: no 'point4' signal. The log holds: point1, point2, point3."
    )


def test_points_that_the_model_does_not_name_are_told():
    made, notes = condition(log(), settings(FIRST_THREE))
    assert made.body.shape == (100, 3, 3)
    assert notes == (
        Note("feature points without a place in the model, not used: point4", doubt=True),
    )


def test_signals_that_are_no_points_are_not_told():
    t = stamps(100)
    other = {"gyro": Signal(t, np.ones((100, 3)), "GYRO"), "accel": seen_at(t, CENTRE)}
    made, notes = condition(log(**other), settings())
    assert notes == ()
    assert np.isnan(made.gyro).all()


def test_a_place_that_no_camera_measures_counts_as_hidden():
    made_of = log()
    wild = made_of.signals["point2"].y.copy()
    wild[10:15] = [[1e7, 0.0, 0.0], [0.0, np.inf, 0.0], [np.nan] * 3, [-2e6] * 3, [0.0, 0.0, 1e6]]
    signals = made_of.signals | {"point2": Signal(stamps(100), wild, "POINT")}
    made, notes = condition(recording(signals), settings())
    assert told(notes) == {HIDDEN: (5, False)}
    assert np.isfinite(made.body).all()


def test_a_gap_starts_the_observer_anew_and_a_reboot_too():
    t = stamps(100)
    t[40:] += 20 * SECOND
    signals = {name: seen_at(t, np.array(place)) for name, place in PLACES.items()}
    made, notes = condition(
        recording(signals, restarts=(int(t[70]),)),
        settings(conditioning=Conditioning(restart_gap_s=5.0)),
    )
    assert np.flatnonzero(made.restart).tolist() == [0, 40, 70]
    assert [note.count for note in notes if note.text.startswith("gap of over 5 s")] == [1]


def test_slow_points_are_stepped_in_parts():
    signals = {n: seen_at(stamps(20, 100_000_000), np.array(p)) for n, p in PLACES.items()}
    made, notes = condition(recording(signals), settings())
    assert made.substeps[:-1].tolist() == [4] * 19
    assert len(notes) == 1


def test_more_points_than_their_pairs_are_worth_are_refused():
    rng = np.random.default_rng(1)
    places = {f"point{i}": tuple(rng.normal(size=3).tolist()) for i in range(points.MOST + 1)}
    with pytest.raises(ReadError) as caught:
        condition(log(places, n=3), settings(places))
    assert str(caught.value) == "flight.csv: 21 points. Name 20 at most."
    del places["point0"]
    made, _ = condition(log(places, n=3), settings(places))
    assert made.body.shape == (3, 190, 3)


def test_points_of_any_name_are_used():
    renamed = dict(zip("abcd", PLACES.values(), strict=True))
    made, notes = condition(log(renamed), settings(renamed))
    assert made.names[0] == "a-b"
    assert notes == ()


def test_vectors_of_known_places_stand_alone_where_the_log_has_no_gyroscope():
    t, known = stamps(50), np.array([[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.6, 0.8]])
    signals = {f"v{i}": seen_at(t, e, np.zeros(3)) for i, e in enumerate(known)}
    signals["v2"] = seen_at(np.delete(t, [7, 8]), known[2], np.zeros(3))
    named = tuple(Vector(signal=f"v{i}", reference=tuple(e)) for i, e in enumerate(known.tolist()))
    made, _ = condition(recording(signals), relative_fts.Config(vectors=named))
    assert made.names == ("v0", "v1", "v2")
    assert_allclose(made.inertial, known[np.newaxis] / 2.0)
    assert np.isnan(made.gyro).all()
    assert np.flatnonzero(~made.valid.all(axis=1)).tolist() == [7, 8]
    turned = quaternion.rotate(attitude(t)[:, np.newaxis], made.body)[made.valid]
    assert_allclose(turned, np.broadcast_to(known / 2.0, (50, 3, 3))[made.valid], atol=1e-12)


def test_vectors_of_a_log_with_a_gyroscope_are_on_its_stamps():
    t = stamps(50)
    signals = {"gyro": Signal(t, np.tile([0.3, -0.2, 0.5], (50, 1)), "GYRO")}
    signals["v0"] = seen_at(t[::5], np.array([2.0, 0.0, 0.0]), np.zeros(3))
    named = (Vector(signal="v0", reference=(2.0, 0.0, 0.0)),)
    made, _ = condition(recording(signals), relative_fts.Config(vectors=named))
    assert_array_equal(made.t, t)
    assert np.isfinite(made.gyro).all()
    assert_allclose(np.linalg.norm(made.body[:, 0], axis=1), 1.0)


def test_without_a_model_or_known_vectors_a_gyroscope_is_needed():
    with pytest.raises(ReadError, match="feature points and no gyroscope"):
        condition(log(), relative_fts.Config())
