from dataclasses import replace

import numpy as np
import pytest
from flights import (
    FIELD,
    SECOND,
    START,
    Turning,
    angle_deg,
    at,
    body,
    flight,
    gyro,
    recording,
    resting,
    seen,
    stamps,
    tumbling,
)
from numpy.testing import assert_allclose, assert_array_equal

from attest.conditioning import condition, magnetic
from attest.config import Input, RawConditioning, SpecificForce, Vector
from attest.errors import ConfigError, ReadError
from attest.geometry import quaternion
from attest.observers import fts
from attest.recording import Signal

YEAR_2024 = 1_720_000_000 * SECOND


def settings(vectors=None, **sections):
    """Return a configuration that leaves the vectors as they are measured."""
    named = None if vectors is None else tuple(Vector(**vector) for vector in vectors)
    return fts.Config(vectors=named, **({"conditioning": RawConditioning()} | sections))


def texts(notes):
    return "\n".join(note.text for note in notes)


def one_vector(t, when, **sections):
    """Return the samples of a log with a gyroscope at t and one direction at other times."""
    log = recording({"gyro": gyro(tumbling, t), "star": seen(tumbling, when, [0.0, 0.6, 0.8])})
    vectors = [{"signal": "star", "reference": (0.0, 3.0, 4.0)}]
    return condition(log, settings(vectors, **sections))


def test_the_timeline_is_the_gyroscopes():
    log = flight(duration=5.0)
    samples, _ = condition(log, settings())
    assert_array_equal(samples.t, log.signals["gyro"].t)
    assert_array_equal(samples.gyro, log.signals["gyro"].y)
    assert samples.names == ("accel", "mag")
    assert samples.body.shape == (500, 2, 3)
    assert samples.restart.tolist() == [True] + [False] * 499


def test_vectors_are_of_unit_length_in_the_body_and_in_the_world():
    samples, _ = condition(flight(duration=5.0), settings())
    assert_allclose(np.linalg.norm(samples.body, axis=2), 1.0, atol=1e-12)
    assert_allclose(np.linalg.norm(samples.inertial, axis=2), 1.0, atol=1e-12)


def test_vectors_on_the_gyroscopes_stamps_pass_through_exactly():
    t = stamps(100.0, 5.0)
    samples, _ = one_vector(t, t)
    assert_allclose(samples.body[:, 0], body(tumbling, at(t), [0.0, 0.6, 0.8]), atol=1e-15)
    assert_allclose(samples.inertial, [[[0.0, 0.6, 0.8]]])
    assert samples.valid.all()


def test_sparse_vectors_are_carried_by_the_gyroscope():
    t = stamps(100.0, 10.0)
    samples, notes = one_vector(t, t[::60])
    assert samples.valid.all()
    assert np.abs(samples.body[:, 0] - body(tumbling, at(t), [0.0, 0.6, 0.8])).max() < 1e-3
    assert "within" not in texts(notes)


def test_a_vector_is_invalid_further_from_a_sample_than_its_greatest_age():
    t = stamps(100.0, 10.0)
    samples, notes = one_vector(t, t[[300]], conditioning=RawConditioning(max_age_s=1.5))
    assert_array_equal(samples.valid[:, 0], np.abs(t - t[300]) <= 1_500_000_000)
    stale = next(note for note in notes if "'star' within 1.5 s" in note.text)
    assert (stale.count, stale.doubt) == (699, True)


def test_a_vector_is_never_carried_across_a_restart():
    t = stamps(100.0, 20.0)
    t = t[(at(t) < 5.0) | (at(t) > 12.0)]
    samples, _ = one_vector(t, t[at(t) < 5.0], conditioning=RawConditioning(max_age_s=600.0))
    assert samples.valid[at(t) < 5.0].all()
    assert not samples.valid[at(t) > 12.0].any()


def test_a_gap_makes_the_observer_start_anew():
    t = stamps(100.0, 20.0)
    t = t[(at(t) < 5.0) | (at(t) > 12.0)]
    samples, notes = one_vector(t, t)
    assert np.flatnonzero(samples.restart).tolist() == [0, np.sum(at(t) < 5.0)]
    told = next(note for note in notes if "starts anew" in note.text)
    assert (told.count, told.doubt) == (1, True)


