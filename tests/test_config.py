import time

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from attest import config, pipeline
from attest.errors import AttestError, ConfigError
from attest.observers import fts


def validate(document):
    return config.validate(fts.Config, {"observer": "fts", **document}, "my.yaml")


def load(text):
    """Read and check a document as `pipeline.configure` does, without a file."""
    return validate(yaml.safe_load(text))


def refusal(document):
    with pytest.raises(ConfigError) as caught:
        validate(document)
    return one_line(caught)


def one_line(caught):
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 1000
    assert caught.value.exit_code == 2
    return text


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "my.yaml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


def file_refusal(path, *assignments):
    with pytest.raises(ConfigError) as caught:
        pipeline.configure(path, assignments)
    text = one_line(caught)
    assert text.startswith((path, "--set"))
    return text


def test_defaults_come_before_the_file_and_the_file_before_set(write):
    path = write("observer: fts\ngains: {k_p: 0.7, k_v: 2.0}\n")
    gains = pipeline.configure(path, ["gains.k_v=5", "conditioning.max_age_s=2"]).gains
    assert (gains.k_p, gains.k_v, gains.kappa) == (0.7, 5.0, fts.Gains().kappa)
    assert pipeline.configure("fts") == fts.Config()
    assert pipeline.configure("fts", ["gains.k_v=4", "gains.k_v=5"]).gains.k_v == 5.0


def test_set_takes_any_yaml_value_at_any_depth():
    made = pipeline.configure(
        "fts",
        [
            "weights.k=[4, 3, 2]",
            "conditioning.specific_force.lag_s=null",
            "vectors=[{signal: accel, reference: gravity}]",
            "evaluation.apply_heading_offset=true",
            " input.imu = SCALED_IMU2",
        ],
    )
    assert made.weights.k == (4.0, 3.0, 2.0)
    assert made.conditioning.specific_force.lag_s is None
    assert made.vectors == (config.Vector(signal="accel", reference="gravity"),)
    assert made.evaluation.apply_heading_offset
    assert made.input.imu == "SCALED_IMU2"


def test_set_changes_no_document_that_was_given():
    document = {"observer": "fts", "gains": {"k_p": 1.0}}
    config.override(document, ["gains.k_p=2", "weights.k=[3,2,1]"])
    assert document == {"observer": "fts", "gains": {"k_p": 1.0}}


@pytest.mark.parametrize(
    ("assignment", "told"),
    [
        ("gains.k_p", "write it as key=value"),
        ("=3", "write it as key=value"),
        ("gains.k_p=[", "not YAML"),
        ("gains.k_p=2020-99-99", "not YAML"),
        ("gains.k_p=!!bool maybe", "not YAML"),
        ("gains.k_p=!!python/object/apply:os.getcwd []", "not YAML"),
        ("gains.k_p.deep=3", "'k_p' is a value"),
        ("gains..k_p=1", "unknown key"),
        ("gains.kp=1", "'k_p'"),
        ("gain.k_p=1", "'gains'"),
        ("gains.k_p=2020-01-01", "fts"),
    ],
)
def test_a_wrong_set_is_one_line(assignment, told):
    with pytest.raises(ConfigError, match=r"fts|--set") as caught:
        pipeline.configure("fts", ["gains.k_p=1.0", assignment])
    assert told in one_line(caught)


@pytest.mark.parametrize(
    ("document", "key", "near"),
    [
        ({"gain": {}}, "gain", "gains"),
        ({"gains": {"kp": 1.0}}, "gains.kp", "k_p"),
        ({"gains": {"kapa": 1.0}}, "gains.kapa", "kappa"),
        ({"gains": {"k-p": 1.0}}, "gains.k-p", "k_p"),
        ({"conditioning": {"max_steps": 1.0}}, "conditioning.max_steps", "max_step_s"),
        (
            {"conditioning": {"specific_force": {"lags": 1.0}}},
            "conditioning.specific_force.lags",
            "lag_s",
        ),
        ({"vectors": [{"signal": "mag", "refrence": "north"}]}, "vectors.0.refrence", "reference"),
        ({"vectors": [{"signl": "mag"}]}, "vectors.0.signl", "signal"),
    ],
)
def test_an_unknown_key_is_told_with_the_nearest_and_all_that_are_known(document, key, near):
    text = refusal(document)
    assert text.startswith(f"my.yaml: unknown key {key!r}. Did you mean {near!r}?")
    assert "Known: " in text


