import sys
from dataclasses import replace

import numpy as np
import observing
import pytest
import vqf as package
from flights import G, angle_deg, samples
from numpy.testing import assert_allclose

from attest import config
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.observers import vqf

CONFIG = vqf.Config()
H = 0.0097
"""Step, s; time constants of the package are no multiples of it, and no rounding matters."""
TO_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""East-north-up to north-east-down."""
UP = np.array([0.0, 0.0, G])
NORTH = np.array([0.0, 2e-5, -4e-5])
"""A magnetic field, east-north-up, tesla."""


def tumbling(n, h=H):
    """Return quaternions body to east-north-up of a body that turns slowly, and its rate."""
    Omega = 0.5 * observing.motion(n, h)
    return observing.truth(quaternion.exp(np.array([0.1, -0.2, 0.7])), Omega, h), Omega


def log(n=3000, *, h=H, world="enu", declination=0.0, mag=True, bias=(0.0, 0.0, 0.0), **other):
    """Return samples of an accelerometer and a magnetometer that turn, and q.

    Magnetic north is turned by the declination, rad, from the world's north to the east.
    """
    q, Omega = tumbling(n, h)
    east = quaternion.exp(np.array([0.0, 0.0, -declination]))
    known = np.stack([UP, quaternion.rotate(east, NORTH)][: 1 + mag])
    body = observing.seen(q, known)
    if world == "ned":
        known, q = quaternion.rotate(TO_NED, known), quaternion.multiply(TO_NED, q)
    length = np.linalg.norm(body, axis=2)
    made = samples(
        np.arange(n) * round(h * 1e9),
        Omega + np.array(bias),
        body / length[..., np.newaxis],
        [known / np.linalg.norm(known, axis=1, keepdims=True)],
        names=("accel", "mag")[: 1 + mag],
        length=length,
        **other,
    )
    return made, q


def measured(made):
    """Return gyroscope, accelerometer and magnetometer in their units, for the package."""
    whole = made.length[..., np.newaxis] * made.body
    return [made.gyro, *(np.ascontiguousarray(whole[:, i]) for i in range(whole.shape[1]))]


def apart(q, r):
    """Return the largest angle between rotations, rad."""
    return np.deg2rad(angle_deg(q, r)).max()


def test_at_a_constant_step_in_east_north_up_it_is_the_packages_answer():
    made, _ = log()
    found = vqf.estimate(made, CONFIG)
    expected = package.VQF(H).updateBatch(*measured(made))
    assert apart(found.q, expected["quat9D"]) < 1e-9
    assert_allclose(found.gyro_bias, expected["bias"], atol=1e-9)
    assert_allclose(found.angular_velocity, made.gyro - expected["bias"], atol=1e-9)


def test_at_steps_of_10_ms_it_is_the_packages_answer_to_the_last_digit():
    made, _ = log(h=0.01)
    expected = package.VQF(0.01).updateBatch(*measured(made))
    assert apart(vqf.estimate(made, CONFIG).q, expected["quat9D"]) < 1e-9


def test_without_a_magnetometer_it_is_the_packages_answer_of_six_axes():
    made, _ = log(mag=False)
    expected = package.VQF(H).updateBatch(*measured(made))
    assert apart(vqf.estimate(made, CONFIG).q, expected["quat6D"]) < 1e-9
    ned, _ = log(mag=False, world="ned")
    turned = quaternion.multiply(TO_NED, expected["quat6D"])
    assert apart(vqf.estimate(ned, CONFIG).q, turned) < 1e-9


def test_its_gains_are_the_packages():
    made, _ = log()
    gains = vqf.Gains(tauAcc=1.0, tauMag=3.0)
    found = vqf.estimate(made, CONFIG.model_copy(update={"gains": gains}))
    expected = package.VQF(H, tauAcc=1.0, tauMag=3.0).updateBatch(*measured(made))["quat9D"]
    assert apart(found.q, expected) < 1e-9
    assert apart(found.q, vqf.estimate(made, CONFIG).q) > 1e-6


@pytest.mark.parametrize("mag", [True, False])
def test_the_offline_variant_is_the_packages(mag):
    made, _ = log(mag=mag)
    found = vqf.estimate(made, CONFIG.model_copy(update={"gains": vqf.Gains(offline=True)}))
    gyro, accel, *field = measured(made)
    parameters = {"tauAcc": 3.0, "tauMag": 9.0}
    expected = package.offlineVQF(gyro, accel, field[0] if mag else None, H, parameters)
    assert apart(found.q, expected["quat9D" if mag else "quat6D"]) < 1e-9
    assert_allclose(found.gyro_bias, expected["bias"], atol=1e-9)


@pytest.mark.parametrize("world", ["enu", "ned"])
@pytest.mark.parametrize("declination", [0.0, 0.2, -1.0, 3.0])
def test_it_finds_the_true_attitude_in_either_world_and_at_any_declination(world, declination):
    made, q = log(world=world, declination=declination)
    assert angle_deg(vqf.estimate(made, CONFIG).q, q)[1000:].max() < 1.0


@pytest.mark.parametrize("world", ["enu", "ned"])
def test_a_turn_of_the_known_field_turns_the_heading_by_as_much(world):
    made, _ = log(world=world)
    about = quaternion.exp(np.array([0.0, 0.0, 0.4]))
    known = made.inertial.copy()
    known[:, 1] = quaternion.rotate(about, known[:, 1])
    here, there = (vqf.estimate(each, CONFIG).q for each in (made, replace(made, inertial=known)))
    assert apart(there, quaternion.multiply(about, here)) < 1e-9


def test_a_known_field_that_moves_turns_the_heading_along():
    made, q = log(world="ned")
    angles = np.linspace(0.0, 0.5, len(q))
    known = np.repeat(made.inertial, len(q), axis=0)
    about = quaternion.exp(np.outer(angles, [0.0, 0.0, 1.0]))
    known[:, 1] = quaternion.rotate(about, known[:, 1])
    here, there = (vqf.estimate(each, CONFIG).q for each in (made, replace(made, inertial=known)))
    assert apart(there, quaternion.multiply(about, here)) < 1e-9


def test_it_finds_a_constant_bias():
    beta = np.array([0.01, -0.02, 0.005])
    made, q = log(6000, bias=beta)
    found = vqf.estimate(made, CONFIG)
    assert np.linalg.norm(found.gyro_bias[-1] - beta) < 5e-3
    assert angle_deg(found.q[-1], q[-1]) < 2.0


def test_diagnostics_are_of_the_logs_vectors():
    made, _ = log(300)
    found = vqf.estimate(made, CONFIG)
    assert_allclose(found.q, quaternion.continuous(found.q))
    assert found.cost[-1] < 1e-2
    bent = replace(made, inertial=quaternion.rotate(quaternion.exp(np.ones(3)), made.inertial))
    assert (vqf.estimate(bent, CONFIG).cost > 1.0).all()
    assert found.updated.tobytes() == made.valid.tobytes()


def test_irregular_stamps_are_brought_to_the_median_step_and_back():
    made, q = log(6000)
    keep = np.sort(np.random.default_rng(1).choice(6000, 4500, replace=False))
    keep[0] = 0
    irregular = replace(
        made,
        t=made.t[keep],
        gyro=made.gyro[keep],
        body=made.body[keep],
        length=made.length[keep],
        valid=made.valid[keep],
        substeps=made.substeps[keep],
        restart=made.restart[keep],
    )
    found = vqf.estimate(irregular, CONFIG)
    assert found.t.tolist() == irregular.t.tolist()
    assert angle_deg(found.q, q[keep])[1000:].max() < 1.5


def test_a_restart_starts_anew():
    made, _ = log(2000, restart=np.isin(np.arange(2000), [0, 800, 1999]))
    found = vqf.estimate(made, CONFIG)
    observing.assert_sound(found)
    for part in (slice(0, 800), slice(800, 1999)):
        expected = package.VQF(H).updateBatch(
            *(np.ascontiguousarray(y[part]) for y in measured(made))
        )
        assert apart(found.q[part], expected["quat9D"]) < 1e-9


def test_two_samples_are_a_run():
    made, _ = log(2)
    observing.assert_sound(vqf.estimate(made, CONFIG))


def test_a_log_of_bursts_does_not_ask_for_samples_without_end(monkeypatch):
    monkeypatch.setattr(vqf, "LONGEST", 1000)
    made, _ = log(500)
    t = made.t.copy()
    t[300:] += 3_000_000_000_000
    found = vqf.estimate(replace(made, t=t), CONFIG)
    observing.assert_sound(found)
    assert len(found.q) == 500


def test_the_same_samples_give_the_same_bits():
    made, _ = log(500)
    assert vqf.estimate(made, CONFIG).q.tobytes() == vqf.estimate(made, CONFIG).q.tobytes()


def test_without_the_package_it_is_said_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "vqf", None)
    made, _ = log(10)
    with pytest.raises(ConfigError) as caught:
        vqf.estimate(made, CONFIG)
    assert str(caught.value) == (
        "vqf: the package 'vqf' is not installed. Install it: pip install 'attest[vqf]'."
    )


def test_without_an_accelerometer_it_is_refused():
    said = "vqf: needs the vector 'accel'. Choose another observer for this log."
    made, _ = log(10)
    for other in (replace(made, names=("star", "mag")), replace(made, length=None)):
        with pytest.raises(ConfigError) as caught:
            vqf.estimate(other, CONFIG)
        assert str(caught.value) == said


@pytest.mark.parametrize("key", ["tauAcc", "tauMag"])
def test_a_gain_out_of_range_is_refused(key):
    assert observing.refusal(vqf, key, 0.0) == (
        f"my.yaml: 'gains.{key}' is 0.0. It must be: greater than 0 [Laidig23, Table 2]."
    )


def test_the_defaults_are_the_packages():
    assert (CONFIG.gains.tauAcc, CONFIG.gains.tauMag) == (
        package.VQF(H).params["tauAcc"],
        package.VQF(H).params["tauMag"],
    )


def test_another_directions_vector_is_not_used():
    made, _ = log(300)
    star = np.broadcast_to([[0.0, 0.6, 0.8]], (300, 1, 3))
    more = replace(
        made,
        body=np.concatenate([star, made.body], axis=1),
        inertial=np.concatenate([star[:1], made.inertial], axis=1),
        valid=np.ones((300, 3), np.bool_),
        length=np.concatenate([np.ones((300, 1)), made.length], axis=1),
        names=("star", *made.names),
    )
    found = [vqf.estimate(each, CONFIG).q for each in (made, more)]
    assert apart(*found) < 1e-12


def test_its_configuration_has_no_weight_per_vector():
    with pytest.raises(ConfigError, match=r"unknown key 'weights\.w'"):
        config.validate(vqf.Config, {"observer": "vqf", "weights": {"w": {}}}, "my.yaml")