@pytest.mark.parametrize(("attitude", "lost"), [(tumbling, True), (resting, False)])
def test_a_gap_in_quick_motion_makes_the_observer_start_anew_too(attitude, lost):
    log = flight(attitude, duration=30.0)
    signals = {}
    for name, signal in log.signals.items():
        there = (at(signal.t) < 12.0) | (at(signal.t) > 15.0)
        signals[name] = replace(signal, t=signal.t[there], y=signal.y[there])
    samples, notes = condition(replace(log, signals=signals), settings())
    assert samples.restart.sum() == 1 + lost
    doubts = texts(note for note in notes if note.doubt)
    assert ("gap in quick motion, whose turn is not told" in doubts) == lost
    assert ("bridged by interpolation, the longest 3.0" in texts(notes)) != lost
    q = fts.estimate(samples, settings()).q[at(samples.t) > 18.0]
    truth = attitude(at(samples.t)[at(samples.t) > 18.0])
    off = quaternion.log(quaternion.multiply(q, quaternion.conjugate(truth)))
    assert np.rad2deg(np.linalg.norm(off[:, :2], axis=1)).max() < 2.0


def test_a_reboot_in_the_log_makes_the_observer_start_anew():
    log = flight(duration=10.0)
    for when, first in ((START + 4 * SECOND, 400), (START + 4 * SECOND - 5_000_000, 400)):
        samples, _ = condition(replace(log, restarts=(when,)), settings())
        assert np.flatnonzero(samples.restart).tolist() == [0, first]


def test_a_reboot_outside_the_time_asked_for_changes_nothing():
    log = replace(flight(duration=10.0), restarts=(START - 1, START + 99 * SECOND))
    samples, _ = condition(log, settings())
    assert samples.restart.sum() == 1


@pytest.mark.parametrize(("rate", "parts"), [(200.0, 1), (50.0, 1), (20.0, 2), (4.0, 10)])
def test_a_slow_gyroscope_is_sub_stepped(rate, parts):
    t = stamps(rate, 10.0)
    samples, notes = one_vector(t, t)
    assert set(samples.substeps[:-1].tolist()) == {parts}
    slow = [note for note in notes if "interpolated to steps of at most 25 ms" in note.text]
    assert len(slow) == (parts > 1)
    assert all(note.doubt == (rate < 20.0) for note in slow)


def test_no_part_of_a_step_is_longer_than_was_asked_for():
    rng = np.random.default_rng(1)
    t = START + np.cumsum(rng.integers(1, 80_000_000, 500))
    samples, _ = one_vector(t, t, conditioning=RawConditioning(max_step_s=0.004))
    h = np.diff(t) / samples.substeps[:-1]
    assert h.max() <= 4_000_000
    assert (np.diff(t) / np.maximum(samples.substeps[:-1] - 1, 0.5))[
        samples.substeps[:-1] > 1
    ].min() >= 4_000_000


def test_nothing_is_stepped_across_a_restart():
    t = stamps(10.0, 20.0)
    t = t[(at(t) < 5.0) | (at(t) > 12.0)]
    samples, _ = one_vector(t, t)
    last = int(np.sum(at(t) < 5.0)) - 1
    assert samples.substeps[last] == 1
    assert samples.substeps[last - 1] == 4


def test_start_and_end_cut_the_timeline():
    samples, _ = condition(flight(duration=10.0), settings(input=Input(start_s=2.0, end_s=3.0)))
    assert at(samples.t[[0, -1]]).tolist() == [2.0, 3.0]
    assert samples.restart[0]
    assert samples.valid.all()


def test_the_default_vectors_are_those_of_the_two_that_the_log_has():
    log = flight(duration=3.0)
    for names in ((), ("accel",), ("mag",), ("accel", "mag")):
        held = {name: log.signals[name] for name in ("gyro", *names)}
        samples, notes = condition(replace(log, signals=held), settings())
        assert samples.names == names
        assert samples.body.shape == (300, len(names), 3)
        assert ("no direction is used" in texts(notes)) == (not names)


