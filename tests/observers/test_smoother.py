from dataclasses import replace
from pathlib import Path

import numpy as np
import observing
import pytest
from flights import G, angle_deg, samples
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from attest import comparison, conditioning, config, pipeline
from attest.conditioning.rest import rest
from attest.errors import ConfigError
from attest.evaluation import attestation
from attest.geometry import quaternion
from attest.observers import cgo, smoother
from attest.recording import Clock, Recording, Signal

H = 0.01
UP = np.array([0.0, 0.0, G])
NORTH = np.array([0.0, 2e-5, -4e-5])
"""A magnetic field, east-north-up, tesla."""
BIAS = np.array([0.01, -0.02, 0.015])
EXACT = smoother.Config(gains=smoother.Gains(delay_s=0.0))
"""Of simulated sensors, which are not late."""
SHORT = ["input.end_s=2"]
"""The sample flight at rest, and no more."""


def turning(seconds):
    """Attitude of a body that turns about all axes after 4 s of rest, and rests at the end."""
    s = np.clip(seconds - 4.0, 0.0, 50.0)
    fade = np.sin(np.pi * s / 50.0) ** 2
    return quaternion.from_euler(
        fade * np.sin(0.9 * s), 0.8 * fade * np.sin(0.7 * s + 1.0), 2.0 * fade * np.sin(0.31 * s)
    )