@pytest.mark.parametrize(
    "key", [1, None, "", "float", "str", "tuple", "x y", "a.b", "é", 1.5, True]
)
@pytest.mark.parametrize("inside", [False, True])
def test_no_strange_key_breaks_the_message(key, inside):
    text = refusal({"gains": {key: 1}} if inside else {key: 1})
    assert "unknown key" in text
    assert "Known: " in text
    assert ("k_p" in text.split("Known: ")[1]) == inside


OUT_OF_RANGE = [
    ("gains.k_p", 0, "greater than 0"),
    ("gains.k_v", -1, "greater than 0"),
    ("gains.kappa", 0, "greater than 0"),
    ("gains.mu", 1, "less than 1"),
    ("gains.mu", 0, "greater than 0"),
    ("gains.p", 0.99, "greater than or equal to 1"),
    ("gains.p", 2, "less than 2"),
    ("gains.k_b", 0, "greater than 0"),
    ("weights.k", [3, 3, 1], "three distinct values of at least 1"),
    ("weights.k", [3, 2, 0.5], "three distinct values of at least 1"),
    ("initial.attitude", [0, 0, 0, 0], "length zero is no attitude"),
    ("conditioning.max_step_s", 0, "greater than 0"),
    ("conditioning.max_step_s", 11, "less than or equal to 10"),
    ("conditioning.max_age_s", -0.1, "greater than or equal to 0"),
    ("conditioning.restart_gap_s", 0, "greater than 0"),
    ("conditioning.specific_force.smoothing_s", 0, "greater than 0"),
    ("conditioning.specific_force.lag_s", 6, "less than or equal to 5"),
    ("conditioning.magnetometer.latency_s", -1, "greater than or equal to 0"),
    ("input.start_s", -1, "greater than or equal to 0"),
    ("input.end_s", 0, "greater than 0"),
    ("evaluation.settling_bound_deg", 0, "greater than 0"),
    ("evaluation.settling_bound_deg", 181, "less than or equal to 180"),
    ("evaluation.longest_gap_s", 0, "greater than 0"),
]


def nested(dotted, value):
    for key in reversed(dotted.split(".")):
        value = {key: value}
    return value


@pytest.mark.parametrize(("key", "value", "allowed"), OUT_OF_RANGE)
def test_a_value_out_of_range_is_told_with_its_key_and_what_is_allowed(key, value, allowed):
    text = refusal(nested(key, value))
    assert text.startswith(f"my.yaml: {key!r} is {str(value)[:5]}")
    assert allowed in text


@pytest.mark.parametrize(("key", "value"), [("gains.p", 1), ("gains.mu", 0.999), ("gains.p", 1.99)])
def test_the_ends_of_a_range_are_as_the_theory_has_them(key, value):
    validate(nested(key, value))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("gains.k_p", "much"),
        ("gains.k_p", "2.0"),
        ("gains.k_p", None),
        ("gains.k_p", True),
        ("gains.k_p", [1.0]),
        ("gains", 3),
        ("gains", None),
        ("weights.k", [3, 2]),
        ("weights.k", [3, 2, 1, 0]),
        ("weights.k", {"x": 1}),
        ("initial.attitude", "upright"),
        ("initial.attitude", [1, 0, 0]),
        ("initial.bias", 0),
        ("evaluation.apply_time_offset", "yes"),
        ("evaluation.apply_time_offset", 1),
        ("input.world", "nwu"),
        ("input.imu", 3),
        ("vectors", "accel"),
        ("vectors", [["accel"]]),
        ("vectors", [{"reference": "gravity"}]),
        ("vectors", [{"signal": "accel", "reference": "up"}]),
        ("vectors", [{"signal": "sun", "reference": [0, 0, 0]}]),
        ("vectors", [{"signal": "sun", "reference": [1, 0]}]),
        ("vectors", [{"signal": "mag"}, {"signal": "mag"}]),
    ],
)
def test_a_value_of_the_wrong_kind_is_told_by_its_key(key, value):
    text = refusal(nested(key, value))
    assert text.startswith(f"my.yaml: '{key.split('.')[0]}")
    reasons = ("It must be: ", "is missing. Add it.", "has no direction.", "is named twice.")
    assert any(reason in text for reason in reasons)


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf", "1e400", "1" + "0" * 400])
@pytest.mark.parametrize("key", ["gains.k_p", "gains.k_b", "conditioning.restart_gap_s"])
def test_no_gain_is_infinite_or_not_a_number(key, value):
    text = refusal(nested(key, yaml.safe_load(value)))
    assert text.startswith(f"my.yaml: {key!r}")