def test_a_late_magnetometer_is_put_right():
    late, _ = condition(flight(duration=60.0, late=0.12), settings())
    in_time, notes = condition(flight(duration=60.0), settings())
    samples, told = condition(flight(duration=60.0, late=0.12), settings())
    late_ms = float(texts(told).split("magnetometer ")[1].split(" ms late")[0])
    assert late_ms == pytest.approx(120.0, abs=5.0)
    assert "late against the gyroscope" not in texts(notes)
    middle = slice(100, -100)
    assert np.abs(samples.body[middle, 1] - in_time.body[middle, 1]).max() < 0.01
    assert_array_equal(samples.body, late.body)


def test_the_latency_that_is_given_is_taken():
    as_given = RawConditioning.model_validate({"magnetometer": {"latency_s": 0.12}})
    samples, notes = condition(flight(duration=20.0, late=0.12), settings(conditioning=as_given))
    truth = body(tumbling, at(samples.t), FIELD / np.linalg.norm(FIELD))
    assert "magnetometer 120 ms late" in texts(notes)
    assert np.abs(samples.body[50:-50, 1] - truth[50:-50]).max() < 2e-3
    none = RawConditioning.model_validate({"magnetometer": {"latency_s": 0.0}})
    _, notes = condition(flight(duration=60.0, late=0.12), settings(conditioning=none))
    assert "late against" not in texts(notes)