def log(*, seed=0, n=6000, noise=1.0, mag=True, field=NORTH, iron=(0.0, 0.0, 0.0), **other):
    """Return samples of noisy sensors, and the truth; field is (3,) or (n, 3)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * round(H * 1e9)
    s = t * 1e-9
    q = turning(s)
    ahead = quaternion.multiply(quaternion.conjugate(turning(s - 1e-4)), turning(s + 1e-4))
    gyro = quaternion.log(ahead) / 2e-4 + BIAS + noise * rng.normal(0.0, 0.003, (n, 3))
    known = np.stack([np.broadcast_to(UP, (n, 3)), np.broadcast_to(field, (n, 3))], axis=1)
    body = quaternion.rotate(quaternion.conjugate(q)[:, np.newaxis], known)
    body[:, 0] += noise * rng.normal(0.0, 0.05, (n, 3))
    body[:, 1] += noise * rng.normal(0.0, 3e-7, (n, 3)) + np.array(iron)
    body = body[:, : 1 + mag]
    length = np.linalg.norm(body, axis=2)
    e = np.stack([UP, NORTH])[: 1 + mag]
    made = samples(
        t,
        gyro,
        body / length[..., np.newaxis],
        [e / np.linalg.norm(e, axis=1, keepdims=True)],
        names=("accel", "mag")[: 1 + mag],
        length=length,
        rest=rest(t, gyro, body[:, 0]),
        **other,
    )
    return made, q


def nees(found, q, part=slice(None)):
    """Return the mean normalised error squared."""
    theta = quaternion.log(quaternion.multiply(found.q, quaternion.conjugate(q)))
    return attestation.normalised(theta[part], found.states["attitude_covariance"][part]).mean()


def test_it_finds_attitude_and_bias():
    made, q = log()
    found = smoother.estimate(made, EXACT)
    assert angle_deg(found.q, q).max() < 0.5
    assert np.abs(found.gyro_bias - BIAS).max() < np.deg2rad(0.05)
    assert_allclose(found.angular_velocity, made.gyro - found.gyro_bias, atol=0.02)
    observing.assert_sound(found)


@pytest.mark.slow
def test_a_gyroscope_that_is_off_in_scale_and_alignment_is_put_right():
    made, q = log()
    bent = np.eye(3) + 0.01 * np.array([[1.0, -0.8, 0.5], [0.3, -1.0, 0.6], [-0.7, 0.4, 0.9]])
    made = replace(made, gyro=(made.gyro - BIAS) @ bent.T + BIAS)
    believed = smoother.Config(gains=smoother.Gains(delay_s=0.0, gyro_scale=1e-6))
    here, there = (angle_deg(smoother.estimate(made, c).q, q) for c in (EXACT, believed))
    assert here.max() < 1.5
    assert here.mean() < 0.7 * there.mean()


def test_a_field_that_is_disturbed_halfway_turns_nothing():
    field = np.tile(NORTH, (6000, 1))
    field[2000:3500] += [2e-5, -1e-5, 1e-5]
    made, q = log(field=field)
    found = smoother.estimate(made, EXACT)
    assert angle_deg(found.q, q).max() < 2.0
    weight = found.states["field_weight"]
    assert weight[2200:3300].max() < 0.5 * np.median(weight[4000:])
    assert weight[2200:3300].min() > 0.0


def test_a_heading_that_the_field_alone_tells_is_never_starved():
    field = np.tile(NORTH, (6000, 1))
    field[:, :2] = np.array([1.9e-5, 6e-6])  # another north than the known one, for good
    made, q = log(field=field)
    off = quaternion.log(
        quaternion.multiply(smoother.estimate(made, EXACT).q, quaternion.conjugate(q))
    )
    expected = np.arctan2(NORTH[1], NORTH[0]) - np.arctan2(6e-6, 1.9e-5)
    assert_allclose(off[:, 2], expected, atol=0.03)


@pytest.mark.slow
def test_hard_iron_is_found():
    clean, q = log()
    made, _ = log(iron=(6e-6, -3e-6, 4e-6))
    found = smoother.estimate(made, EXACT)
    assert angle_deg(found.q, q).max() < 2.0
    assert angle_deg(smoother.estimate(clean, EXACT).q, q).max() < 1.0


def test_without_a_magnetometer_the_vertical_is_found_and_heading_is_said_to_be_open():
    made, q = log(mag=False)
    found = smoother.estimate(made, EXACT)
    up = quaternion.rotate(quaternion.multiply(found.q, quaternion.conjugate(q)), np.eye(3)[2])
    assert np.degrees(np.arccos(up[:, 2])).max() < 0.5
    P = found.states["attitude_covariance"]
    assert np.sqrt(P[:, 5]).min() > 1.0  # rad
    assert np.sqrt(P[:, [0, 3]]).max() < 0.05
    assert "field_weight" not in found.states


def test_without_vectors_the_estimate_is_the_integrated_gyroscope():
    Omega = observing.motion(500)
    made = observing.sampled(Omega, np.empty((500, 0, 3)), [])
    found = smoother.estimate(made, EXACT)
    ends = np.concatenate([Omega[1:], Omega[-1:]])
    expected = observing.truth(observing.IDENTITY, 0.5 * (Omega + ends))
    assert angle_deg(found.q, expected).max() < 1e-3


def test_without_a_gyroscope_it_is_refused():
    made, _ = log(n=10)
    with pytest.raises(ConfigError, match="smoother: needs a gyroscope"):
        smoother.estimate(replace(made, gyro=made.gyro * np.nan), EXACT)


@pytest.mark.parametrize("names", [("sun", "star"), ("accel", "star")])
def test_any_directions_tell_the_attitude(names):
    made, q = log()
    found = smoother.estimate(replace(made, names=names, rest=None), EXACT)
    assert angle_deg(found.q, q).max() < 2.0
    assert np.rad2deg(np.abs(found.gyro_bias - BIAS)).max() < 0.2


def test_a_restart_starts_attitude_anew_and_the_bias_goes_on():
    made, q = log()
    turned = quaternion.exp(np.array([0.0, 0.0, 2.0]))
    body = made.body.copy()
    body[3000:] = quaternion.rotate(turned, body[3000:])  # the body was turned, unseen
    gyro = np.concatenate(
        [made.gyro[:3000], quaternion.rotate(turned, made.gyro[3000:] - BIAS) + BIAS]
    )
    q = np.concatenate([q[:3000], quaternion.multiply(q[3000:], quaternion.conjugate(turned))])
    restart = np.isin(np.arange(6000), [0, 3000])
    t = made.t + 10_000_000_000 * (np.arange(6000) >= 3000)
    found = smoother.estimate(
        replace(made, t=t, gyro=gyro, body=body, restart=restart, rest=None), EXACT
    )
    assert angle_deg(found.q, q).max() < 1.5
    assert np.rad2deg(np.abs(np.diff(found.gyro_bias, axis=0))).max() < 0.2


@pytest.mark.slow
def test_a_gap_in_the_vectors_is_bridged_by_the_gyroscope():
    made, q = log()
    valid = made.valid.copy()
    valid[2000:3000] = False
    found = smoother.estimate(replace(made, valid=valid), EXACT)
    assert angle_deg(found.q, q).max() < 1.0
    sure = found.states["attitude_std"]
    assert sure[2500].max() > sure[1900].max()
    wild = made.body.copy()
    wild[2000:3000] = [0.0, 0.0, 1.0]  # and what is not valid is not looked at
    other = smoother.estimate(replace(made, valid=valid, body=wild), EXACT)
    assert angle_deg(other.q, found.q).max() < 1e-6


@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_a_log_of_a_few_steps_has_an_attitude(n):
    made, q = log(n=n)
    found = smoother.estimate(made, EXACT)
    observing.assert_sound(found)
    assert angle_deg(found.q, q).max() < 5.0


@pytest.mark.slow
def test_errors_are_as_large_as_the_covariance_says():
    correct = {"field": 0.02, "hard_iron": 1e-4, "field_delay": 0.0, "delay_s": 0.0}
    correct |= {"gyro_scale": 1e-5, "gyro_rest": 1e-6, "bias_walk": 1e-6}
    correct |= {"speed": 0.05, "speed_time": 0.01, "accel_bias": 1e-4, "accel_noise": 1e-3}
    config = smoother.Config(gains=smoother.Gains(**correct))
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        # the local field that it expects: 2 % of the world's, other every 10 s
        local = np.repeat(rng.normal(0.0, 0.02 * np.linalg.norm(NORTH), (6, 3)), 1000, axis=0)
        made, q = log(seed=seed, field=NORTH + local)
        found.append(nees(smoother.estimate(made, config), q, slice(500, 5500, 50)))
    assert 0.5 < np.mean(found) < 6.0


def test_the_covariance_is_that_of_both_states():
    made, _ = log(n=2000)
    found = smoother.estimate(made, EXACT)
    P = found.states["attitude_covariance"][:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    R = Rotation.from_quat(found.q, scalar_first=True).as_matrix()
    in_body = np.swapaxes(R, 1, 2) @ P @ R
    assert_allclose(found.states["attitude_std"], np.sqrt(np.diagonal(in_body, axis1=1, axis2=2)))
    assert (np.linalg.eigvalsh(P) > 0.0).all()


@pytest.mark.slow
@settings(max_examples=4)
@given(turn=st.floats(-3.0, 3.0))
def test_it_does_not_care_where_north_is(turn):
    made, _ = log(n=2500)
    Q = quaternion.exp(np.array([0.0, 0.0, turn]))
    here = smoother.estimate(made, EXACT)
    there = smoother.estimate(replace(made, inertial=quaternion.rotate(Q, made.inertial)), EXACT)
    assert angle_deg(quaternion.multiply(Q, here.q), there.q).max() < 0.01
    assert_allclose(there.gyro_bias, here.gyro_bias, atol=1e-5)


def test_it_does_not_care_how_the_sensors_sit_in_the_body():
    made, _ = log(n=2500)
    Q = quaternion.exp(np.array([1.0, -2.0, 0.5]))
    here = smoother.estimate(made, EXACT)
    turned = replace(
        made, gyro=quaternion.rotate(Q, made.gyro), body=quaternion.rotate(Q, made.body)
    )
    there = smoother.estimate(turned, EXACT)
    assert angle_deg(quaternion.multiply(there.q, Q), here.q).max() < 0.01
    assert_allclose(there.gyro_bias, quaternion.rotate(Q, here.gyro_bias), atol=1e-5)


def test_the_past_knows_the_future():
    """Unlike a filter's, its first attitude is as good as the last."""
    made, q = log(noise=3.0)
    found = smoother.estimate(replace(made, rest=None), EXACT)
    off = angle_deg(found.q, q)
    assert off[:500].max() < 3.0 * off.mean() + 0.2