@pytest.mark.parametrize("value", ["[.nan, 2, 1]", "[.inf, 2, 1]"])
def test_no_vector_is_infinite_or_not_a_number(value):
    assert refusal({"weights": {"k": yaml.safe_load(value)}})
    assert refusal({"initial": {"bias": yaml.safe_load(value)}})
    assert refusal({"initial": {"attitude": [*yaml.safe_load(value), 0]}})
    assert refusal({"vectors": [{"signal": "sun", "reference": yaml.safe_load(value)}]})


@pytest.mark.parametrize(
    "text",
    [
        "observer: !!python/object/apply:os.system ['touch /tmp/attest-was-here']",
        "observer: fts\ngains: !!python/object/new:os.system ['true']",
        "observer: fts\ngains: {k_p: !!python/name:os.system }",
        "observer: fts\ngains: {k_p: !unknown 3}",
        "observer: [",
        "observer: fts\n\tgains: 3",
        "observer: fts\ngains: {k_p: !!bool maybe}",
        'observer: fts\ngains: {k_p: !!int ""}',
        "observer: fts\ngains: {k_p: !!int 0x}",
        "observer: fts\ngains: {k_p: !!timestamp soon}",
        "observer: fts\ngains: {k_p: 2020-99-99}",
        "observer: fts\n? [a, {b: c}]\n: 3",
        "observer: fts\ngains: *nowhere",
        "observer: fts\n---\nobserver: fts",
        b"\xff\xfe\x00\x01",
        b"observer: fts\x00",
        "[" * 100_000,
        "{a: " * 2000,
        "observer: fts\ngains: " + "[" * 2000 + "]" * 2000,
    ],
)
def test_what_is_no_plain_yaml_is_refused_in_one_line(write, text):
    assert "not YAML" in file_refusal(write(text))


@pytest.mark.parametrize(
    "text",
    [
        "observer: fts\ngains: {k_p: 2020-01-01}",
        "observer: fts\ngains: {k_p: !!binary aGVsbG8=}",
        "observer: fts\ngains: !!set {k_p, k_v}",
        "observer: fts\ngains: !!omap [{k_p: 1}]",
    ],
)
def test_yaml_that_is_no_plain_number_text_or_list_is_refused_in_one_line(write, text):
    assert file_refusal(write(text))


@pytest.mark.parametrize("text", ["", "# nothing\n", "3", "- observer\n- fts", "just text", "null"])
def test_a_document_that_is_no_mapping_is_refused(write, text):
    assert "a mapping is needed" in file_refusal(write(text))


@pytest.mark.parametrize("text", ["gains: {k_p: 1.0}", "observer: null", "observer: [fts]", "{}"])
def test_a_document_without_an_observer_is_refused(write, text):
    assert "no 'observer'. Add a line such as 'observer: fts'" in file_refusal(write(text))


def test_an_observer_that_there_is_not_is_refused(write):
    with pytest.raises(ConfigError, match=r"unknown observer 'ftz'.*fts"):
        pipeline.configure(write("observer: ftz"))


def bomb(levels):
    """Return a few lines that stand for ten to the power of that many values."""
    ten = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, levels)]
    last = f"gains: *a{levels - 1}"
    return "\n".join(["observer: fts", "a0: &a0 [x, x, x, x, x, x, x, x, x, x]", *ten, last])


def test_a_yaml_bomb_is_refused_at_once(write):
    began = time.perf_counter()
    assert file_refusal(write(bomb(12)))
    assert time.perf_counter() - began < 2.0


def test_a_value_that_holds_itself_is_refused(write):
    assert file_refusal(write("observer: fts\ngains: &g {k_p: *g}"))
    with pytest.raises(ConfigError, match=r"--set gains"):
        pipeline.configure("fts", ["gains=&g {k_p: *g}"])


def test_a_file_of_two_mebibytes_is_no_configuration(write):
    path = write("observer: fts\n" + "# padding\n" * 210_000)
    assert "over 1 MiB" in file_refusal(path)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file"):
        pipeline.configure(str(tmp_path / "none.yaml"))
    folder = tmp_path / "folder.yaml"
    folder.mkdir()
    with pytest.raises(ConfigError, match=r"folder\.yaml: no such file"):
        pipeline.configure(str(folder))


