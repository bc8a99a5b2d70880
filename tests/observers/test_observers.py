from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from flights import samples
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from strategies import rotations

from attest import config, observers
from attest.config import Configuration, Initial
from attest.errors import ConfigError
from attest.geometry import quaternion
from attest.observers import observer
from attest.samples import segments

SECOND = 1_000_000_000
FOLDER = Path(observers.__file__).parent
SHARED = {"__init__", "observer"}
"""Modules that are no observer."""


def test_every_module_that_has_an_observer_is_registered_and_the_other_way_round():
    modules = {path.stem for path in FOLDER.glob("*.py")} - SHARED
    having = {name for name in modules if "\nOBSERVER = " in (FOLDER / f"{name}.py").read_text()}
    assert having == set(observers.NAMES)


@pytest.mark.parametrize("name", observers.NAMES)
def test_every_observer_has_its_name_in_all_places(name):
    found = observers.get(name)
    assert found.config().observer == name
    assert name in config.shipped()
    assert (Path(__file__).parent / f"test_{name}.py").is_file()
    assert found.title
    assert found.paper


@pytest.mark.parametrize("name", observers.NAMES)
def test_defaults_in_the_code_are_those_that_are_shipped(name):
    model = observers.get(name).config
    document = config.read(config.find(name))
    assert config.validate(model, document, name) == model()
    # and the file spells its gains out, so that it can be copied and changed
    assert document["gains"] == config.effective(model())["gains"]


@pytest.mark.parametrize("name", config.shipped())
def test_every_shipped_configuration_loads(name):
    document = config.read(config.find(name))
    loaded = config.validate(observers.get(document["observer"]).config, document, name)
    assert isinstance(loaded, Configuration)


@pytest.mark.parametrize("name", observers.NAMES)
def test_every_gain_says_what_it_is(name):
    gains = observers.get(name).config.model_fields["gains"].annotation
    assert all(field.description for field in gains.model_fields.values())


@pytest.mark.parametrize("name", observers.NAMES)
def test_every_observer_gives_the_diagnostics_that_all_have(name):
    t = np.arange(50) * 10_000_000
    body = np.broadcast_to(np.eye(3), (50, 3, 3)).copy()
    found = observers.get(name)
    named = {"names": ("mag", "v", "accel"), "length": np.ones((50, 3))}
    given = samples(t, np.zeros((50, 3)), body, [np.eye(3)], **named)
    estimates = found.estimate(given, found.config())
    shapes = {field.name: np.shape(getattr(estimates, field.name)) for field in fields(estimates)}
    assert shapes["q"] == (50, 4)
    assert shapes["angular_velocity"] == (50, 3)
    assert estimates.gyro_bias is None or shapes["gyro_bias"] == (50, 3)
    assert shapes["s_norm"] == shapes["cost"] == (50,)
    assert shapes["updated"] == (50, 3)
    assert (estimates.observer, estimates.t.tolist()) == (name, t.tolist())
    assert all(len(state) == 50 for state in estimates.states.values())


def test_an_unknown_observer_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"unknown observer 'ftz'.*fts"):
        observers.get("ftz")


def made(n=6, restart=(), inertial=None, valid=None):
    t = np.array([0, 10, 20, 50, 60, 61])[:n] * SECOND // 1000
    body = np.broadcast_to(np.eye(3), (n, 3, 3)).copy()
    known = np.eye(3)[np.newaxis] if inertial is None else inertial
    marked = np.isin(np.arange(n), [0, *restart])
    other = {} if valid is None else {"valid": valid}
    return samples(t, np.zeros((n, 3)), body, known, restart=marked, **other)


def test_segments_are_the_stretches_between_restarts():
    assert list(segments(made())) == [slice(0, 6)]
    assert list(segments(made(restart=[2, 5]))) == [slice(0, 2), slice(2, 5), slice(5, 6)]


def test_steps_are_seconds_of_a_sub_step_and_the_last_of_a_stretch_is_none():
    assert_allclose(observer.steps(made(), slice(0, 6)), [0.01, 0.01, 0.03, 0.01, 0.001, 0.0])
    assert_allclose(observer.steps(made(), slice(1, 3)), [0.01, 0.0])
    divided = replace(made(), substeps=np.full(6, 2))
    assert_allclose(observer.steps(divided, slice(1, 3)), [0.005, 0.0])


@given(rotations)
def test_initial_attitude_is_what_the_first_vectors_say(q):
    R = quaternion.to_matrix(q)
    body = np.broadcast_to(R, (6, 3, 3))  # row i is R^T e_i
    given_samples = samples(made().t, np.zeros((6, 3)), body, [np.eye(3)])
    found = observer.initial_attitude(given_samples, slice(0, 6), Initial())
    assert_allclose(quaternion.to_matrix(found), R, atol=1e-7)


def test_a_given_attitude_holds_for_the_first_stretch_only():
    half = np.array([0.0, 2.0, 0.0, 0.0])
    start = Initial(attitude=tuple(half))
    first = observer.initial_attitude(made(restart=[3]), slice(0, 3), start)
    later = observer.initial_attitude(made(restart=[3]), slice(3, 6), start)
    assert_allclose(first, [0.0, 1.0, 0.0, 0.0])
    assert_allclose(np.abs(later), [1.0, 0.0, 0.0, 0.0], atol=1e-12)
    identity = observer.initial_attitude(made(), slice(0, 6), Initial(attitude="identity"))
    assert_allclose(identity, [1.0, 0.0, 0.0, 0.0])


def test_initial_attitude_uses_the_vectors_that_are_valid_there_and_then():
    turned = np.broadcast_to(np.eye(3), (6, 3, 3)).copy()
    turned[3:] = np.eye(3)[[1, 2, 0]]  # the known vectors move
    valid = np.ones((6, 3), np.bool_)
    valid[3:, 2] = False
    start = observer.initial_attitude(
        made(restart=[3], inertial=turned, valid=valid), slice(3, 6), Initial()
    )
    assert_allclose(quaternion.rotate(start, np.eye(3)), np.eye(3)[[1, 2, 0]], atol=1e-7)


@given(st.integers(1, 20), st.data())
def test_sub_steps_are_linear_between_two_steps(parts, data):
    j = data.draw(st.integers(0, parts - 1))
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    gyro, L = rng.normal(size=(3, 3)), rng.normal(size=(3, 10))
    rate, matrix = observer.mean_rate(gyro, 1, j, parts), observer.between(L, 1, j, parts)
    if parts == 1:
        expected = gyro[1], L[1]
    else:
        middle, begin = (j + 0.5) / parts, j / parts
        expected = gyro[1] + middle * (gyro[2] - gyro[1]), L[1] + begin * (L[2] - L[1])
    assert_allclose(rate, expected[0], atol=1e-14)
    assert_allclose(matrix, expected[1][:9], atol=1e-14)


def test_the_last_step_has_nothing_to_go_to_and_holds():
    gyro, L = np.ones((2, 3)), np.ones((2, 10))
    assert observer.mean_rate(gyro, 1, 3, 5) == (1.0, 1.0, 1.0)
    assert_allclose(observer.between(L, 1, 3, 5), np.ones(9), atol=1e-15)