@pytest.mark.slow
def test_the_delay_turns_the_attitude_on_to_its_stamp():
    made, _ = log()
    now = smoother.estimate(made, EXACT)
    late = smoother.estimate(made, smoother.Config(gains=smoother.Gains(delay_s=0.01)))
    turn = quaternion.log(quaternion.multiply(quaternion.conjugate(now.q), late.q))
    assert_allclose(turn, 0.01 * now.angular_velocity, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(made=observing.any_samples(), named=st.booleans())
def test_no_measurement_makes_a_nan(made, named):
    names = ("accel", "mag", *made.names[2:])[: len(made.names)] if named else made.names
    observing.assert_sound_run(smoother, replace(made, names=names), smoother.Config())


@pytest.mark.parametrize(("key", "value"), [("field", 0.0), ("node_s", 0.0), ("speed", -1.0)])
def test_gains_that_are_no_deviations_are_refused(key, value):
    assert f"'gains.{key}' is {value}" in observing.refusal(smoother, key, value)


LOG = Path(__file__).parents[2] / "sample_logs" / "quadcopter.tlog"


@pytest.mark.slow
def test_golden_of_the_sample_flight():
    found = pipeline.run(LOG, pipeline.configure("smoother"))
    assert_allclose(found.metrics.total.rmse, 0.48, atol=0.03)
    assert_allclose(found.metrics.inclination.rmse, 0.35, atol=0.03)
    (claim,) = [c for c in found.claims if "covariance" in c.statement]
    assert claim.holds
    assert claim.value > 0.95  # of the errors are within it


def test_it_claims_no_more_than_it_found():
    told = [n.text for n in pipeline.run(LOG, pipeline.configure("smoother", SHORT)).notes]
    (gyro,) = [text for text in told if text.startswith("gyroscope: bias")]
    assert gyro.endswith(" °/s at the end, found in the whole log and taken off")
    assert "accelerometer used as it is: the whole log tells no bias or scale" in told
    assert "magnetometer used as it is: the whole log tells no hard iron" in told


def test_filters_tell_a_bias_that_they_knew_too_late():
    result = pipeline.run(LOG, pipeline.configure("cgo", SHORT))
    (text,) = [n.text for n in result.notes if n.text.startswith("gyroscope: bias")]
    late = "; that came late: +0.00, +0.00, +0.00 °/s was taken off at the last step"
    assert text.endswith("taken off as they became known" + late)
    assert not result.samples.bias[-1].any()


@pytest.mark.slow
def test_it_is_the_reference_of_a_log_that_is_asked_for_and_no_truth():
    found = pipeline.run(LOG, pipeline.configure("cgo", ["evaluation.reference=smoother"]))
    assert (found.reference.name, found.metrics.kind) == ("smoother", "smoother")
    assert found.metrics.bias_true is None
    assert found.summary["reference"]["independent"] is False
    assert any("not truth" in note.text for note in found.notes)
    ours = pipeline.run(LOG, pipeline.configure("smoother", ["evaluation.reference=none"]))
    assert_allclose(found.metrics.q_ref, ours.estimates.q, atol=1e-9)


def test_as_a_reference_it_has_the_vectors_and_the_calibration_of_the_run():
    given = {
        "vectors": [{"signal": "mag", "reference": "north"}],
        "conditioning": {
            "magnetometer": {"calibrate": {"hard_iron": [1.0, 2.0, 3.0]}, "latency_s": 0.1},
            "accelerometer": {"bias": [0.1, 0.0, 0.0]},
            "gyroscope": {"bias": [0.0, 0.01, 0.0], "sample": "ends"},
        },
    }
    whole = config.validate(cgo.Config, {"observer": "cgo", **given}, "given")
    made = config.with_its_sensors(smoother.Config, "smoother", whole)
    assert made.vectors == whole.vectors
    assert made.conditioning.magnetometer.calibrate == whole.conditioning.magnetometer.calibrate
    assert made.conditioning.magnetometer.latency_s == 0.1
    assert made.conditioning.accelerometer == whole.conditioning.accelerometer
    assert made.conditioning.gyroscope.bias == (0.0, 0.01, 0.0)
    own = smoother.Config()
    assert made.conditioning.gyroscope.sample == own.conditioning.gyroscope.sample
    assert made.conditioning.smoothing == own.conditioning.smoothing
    plain = config.with_its_sensors(smoother.Config, "smoother", cgo.Config())
    assert plain == own


def test_it_is_no_reference_for_itself():
    itself = pipeline.configure("smoother", ["evaluation.reference=smoother"])
    with pytest.raises(ConfigError, match="no reference for itself"):
        pipeline.run(LOG, itself)


@pytest.mark.slow
def test_compare_leaves_it_out_of_the_ranking_against_itself():
    wanted = ["evaluation.reference=smoother"]
    configurations = {name: pipeline.configure(name, wanted) for name in ("smoother", "cgo")}
    results, failed = comparison.compare(LOG, configurations)
    assert [result.estimates.observer for result in results] == ["cgo"]
    assert failed == {"smoother": "is the reference, and not ranked against itself"}


BROAD = {
    "05_undisturbed_slow_rotation_with_breaks_B": 0.8,
    "16_undisturbed_fast_translation_B": 1.0,
    "30_disturbed_stationary_magnet_C": 0.8,
    "34_disturbed_attached_magnet_3cm": 1.2,
}
"""Total RMSE in degrees that is not to be exceeded; `vqf` has 0.99, 0.74, 2.57 and 3.35."""


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize("name", BROAD)
def test_optical_truth(shared, name):
    trial = loadmat(shared / "broad" / f"{name}.mat", squeeze_me=True)
    t = np.round(np.arange(len(trial["imu_gyr"])) / trial["sampling_rate"] * 1e9).astype(np.int64)
    measured = {"gyro": trial["imu_gyr"], "accel": trial["imu_acc"], "mag": 1e-6 * trial["imu_mag"]}
    signals = {key: Signal(t, np.array(y, np.float64), key) for key, y in measured.items()}
    recording = Recording(Path(name), "csv", signals, {}, Clock("trial"), world="enu")
    made, _ = conditioning.condition(recording, smoother.Config())
    found = smoother.estimate(made, smoother.Config())
    scored = np.isfinite(trial["opt_quat"]).all(axis=1) & (trial["movement"] > 0.5)
    off = angle_deg(found.q, np.nan_to_num(trial["opt_quat"]))[scored]
    assert np.sqrt(np.mean(off**2)) < BROAD[name]
    assert nees(found, np.nan_to_num(trial["opt_quat"], nan=0.5), scored) < 6.0  # not too sure


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize(
    ("log", "worst"), [("tlog/quadplane_sitl.tlog", 1.5), ("ulog/auav_x21.ulg", 2.0)]
)
def test_flights(shared, log, worst):
    found = pipeline.run(shared / log, pipeline.configure("smoother"))
    assert found.metrics.without_heading_offset.rmse < worst