def test_a_byte_order_mark_and_windows_line_ends_are_nothing_special(write):
    assert (
        pipeline.configure(write("\ufeffobserver: fts\r\ngains: {k_p: 0.7}\r\n")).gains.k_p == 0.7
    )


def test_a_name_that_is_nearly_right_gets_a_hint():
    with pytest.raises(ConfigError, match=r"unknown observer 'fst'\. Did you mean 'fts'\?"):
        pipeline.configure("fst")
    with pytest.raises(ConfigError, match=r"unknown observer 'zzz'\. Choose one of: .*fts"):
        pipeline.configure("zzz")


def test_shipped_configurations_go_by_name():
    assert {"fts", "paper/fts"} <= set(config.shipped())
    assert config.find("paper/fts") == config.folder() / "paper" / "fts.yaml"


def test_whole_numbers_are_numbers():
    assert validate({"gains": {"k_p": 2}}).gains.k_p == 2.0


configurations = st.builds(
    fts.Config,
    gains=st.builds(
        fts.Gains,
        k_p=st.floats(1e-6, 1e6),
        kappa=st.floats(1e-6, 1e6),
        p=st.floats(1.0, 2.0, exclude_max=True),
        k_b=st.none() | st.floats(1e-3, 1e6),
    ),
    initial=st.builds(
        config.Initial,
        attitude=st.sampled_from(["triad", "identity"])
        | st.tuples(st.floats(0.1, 1.0), *[st.floats(-1.0, 1.0)] * 3),
        bias=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    ),
    vectors=st.none()
    | st.just(())
    | st.just((config.Vector(signal="accel"), config.Vector(signal="v", reference=(0.1, 0, 1e-9)))),
    input=st.builds(config.Input, vehicle=st.none() | st.text(max_size=9), imu=st.just("null")),
)


@given(made=configurations)
def test_the_effective_configuration_as_yaml_is_the_configuration(made):
    again = load(config.dump(made))
    assert again == made
    assert config.effective(again) == config.effective(made)


def test_the_effective_configuration_holds_every_default():
    whole = config.effective(fts.Config())
    assert set(whole) == set(fts.Config.model_fields)
    assert set(whole["conditioning"]) == set(config.Conditioning.model_fields)
    assert whole["conditioning"]["max_step_s"] == 0.025


def test_a_configuration_cannot_be_changed_by_accident():
    with pytest.raises(ValueError, match="frozen"):
        fts.Config().gains.k_p = 3.0


def test_every_key_says_what_it_is():
    sections = [
        config.Weights,
        config.Initial,
        config.Vector,
        config.SpecificForce,
        config.Magnetometer,
        config.Input,
        config.Evaluation,
        fts.Gains,
    ]
    silent = [
        f"{section.__name__}.{name}"
        for section in sections
        for name, field in section.model_fields.items()
        if not field.description and name != "signal"
    ]
    assert silent == []


words = st.text(max_size=5)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=8,
)
known = st.sampled_from([*fts.Config.model_fields, *fts.Gains.model_fields, "signal", "reference"])
documents = st.dictionaries(
    known | words, plain | st.dictionaries(known, plain, max_size=2), max_size=3
)


def told_of(document):
    """Return what the check says about a document; nothing where it is right."""
    try:
        config.validate(fts.Config, document, "my.yaml")
    except AttestError as error:
        return str(error)
    return ""


@settings(max_examples=200)
@given(documents)
def test_no_document_breaks_the_check(document):
    text = told_of(document)
    assert text.startswith("my.yaml: ") or text == ""
    assert "\n" not in text


@settings(max_examples=200)
@given(st.text(max_size=40) | st.text(st.sampled_from("{}[]&*!:,-?|>'\"% \nab1.<~"), max_size=40))
def test_no_text_breaks_the_reading(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "drawn.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    with pytest.raises(ConfigError):
        config.read(path)


def test_a_number_without_a_point_is_a_number(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("observer: fts\ngains: {k_p: 1e-3, kappa: 2E1}\n")
    document = config.override(config.read(path), ["gains.mu=5e-1"])
    gains = config.validate(fts.Config, document, "my.yaml").gains
    assert (gains.k_p, gains.kappa, gains.mu) == (1e-3, 20.0, 0.5)


def test_a_key_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("observer: fts\ngains: {k_p: 1.0}\ngains: {k_p: 2.0}\n")
    with pytest.raises(ConfigError, match="'gains' stands twice"):
        config.read(path)
