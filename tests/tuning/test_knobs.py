"""What is tuned: which keys, how far, and that what comes out is a configuration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from attest import config, observers, pipeline
from attest.errors import ConfigError
from attest.tuning import knobs as module
from attest.tuning.knobs import configured, knobs, points_of, start_of, values_at

WITH_GAINS = [
    name for name in observers.NAMES if name not in {"triad", "wahba", "integration", "vqf"}
]
STARTS = {name: pipeline.configure(name) for name in WITH_GAINS}
FTS = knobs(STARTS["fts"], (), 30.0)
FIVE = {name: knobs(start, (), 5.0) for name, start in STARTS.items()}
points = st.lists(st.floats(0.0, 1.0), min_size=32, max_size=32).map(np.array)


@pytest.mark.parametrize("name", WITH_GAINS)
def test_start_is_the_configuration_itself(name):
    start = pipeline.configure(name)
    tuned = knobs(start, (), 30.0)
    assert all(knob.key.startswith("gains.") for knob in tuned)
    assert configured(start, tuned, values_at(tuned, start_of(tuned))) == start


@given(name=st.sampled_from(WITH_GAINS), u=points, factor=st.floats(1.001, 1e6))
def test_each_value_in_the_range_is_one_that_the_theory_allows(name, u, factor):
    start = STARTS[name]
    tuned = knobs(start, (), factor)
    for i, knob in enumerate(tuned):
        values = values_at(tuned, start_of(tuned))
        moved = (*values[:i], values_at((knob,), u[i : i + 1])[0], *values[i + 1 :])
        gains = dict(zip((knob.key for knob in tuned), moved, strict=True))
        if name == "eso" and gains["gains.gamma"][0] < 3.0 * gains["gains.alpha"][0] - 1.0:
            with pytest.raises(ConfigError, match="gamma - 3 alpha"):
                configured(start, tuned, moved)
        else:
            configured(start, tuned, moved)


@given(name=st.sampled_from(WITH_GAINS), u=points)
def test_a_key_goes_as_far_as_the_factor_and_no_further(name, u):
    tuned = FIVE[name]
    for knob, values in zip(tuned, values_at(tuned, u[: len(tuned)]), strict=True):
        for x, begin in zip(values, knob.start, strict=True):
            assert 0.199 * begin <= x <= 5.01 * begin


@given(u=points)
def test_values_are_where_their_point_is(u):
    u = u[: len(FTS)]
    back = points_of(FTS, values_at(FTS, u))
    np.testing.assert_allclose(back, u, atol=2e-3)


def test_vectors_are_scaled_as_one_and_what_is_no_gain_stays():
    tuned = knobs(pipeline.configure("vae", ["gains.D=[10, 20, 40]"]), (), 30.0)
    assert [knob.key for knob in tuned] == ["gains.m", "gains.D", "gains.P"]
    D = values_at(tuned, np.array([0.5, 0.6, 0.5]))[1]
    assert D[1] / D[0] == pytest.approx(2.0, rel=1e-3)
    assert D[2] / D[0] == pytest.approx(4.0, rel=1e-3)


def test_zero_and_null_stay():
    frozen = knobs(pipeline.configure("cgo", ["gains.k_i=0"]), (), 30.0)
    assert [knob.key for knob in frozen] == ["gains.k_p"]
    unset = knobs(pipeline.configure("fts", ["gains.k_b=null"]), (), 30.0)
    assert "gains.k_b" not in [knob.key for knob in unset]


def test_start_at_a_border_goes_the_other_way():
    tuned = knobs(pipeline.configure("fts", ["gains.p=1"]), (), 30.0)
    p = next(knob for knob in tuned if knob.key == "gains.p")
    assert (p.low, p.high) == (1.0, pytest.approx(1.99))
    assert values_at((p,), np.array([0.0])) == ((1.0,),)


def test_more_keys_and_their_entries():
    start = pipeline.configure("mekf", ["weights.w={accel: 1.0, mag: 2.0}"])
    keys = ("conditioning.smoothing.accel_s", "weights.k.2", "weights.w.mag", "gains.gyro_noise")
    tuned = knobs(start, keys, 2.0)
    assert [knob.key for knob in tuned[5:]] == list(keys[:3])
    far = configured(start, tuned, values_at(tuned, np.ones(len(tuned))))
    assert far.weights.k == (1.2, 1.0, 60.0)
    assert far.weights.w == {"accel": 1.0, "mag": 4.0}
    assert far.conditioning.smoothing.accel_s == 6.0
    assert config.effective(start)["weights"]["k"] == [1.2, 1.0, 30.0]


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (
            "gains.kp",
            "--key gains.kp: unknown key 'gains.kp'. Did you mean 'k_p'? Known: k_p, k_i.",
        ),
        (
            "gains.k_p=2",
            "--key gains.k_p=2: unknown key 'gains.k_p=2'. Did you mean 'k_p'? Known: k_p, k_i.",
        ),
        ("weights.k.7", "--key weights.k.7: no such key. See `attest config show`."),
        ("weights.w.mag", "--key weights.w.mag: no such key. See `attest config show`."),
        ("gains.k_p.x", "--key gains.k_p.x: no such key. See `attest config show`."),
        ("gains", "--key gains: no positive number. Give it one with --set, or leave it."),
        (
            "conditioning.gyroscope.correct",
            "--key conditioning.gyroscope.correct: no positive number. Give it one with --set, or "
            "leave it.",
        ),
        (
            "input.start_s",
            "--key input.start_s: only keys of gains, weights, conditioning, plant can be tuned.",
        ),
    ],
)
def test_a_key_that_cannot_be_tuned_is_refused(key, message):
    with pytest.raises(ConfigError) as caught:
        knobs(pipeline.configure("cgo"), (key,), 30.0)
    assert str(caught.value) == message


def test_unknown_entry_of_free_names_is_refused():
    start = pipeline.configure("cgo", ["weights.w={accel: 1.0}"])
    with pytest.raises(ConfigError, match="no such key"):
        knobs(start, ("weights.w.mag",), 30.0)


@pytest.mark.parametrize("name", ["triad", "wahba", "integration"])
def test_observer_without_gains_is_refused_unless_keys_are_named(name):
    with pytest.raises(ConfigError) as caught:
        knobs(pipeline.configure(name), (), 30.0)
    assert str(caught.value) == (
        f"observer {name!r} has no gains to tune. Choose another, or name keys with --key."
    )
    assert len(knobs(pipeline.configure(name), ("conditioning.smoothing.mag_s",), 30.0)) == 1


def test_every_section_that_may_be_tuned_is_one_of_some_observer():
    held = {key for name in WITH_GAINS for key in observers.get(name).config.model_fields}
    assert set(module.TUNABLE) <= held