def inclination_deg(log, vectors, **sections):
    """Run ``fts`` and return the angle between true and estimated down, but for the ends."""
    samples, notes = condition(log, settings(vectors, **sections))
    q = fts.estimate(samples, fts.Config()).q
    down = np.array([0.0, 0.0, 1.0])
    truth = log.references["TRUTH"].q
    seen_down = quaternion.rotate(quaternion.conjugate(q), down)
    true_down = quaternion.rotate(quaternion.conjugate(truth), down)
    cosine = np.clip(np.sum(seen_down * true_down, axis=1), -1.0, 1.0)
    return np.rad2deg(np.arccos(cosine))[len(q) // 4 : -100], notes


MAG = {"signal": "mag", "reference": "north"}


KNOWN_FIELD = {"signal": "mag", "reference": (20.0, 2.0, 40.0)}


def test_in_coordinated_turns_the_velocity_tells_what_gravity_cannot():
    log = Turning().log()
    with_velocity, notes = inclination_deg(log, [{"signal": "accel"}, KNOWN_FIELD])
    with_gravity, _ = inclination_deg(
        log, [{"signal": "accel", "reference": "gravity"}, KNOWN_FIELD]
    )
    assert "accelerometer's reference: a - g from GPS velocity" in texts(notes)
    assert with_velocity.max() < 1.0
    assert with_gravity.max() > 10.0


def test_the_lag_of_the_velocity_is_found_and_put_right():
    log = Turning(period=20.0).log(lag=0.3)
    error, notes = inclination_deg(log, [{"signal": "accel"}, KNOWN_FIELD])
    late = next(note.text for note in notes if "velocity, +0." in note.text)
    assert float(late.split("velocity, ")[1].split(" s late")[0]) == pytest.approx(0.3, abs=0.03)
    assert error.max() < 1.5
    fixed = RawConditioning(specific_force=SpecificForce(lag_s=0.3))
    given, notes = inclination_deg(log, [{"signal": "accel"}, KNOWN_FIELD], conditioning=fixed)
    assert "+0.30 s late" in texts(notes)
    assert given.max() < 1.5


def test_turns_do_not_change_the_dip_of_the_log():
    samples, _ = condition(Turning().log(), settings())
    dip = np.arctan2(FIELD[2], np.hypot(FIELD[0], FIELD[1]))
    assert np.arcsin(samples.inertial[0, 1, 2]) == pytest.approx(dip, abs=np.deg2rad(1.0))


def test_the_dip_of_the_log_is_against_the_vertical_and_no_other_vector():
    log = flight(duration=10.0)
    star = seen(tumbling, stamps(20.0, 10.0), [1.0, 0.0, 0.0])
    log = replace(log, signals={**log.signals, "star": star})
    vectors = [{"signal": "star", "reference": (1.0, 0.0, 0.0)}, {"signal": "accel"}, MAG]
    samples, _ = condition(log, settings(vectors))
    dip = np.arctan2(FIELD[2], np.hypot(FIELD[0], FIELD[1]))
    assert np.arcsin(samples.inertial[0, 2, 2]) == pytest.approx(dip, abs=0.01)


def test_velocity_that_is_nonsense_is_left_for_gravity_and_doubted():
    log = Turning().log()
    rng = np.random.default_rng(4)
    velocity = log.signals["velocity"]
    wild = Signal(velocity.t, 30.0 * rng.normal(size=velocity.y.shape), "GPS")
    log = replace(log, signals={**log.signals, "velocity": wild})
    samples, notes = condition(log, settings([{"signal": "accel"}]))
    fell_back = [note for note in notes if "velocity does not fit the accelerometer" in note.text]
    assert [note.doubt for note in fell_back] == [True]
    assert_allclose(samples.inertial[:, 0], [[0.0, 0.0, -1.0]])


def test_velocity_that_ends_early_leaves_gravity_for_the_rest():
    log = Turning().log()
    velocity = log.signals["velocity"]
    half = Signal(velocity.t[:300], velocity.y[:300], "GPS")
    log = replace(log, signals={**log.signals, "velocity": half})
    samples, notes = condition(log, settings([{"signal": "accel"}]))
    assert np.isfinite(samples.body).all()
    assert np.isfinite(samples.inertial).all()
    assert_allclose(samples.inertial[-100:, 0], np.broadcast_to([0.0, 0.0, -1.0], (100, 3)))
    told = next(note for note in notes if "reference is gravity there" in note.text)
    assert told.count > 2500


def test_free_fall_has_no_direction_and_makes_no_nan():
    log = flight(resting, duration=10.0)
    t = log.signals["gyro"].t
    accel = log.signals["accel"].y * np.where(at(t) > 5.0, 1e-9, 1.0)[:, np.newaxis]
    falling = np.where(at(t) > 5.0, at(t) - 5.0, 0.0)[:, np.newaxis] * [0.0, 0.0, 9.80665]
    signals = {"accel": Signal(t, accel, "ACCEL"), "velocity": Signal(t, falling, "GPS")}
    samples, _ = condition(replace(log, signals={**log.signals, **signals}), settings())
    assert np.isfinite(samples.body).all()
    assert np.isfinite(samples.inertial).all()


def test_without_velocity_the_accelerometer_is_gravity_and_says_so():
    samples, notes = condition(flight(duration=3.0), settings())
    assert "gravity (the log has no velocity)" in texts(notes)
    assert_allclose(samples.inertial[0, 0], [0.0, 0.0, -1.0])


def place(t):
    return Signal(t[:1], np.array([[48.0, 11.0, 500.0]]), "GPS")


def test_magnetic_north_with_the_logs_own_dip_where_there_is_no_place():
    samples, notes = condition(flight(duration=10.0), settings())
    dip = np.arctan2(FIELD[2], np.hypot(FIELD[0], FIELD[1]))
    assert_allclose(samples.inertial[0, 1], [np.cos(dip), 0.0, np.sin(dip)], atol=1e-3)
    told = next(note for note in notes if "magnetic north" in note.text)
    assert f"dip {np.rad2deg(dip):+.1f}° as in the log" in told.text
    assert told.doubt


@pytest.mark.parametrize("reference", [None, "magnetic"])
def test_a_declination_that_the_log_tells_is_used_where_there_is_no_place(reference):
    log = replace(flight(duration=10.0), declination=-0.2)
    config = settings([{"signal": "accel"}, {"signal": "mag", "reference": reference}])
    samples, notes = condition(log, config)
    dip = np.arctan2(FIELD[2], np.hypot(FIELD[0], FIELD[1]))
    level = [np.cos(dip) * np.cos(0.2), -np.cos(dip) * np.sin(0.2), np.sin(dip)]
    assert_allclose(samples.inertial[0, 1], level, atol=1e-3)
    told = next(note for note in notes if "magnetic reference" in note.text)
    assert told.text == (
        "magnetic reference: magnetic north, -11.5° east of true north by the log's COMPASS_DEC, "
        f"dip {np.rad2deg(dip):+.1f}° as in the log"
    )
    assert not told.doubt
    assert_allclose(magnetic.north(dip, "enu", -0.2), [level[1], level[0], -level[2]], atol=1e-3)


def test_a_declination_yields_to_a_place_and_to_north():
    log = replace(flight(duration=10.0, utc=YEAR_2024), declination=-0.2)
    samples, _ = condition(log, settings([{"signal": "accel"}, MAG]))
    assert abs(samples.inertial[0, 1, 1]) < 1e-6
    t = log.signals["gyro"].t
    _, notes = condition(replace(log, signals={**log.signals, "position": place(t)}), settings())
    assert "World Magnetic Model" in texts(notes)
    assert "COMPASS_DEC" not in texts(notes)


def test_north_that_was_asked_for_is_no_doubt():
    _, notes = condition(flight(duration=3.0), settings([{"signal": "accel"}, MAG]))
    told = next(note for note in notes if "magnetic north" in note.text)
    assert not told.doubt


def test_heading_is_against_true_north_where_the_place_is_known():
    log = flight(duration=10.0, utc=YEAR_2024)
    t = log.signals["gyro"].t
    at_place = replace(log, signals={**log.signals, "position": place(t)})
    samples, notes = condition(at_place, settings())
    assert "World Magnetic Model at 48.00, 11.00 in 2024.5" in texts(notes)
    heading = np.rad2deg(np.arctan2(samples.inertial[0, 1, 1], samples.inertial[0, 1, 0]))
    assert heading == pytest.approx(4.2, abs=0.3)  # the declination of Munich
    assert samples.inertial[0, 1, 2] > 0.85


def test_a_dip_that_is_not_the_models_is_told_and_taken_from_the_log():
    log = flight(duration=10.0, utc=YEAR_2024)
    t = log.signals["gyro"].t
    odd = seen(tumbling, t, [40e-6, 0.0, 10e-6])
    log = replace(log, signals={**log.signals, "position": place(t), "mag": odd})
    samples, notes = condition(log, settings())
    told = next(note for note in notes if "the log's is used" in note.text)
    assert "dip in the log is +14.0°" in told.text
    assert told.doubt
    assert samples.inertial[0, 1, 2] == pytest.approx(np.sin(np.arctan2(10, 40)), abs=1e-3)


NED_TO_ENU = quaternion.normalize(np.array([0.0, 1.0, 1.0, 0.0]))
FRD_TO_FLU = np.array([0.0, 1.0, 0.0, 0.0])


def as_enu(log):
    """Return the same flight with world east-north-up and body forward-left-up."""
    flipped = {}
    for name, signal in log.signals.items():
        turn = NED_TO_ENU if name == "velocity" else FRD_TO_FLU
        y = signal.y if name == "position" else quaternion.rotate(turn, signal.y)
        flipped[name] = Signal(signal.t, y, signal.source)
    return replace(log, signals=flipped, world="enu", body="flu")


@pytest.mark.parametrize("moving", [False, True])
def test_east_north_up_gives_the_same_attitude_in_other_axes(moving):
    if moving:
        log = Turning().log(40.0)
    else:
        log = flight(duration=20.0, utc=YEAR_2024)
        log = replace(log, signals={**log.signals, "position": place(log.signals["gyro"].t)})
    # weights go along the world's axes: alike for north and east, so that they may be swapped
    gains = {"weights": {"k": (1.2, 1.2 + 1e-12, 30.0)}}
    config = fts.Config.model_validate(gains)
    ned = fts.estimate(condition(log, config)[0], config)
    enu = fts.estimate(condition(as_enu(log), config)[0], config)
    turned = quaternion.multiply(quaternion.multiply(NED_TO_ENU, ned.q), FRD_TO_FLU)
    assert angle_deg(enu.q, turned).max() < 1e-3


def test_vectors_of_no_length_are_left_out_and_counted():
    log = flight(duration=5.0)
    accel = log.signals["accel"]
    y = accel.y.copy()
    y[[0, 7, 8]] = 0.0
    signals = {**log.signals, "accel": Signal(accel.t, y, "RAW_IMU")}
    samples, notes = condition(replace(log, signals=signals), settings())
    told = next(note for note in notes if "RAW_IMU vector of" in note.text)
    assert told.count == 3
    assert np.abs(samples.body[:, 0] - body(tumbling, at(accel.t), [0.0, 0.0, -1.0])).max() < 0.01


def test_a_signal_without_any_direction_is_left_alone_unless_it_was_asked_for():
    log = flight(duration=5.0)
    mag = log.signals["mag"]
    dead = replace(log, signals={**log.signals, "mag": Signal(mag.t, 0.0 * mag.y, "RAW_IMU")})
    assert condition(dead, settings())[0].names == ("accel",)
    with pytest.raises(ReadError, match=r"flight\.csv: 'mag' has no sample with a direction"):
        condition(dead, settings([MAG]))


def test_gyroscope_samples_beyond_all_reason_are_left_out_and_counted():
    log = flight(duration=5.0)
    y = log.signals["gyro"].y.copy()
    y[[10, 20]] = 1e9
    wild = replace(log, signals={**log.signals, "gyro": Signal(log.signals["gyro"].t, y, "GYRO")})
    samples, notes = condition(wild, settings())
    assert len(samples.t) == 498
    told = next(note for note in notes if "rad/s left out" in note.text)
    assert (told.count, told.doubt) == (2, True)
    y[:] = 1e9
    with pytest.raises(ReadError, match=r"flight\.csv: .*Check its unit\."):
        condition(wild, settings())


def test_without_a_gyroscope_the_error_names_what_there_is():
    log = flight(duration=3.0)
    held = {name: log.signals[name] for name in ("accel", "mag")}
    with pytest.raises(
        ReadError, match=r"flight\.csv: no 'gyro' signal\. The log holds: accel, mag\."
    ):
        condition(replace(log, signals=held), settings())


@pytest.mark.parametrize(
    ("cut", "count"), [({"start_s": 2.995}, 0), ({"start_s": 2.985}, 1), ({"end_s": 0.005}, 1)]
)
def test_a_cut_that_leaves_too_little_says_how_long_the_log_is(cut, count):
    with pytest.raises(
        ReadError, match=rf"{count} gyroscope samples .*The log has 300 over 3\.0 s"
    ):
        condition(flight(duration=3.0), settings(input=Input(**cut)))


def test_an_unknown_signal_is_refused_with_those_there_are():
    vectors = [{"signal": "sun", "reference": (1.0, 0.0, 0.0)}]
    with pytest.raises(ReadError, match=r"no 'sun' signal\. The log holds: accel, gyro, mag\."):
        condition(flight(duration=3.0), settings(vectors))


@pytest.mark.parametrize(
    ("signal", "reference"),
    [("mag", "gravity"), ("accel", "magnetic"), ("accel", "north"), ("gyro", None)],
)
def test_a_reference_that_does_not_suit_its_signal_is_a_wrong_configuration(signal, reference):
    vectors = [{"signal": signal, "reference": reference}]
    told = rf"'{signal}' cannot have the reference '{reference or 'null'}'.*constant \[x, y, z\]"
    with pytest.raises(ConfigError, match=told):
        condition(flight(duration=3.0), settings(vectors))


def test_specific_force_without_velocity_says_what_to_do():
    vectors = [{"signal": "accel", "reference": "specific_force"}]
    with pytest.raises(ReadError, match=r"no velocity, .*'reference: gravity' for 'accel'"):
        condition(flight(duration=3.0), settings(vectors))


def test_magnetic_without_a_place_says_what_to_do():
    vectors = [{"signal": "mag", "reference": "magnetic"}]
    with pytest.raises(ReadError, match=r"no position, .*'reference: north' for 'mag'"):
        condition(flight(duration=3.0), settings(vectors))


def test_the_notes_of_a_clean_flight_hold_one_doubt_only():
    _, notes = condition(flight(duration=20.0), settings())
    assert [note.text for note in notes if note.doubt] == [
        note.text for note in notes if "magnetic north" in note.text
    ]


def test_a_magnetometer_named_first_changes_nothing():
    log = flight(duration=20.0)
    orders = [("accel", "mag"), ("mag", "accel")]
    found = [condition(log, settings([{"signal": s} for s in order]))[0] for order in orders]
    assert found[1].names == ("mag", "accel")
    assert_allclose(found[1].inertial[:, ::-1], found[0].inertial, atol=1e-15)


def test_one_direction_alone_is_told_to_leave_a_turn_open():
    log = flight(duration=5.0)
    _, notes = condition(log, settings([{"signal": "accel"}]))
    (told,) = [note for note in notes if "only direction" in note.text]
    assert told.doubt
    assert "drifts" in told.text


def test_nothing_reaches_across_a_restart():
    """A vehicle that was turned by 90° while it was off, its magnetometer slower than its gyro."""

    def rolling(seconds):
        return quaternion.from_euler(0.1 * np.sin(seconds), 0.0 * seconds, 0.0 * seconds)

    def turned(seconds):
        return quaternion.from_euler(0.1 * np.sin(seconds), 0.0 * seconds, (seconds >= 10.0) * 1.5)

    t, slow = stamps(100.0, 20.0), stamps(7.0, 20.0)
    signals = {
        "gyro": gyro(rolling, t),
        "accel": seen(turned, slow, [0.0, 0.0, -9.81]),
        "mag": seen(turned, slow, FIELD),
    }
    log = replace(recording(signals), restarts=(int(START + 10 * SECOND),))
    samples, _ = condition(log, settings())
    expected = body(turned, at(t), FIELD / np.linalg.norm(FIELD))
    far = np.arccos(np.clip(np.sum(samples.body[:, 1] * expected, axis=1), -1.0, 1.0))
    assert samples.restart.sum() == 2
    assert np.rad2deg(far).max() < 3.0


def test_a_second_direction_that_comes_late_is_led_back_to_the_start():
    t = stamps(100.0, 20.0)
    signals = {
        "gyro": gyro(tumbling, t),
        "accel": seen(tumbling, t, [0.0, 0.0, -9.81]),
        "mag": seen(tumbling, t[300:], FIELD),
    }
    config = settings(conditioning=RawConditioning(max_age_s=0.1))
    samples, _ = condition(recording(signals), config)
    assert not samples.valid[0, 1]
    found = fts.estimate(samples, config).q[:1]
    declination = np.rad2deg(np.arctan2(FIELD[1], FIELD[0]))  # without a place, magnetic north
    assert angle_deg(found, tumbling(at(t))[:1]).max() < declination + 1.0


def test_rest_is_found_where_there_is_an_accelerometer_to_tell():
    t, slow = stamps(100.0, 20.0), stamps(25.0, 20.0)
    still = {"gyro": gyro(resting, t), "accel": seen(resting, slow, [0.0, 0.0, -9.81])}
    samples, _ = condition(recording(still), settings(conditioning=RawConditioning(rest=True)))
    assert samples.rest.all()
    moving = {"gyro": gyro(tumbling, t), "accel": seen(tumbling, slow, [0.0, 0.0, -9.81])}
    samples, _ = condition(recording(moving), settings(conditioning=RawConditioning(rest=True)))
    assert not samples.rest.any()
    samples, _ = condition(
        recording({"gyro": gyro(resting, t)}), settings(conditioning=RawConditioning(rest=True))
    )
    assert samples.rest is None
