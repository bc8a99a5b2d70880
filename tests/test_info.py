"""What `attest info` tells of a log: figures, place, motion, the command; as text, JSON, PNG."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ros_logs
from click.testing import CliRunner
from flights import FIELD, at, flight, gyro, recording, resting, stamps, tumbling

from attest import inspection, pipeline, preview, readers, report, simulation
from attest.cli import cli
from attest.errors import ConfigError, ReadError
from attest.recording import Reference, Signal
from attest.report.info import rhythm
from attest.report.plot import _moved, _thinned
from attest.simulation.degrade import Degradation, degrade


def figures(y, rate=100.0):
    """Return the figures of a gyroscope with these values about x."""
    t = stamps(rate, len(y) / rate)
    signal = Signal(t, np.stack([y, np.zeros_like(y), np.zeros_like(y)], axis=1), "GYRO")
    return inspection.inspect(recording({"gyro": signal}))["signals"]["gyro"]


def info(*arguments):
    return CliRunner().invoke(cli, ["info", *map(str, arguments)], catch_exceptions=False)


def test_names_in_a_log_command_no_terminal(sample_logs):
    log = sample_logs / "quadcopter.csv"
    configuration = pipeline.configure("cgo")
    _, described = preview.describe(log, configuration)
    opened = pipeline.opened(log, configuration)
    result = pipeline.observe(opened, configuration)
    for document in (described, result.summary["log"]):
        document["signals"]["gyro"]["source"] = "\x1b[2J\rgyro"
    for text in (report.text_of_info(described), report.text_of_run(result.summary, ())):
        assert "\\x1b[2J\\rgyro" in text
        assert all(line.isprintable() for line in text.splitlines())


@pytest.fixture(scope="module")
def wave():
    return np.sin(np.linspace(0.0, 60.0, 3000))


def test_range_and_median_are_those_of_the_values(wave):
    told = figures(wave)
    assert (told["min"][0], told["max"][0]) == (wave.min(), wave.max())
    assert told["median"] == [np.median(wave), 0.0, 0.0]


def test_a_limit_of_the_sensor_is_counted_on_both_sides(wave):
    assert figures(wave)["saturated"] == 0
    clipped = np.clip(wave, -0.9, 0.8)
    assert figures(clipped)["saturated"] == np.sum((wave < -0.9) | (wave > 0.8))
    # few steps at rest are no limit: each is met about as often as the next
    assert figures(np.round(0.01 * wave, 2))["saturated"] == 0


def test_a_value_that_does_not_change_is_stuck(wave):
    assert figures(wave)["stuck_s"] == 0.0
    frozen = wave.copy()
    frozen[1000:1501] = frozen[1000]
    told = figures(frozen)
    assert told["stuck_s"] == pytest.approx(5.0)
    assert told["repeated"] == pytest.approx(500 / 2999, abs=1e-4)


@pytest.mark.parametrize("step", [0.001, 0.0125])
def test_quanta_are_found(wave, step):
    assert figures(np.round(wave / step) * step)["step"] == pytest.approx(step, rel=0.01)
    assert figures(wave)["step"] is None


def test_jitter_is_that_of_the_stamps():
    rng = np.random.default_rng(1)
    t = stamps(100.0, 30.0)
    late = rng.integers(-2_000_000, 2_000_000, len(t))
    y = np.zeros((len(t), 3))
    told = inspection.inspect(recording({"gyro": Signal(t + late, y)}))["signals"]["gyro"]
    assert 2.0 < told["jitter_ms"] < 4.0
    assert figures(np.zeros(3000))["jitter_ms"] == 0.0


def test_a_gyroscope_is_fast_enough_or_not(tmp_path):
    def motion(rate):
        return inspection.inspect(recording({"gyro": gyro(tumbling, stamps(rate, 60.0))}))["motion"]

    assert motion(100.0)["fast_enough"]
    assert not motion(5.0)["fast_enough"]
    assert motion(5.0)["large_steps"] > 0.5
    assert motion(5.0)["rate_hz"] == 5.0
    fast, slow = (recording({"gyro": gyro(resting, stamps(rate, 60.0))}) for rate in (50.0, 2.0))
    assert inspection.inspect(fast)["motion"]["fast_enough"]
    # what is faster than half the rate may be there, and is not seen
    assert inspection.inspect(slow)["motion"]["fast_enough"] is None
    assert not any("too slow for the motion" in note.text for note in inspection.doubts(slow))
    rows = "".join(f"{0.5 * i},0.001,0,0.00{i % 7}\n" for i in range(60))
    (tmp_path / "slow.csv").write_text(f"time_s,gyro_x,gyro_y,gyro_z\n{rows}")
    text = info(tmp_path / "slow.csv").stdout
    assert "  motion      at 2 Hz the gyroscope cannot see motion faster than 1 Hz: up to" in text


def test_a_rate_is_what_counting_tells():
    t = stamps(250.0, 20.0)
    thinned = t[(np.arange(len(t)) % 4 != 1) | (t > t[-1] - 10**9)]
    told = rhythm(thinned)
    assert told["rate_hz"] == pytest.approx(len(thinned) / 20.0, rel=0.01)
    # a gap is told as such, and nothing of the rate
    assert rhythm(t[(t < t[1000]) | (t > t[3000])])["rate_hz"] == 250.0


def test_motion_beyond_the_band_makes_it_too_slow():
    t = stamps(100.0, 60.0)
    hum = 0.5 * np.sin(2.0 * np.pi * 46.0 * at(t))
    told = inspection.inspect(recording({"gyro": Signal(t, np.stack([hum] * 3, axis=1))}))
    assert told["motion"]["edge_of_band"] > 0.9
    assert not told["motion"]["fast_enough"]


def test_a_gyroscope_that_is_too_slow_is_doubted_for_its_reason():
    def told(signal):
        return [note.text for note in inspection.doubts(recording({"gyro": signal}))]

    t = stamps(100.0, 60.0)
    hum = 0.5 * np.sin(2.0 * np.pi * 46.0 * at(t))
    slow = "the gyroscope is too slow for the motion in it: "
    (share,) = told(gyro(tumbling, stamps(5.0, 60.0)))
    assert share.startswith(slow)
    assert share.endswith("% of its steps turn over 0.1 rad")
    calm = gyro(tumbling, stamps(10.0, 60.0))
    assert told(Signal(calm.t, 0.3 * calm.y)) == [f"{slow}it turns, and is below 20 Hz"]
    assert told(Signal(t, np.stack([hum] * 3, axis=1))) == [
        f"{slow}100.0% of its power is at the band's edge"
    ]
    assert told(gyro(tumbling, t)) == []
    assert told(gyro(resting, stamps(5.0, 60.0))) == []


def test_run_doubts_a_gyroscope_that_is_too_slow(tmp_path):
    simulation.write(
        tmp_path / "slow.csv", degrade(simulation.simulate("handheld"), Degradation({"gyro": 4.0}))
    )
    arguments = ["run", tmp_path / "slow.csv", "-o", "integration", "--output", tmp_path, "--json"]
    done = CliRunner().invoke(cli, [*map(str, arguments)], catch_exceptions=False)
    texts = [warning["text"] for warning in json.loads(done.stdout)["warnings"]]
    assert any(text.startswith("the gyroscope is too slow for the motion") for text in texts)


def test_place_declination_and_dip_are_told_where_known():
    log = flight()
    assert "place" not in inspection.inspect(log)["earth"]
    position = Signal(stamps(1.0, 3.0), np.tile([47.4, 8.55, 500.0], (3, 1)))
    earth = inspection.inspect(replace(log, signals={**log.signals, "position": position}))["earth"]
    assert earth["place"] == [47.4, pytest.approx(8.55), 500.0]
    assert earth["year"] is None
    assert earth["declination_deg"] == pytest.approx(3.3, abs=0.5)
    assert earth["dip_deg"] == pytest.approx(63.5, abs=0.5)
    assert earth["gravity_ms2"] == pytest.approx(9.8067, abs=1e-3)
    assert earth["field_ut"] == pytest.approx(np.linalg.norm(FIELD) * 1e6, abs=0.1)


def test_the_gyroscope_of_some_messages_has_its_bias_taken_out():
    log = flight()
    for source, word in (("HIGHRES_IMU", "less the bias"), ("sensor_gyro[1]", "raw")):
        signal = replace(log.signals["gyro"], source=source)
        told = inspection.inspect(replace(log, signals={**log.signals, "gyro": signal}))
        assert word in told["gyro_correction"]
    assert inspection.inspect(log)["gyro_correction"] is None


def test_the_command_is_the_one_that_runs_it():
    log = flight()
    assert inspection.command(log, ["--world", "enu"]) == "attest run flight.csv --world enu"
    points = {f"point{i}": log.signals["accel"] for i in (1, 2, 3)}
    assert "relative_fts" in inspection.command(replace(log, signals=points))
    assert inspection.command(replace(log, signals={"mag": log.signals["mag"]})) is None


def test_json_is_the_description_with_the_figures(sample_logs):
    path = sample_logs / "quadcopter.tlog"
    told = json.loads(info(path, "--json").stdout)
    assert told["signals"]["gyro"]["step"] == 0.001
    assert told["signals"]["gyro"]["rate_hz"] == pytest.approx(50.0, abs=0.1)
    assert told["command"] == f"attest run {path}"
    assert told["motion"]["fast_enough"]
    assert told["turns_explained"]["mag"] > 0.9
    assert told["warnings"] == []


def test_text_fits_one_screen_and_tells_it_all(sample_logs):
    text = info(sample_logs / "quadcopter.tlog").stdout
    for piece in ("values", "gravity", "declination +3.6°", "fast enough", "to run", "(default)"):
        assert piece in text
    assert len(text.splitlines()) < 40


def test_options_choose_what_is_read_and_are_repeated_in_the_command(sample_logs):
    path = sample_logs / "quadcopter.tlog"
    told = json.loads(info(path, "--imu", "RAW_IMU", "--set", "input.vehicle='1'", "--json").stdout)
    assert told["command"].endswith(
        """--set 'input.imu="RAW_IMU"' --set 'input.vehicle='"'"'1'"'"''"""
    )


MAPPING = """observer: integration
input:
  world: ned
  csv: {time: {column: t, unit: ms}, gyro: {columns: [gx, gy, gz], unit: deg/s}}
"""


def mapped(folder):
    """Return a mapping, and a folder with two logs that it suits."""
    logs = folder / "logs"
    logs.mkdir()
    for name in ("a.csv", "b.csv"):
        rows = [f"{10 * i},0,{i % 7},90" for i in range(200)]
        (logs / name).write_text("\n".join(["t,gx,gy,gz", *rows]))
    yaml = folder / "mine.yaml"
    yaml.write_text(MAPPING)
    return yaml, logs


def test_a_csv_mapping_is_given_as_to_run(tmp_path):
    yaml, logs = mapped(tmp_path)
    told = json.loads(info(logs / "a.csv", "--observer", yaml, "--json").stdout)
    assert told["signals"]["gyro"]["max"][2] == pytest.approx(np.pi / 2)
    assert told["signals"]["gyro"]["rate_hz"] == 100.0
    assert told["command"] == f"attest run {logs / 'a.csv'} --observer {yaml}"
    in_radians = ("-o", yaml, "--set", "input.csv.gyro.unit=rad/s", "--json")
    told = json.loads(info(logs / "a.csv", *in_radians).stdout)
    assert told["signals"]["gyro"]["max"][2] == 90.0
    assert told["command"].endswith(f"--observer {yaml} --set input.csv.gyro.unit=rad/s")


def test_the_mapping_of_the_readme_works_as_it_stands(tmp_path):
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    (text,) = (part for part in readme.split("```yaml\n")[1:] if "  csv:" in part)
    yaml, log = tmp_path / "mine.yaml", tmp_path / "a.csv"
    yaml.write_text(text.partition("```")[0], encoding="utf-8")
    rows = [f"{10_000 * i},0,{i % 7},90,0,0,1,0.2,0,0.4,1,0,0,0" for i in range(200)]
    log.write_text("\n".join(["stamp,gx,gy,gz,ax,ay,az,mx,my,mz,qw,qx,qy,qz", *rows]))
    told = json.loads(info(log, "--observer", yaml, "--json").stdout)
    assert told["signals"].keys() == {"gyro", "accel", "mag"}
    assert told["signals"]["gyro"]["rate_hz"] == 100.0
    assert told["signals"]["accel"]["max"][2] == pytest.approx(9.80665)
    assert (told["world"], [*told["references"]]) == ("enu", ["ref"])
    assert told["default_reference"] == "ref"
    ran = ["run", log, "--observer", yaml, "--quiet", "--output", tmp_path]
    assert CliRunner().invoke(cli, [*map(str, ran)], catch_exceptions=False).exit_code == 0


@pytest.mark.parametrize("command", ["info", "run"])
def test_a_folder_of_mapped_csvs_is_found(tmp_path, command):
    yaml, logs = mapped(tmp_path)
    where = ["--output", tmp_path / "out"] if command == "run" else []
    arguments = [command, logs, "--observer", yaml, "--json", *where]
    done = CliRunner().invoke(cli, [*map(str, arguments)], catch_exceptions=False)
    assert len([json.loads(line) for line in done.stdout.splitlines()]) == 2


def test_a_folder_without_the_columns_that_are_told_is_one_line(tmp_path):
    yaml, logs = mapped(tmp_path)
    wrong = ["info", logs, "-o", yaml, "--set", "input.csv.time.column=T"]
    with pytest.raises(ReadError) as caught:
        cli.main([*map(str, wrong)], standalone_mode=False)
    assert str(caught.value) == (
        f"{logs}: no log, and no CSV with the columns of input.csv, in this folder. "
        "Name a log, or a folder with logs."
    )


def test_a_bad_log_among_others_is_a_line_and_the_rest_go_on(tmp_path, sample_logs):
    good, bad, none = sample_logs / "quadcopter.csv", tmp_path / "bad.log", tmp_path / "none"
    bad.write_bytes(b"nothing")
    runner = CliRunner()
    done = runner.invoke(cli, ["info", *map(str, (good, bad, none, good)), "--json"])
    assert [json.loads(line)["format"] for line in done.stdout.splitlines()] == ["csv", "csv"]
    assert done.stderr.splitlines() == [
        f"attest: {bad}: not a log that attest knows (ros, ulog, dataflash, tlog, sensor_logger, "
        "csv). Check that it is the file you meant.",
        f"attest: {none}: no such file. Check the path.",
    ]
    assert isinstance(done.exception, ReadError)
    assert str(done.exception) == "2 of 4 logs could not be used; see above."
    text = runner.invoke(cli, ["info", str(bad), str(good)])
    assert text.stdout.partition("  ")[0].endswith("sample_logs/quadcopter.csv")


def refused(*arguments):
    with pytest.raises(ConfigError) as caught:
        cli.main([*map(str, arguments)], standalone_mode=False)
    return str(caught.value)


def warnings(log, *settings):
    arguments = ["info", str(log), "--json", *(f"--set={setting}" for setting in settings)]
    done = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    return [warning["text"] for warning in json.loads(done.stdout)["warnings"]]


@pytest.mark.parametrize(
    ("name", "option", "value", "what"),
    [
        ("quadcopter.csv", "vehicle", "1", "csv has no choice of vehicle"),
        ("quadcopter.BIN", "vehicle", "1", "dataflash has no choice of vehicle"),
        ("quadcopter.ulg", "vehicle", "", "ulog has no choice of vehicle"),
        ("quadcopter.bag", "vehicle", "1", "ros has no choice of vehicle"),
        ("quadcopter.csv", "imu", "RAW_IMU", "csv has no choice of imu"),
        ("quadcopter.tlog", "world", "enu", "tlog is in ned"),
        ("quadcopter.ulg", "world", "enu", "ulog is in ned"),
    ],
)
def test_an_option_that_means_nothing_is_left_out_and_told(sample_logs, name, option, value, what):
    key = f"input.{option}"
    told = warnings(sample_logs / name, f"{key}={json.dumps(value)}")
    assert told[0] == f"--{option} ({key}) means nothing here, {what}: left out"


def test_topics_of_no_ros_log_are_left_out_and_told(sample_logs):
    told = warnings(sample_logs / "quadcopter.tlog", "input.topics.mag=/mag")
    assert told[0] == "input.topics means nothing here, tlog has no choice of topics: left out"


def test_options_of_the_log_are_none_of_its_references_file(sample_logs, tmp_path):
    log, other = sample_logs / "quadcopter.tlog", sample_logs / "quadcopter.ulg"
    arguments = ["run", log, "--vehicle", "1", "--reference", other, "--output", tmp_path, "-q"]
    assert CliRunner().invoke(cli, [*map(str, arguments)], catch_exceptions=False).exit_code == 0


def test_an_empty_name_of_a_reference_is_refused(sample_logs):
    assert refused("run", sample_logs / "quadcopter.csv", "--reference", "") == (
        "fts: 'evaluation.reference' is \"\": an empty name. "
        "Name a reference, a file, smoother or none."
    )


def test_plot_is_a_png_of_the_signals(sample_logs, tmp_path):
    picture = tmp_path / "signals.png"
    assert info(sample_logs / "quadcopter.tlog", "--plot", picture).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_long_signal_is_drawn_with_all_its_peaks(tmp_path):
    t = stamps(1000.0, 60.0)
    y = np.zeros((len(t), 3))
    y[31_234, 0] = 1.0
    at_, x = _thinned(at(t), y[:, 0])
    assert len(x) < 5_000
    assert x.max() == 1.0
    assert at_[np.argmax(x)] == pytest.approx(31.2, abs=0.1)
    report.plot(recording({"gyro$": Signal(t, y)}), tmp_path / "peak.png")


def test_a_position_is_drawn_in_metres_from_the_first():
    place = np.array([[47.0, 179.9999, 500.0], [47.0001, -179.9999, 510.0]])
    np.testing.assert_allclose(_moved(place), [[0, 0, 0], [11.12, 15.17, 10.0]], atol=0.01)


def test_a_field_of_almost_nothing_is_told_as_it_is(tmp_path):
    path = tmp_path / "flight.csv"
    made = simulation.simulate("handheld")
    weak = Signal(made.signals["mag"].t, made.signals["mag"].y * 1e-6)
    simulation.write(path, replace(made, signals={**made.signals, "mag": weak}))
    (line,) = (line for line in info(path).stdout.splitlines() if line.startswith("  field"))
    assert re.fullmatch(r"  field       \d\.\d+e-05 µT in the median, 22-67 on Earth", line)


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_a_field_without_strength_is_a_direction(tmp_path, scale):
    made = ros_logs.compass(
        ros_logs.flight(ros_logs.Log(), count=500),
        count=250,
        field=(0.6 * scale, 0.0, -0.8 * scale),
    )
    path = made.write(tmp_path)
    (line,) = (line for line in info(path).stdout.splitlines() if line.startswith("  field"))
    only = "  field       direction only"
    assert line == f"{only}: its strength is not the Earth's (22-67 µT on Earth)"
    assert json.loads(info(path, "--json").stdout)["earth"]["field_ut"] is None
    done = CliRunner().invoke(cli, ["run", str(path), "--output", str(tmp_path / "out")])
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("  field"))
    assert line.startswith(only)
    assert "µT" not in line.partition(";")[0]
    (summary,) = (tmp_path / "out").rglob("fts.json")
    assert json.loads(summary.read_text())["consistency"]["field_ut_median"] is None


def test_a_gap_is_not_drawn_across():
    t = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
    at_, x = _thinned(t, np.arange(5.0))
    assert np.isnan(x).tolist() == [False] * 3 + [True] + [False] * 2
    assert at_[np.isfinite(at_)].tolist() == t.tolist()
    t = stamps(1000.0, 60.0)
    t[20_000:] += 10 * 10**9
    _, x = _thinned(at(t), np.zeros(len(t)))
    (where,) = np.flatnonzero(np.isnan(x))
    assert where == pytest.approx(len(x) / 3, abs=3)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("a.txt", "the picture is a PNG. Give it a name that ends in .png."),
        ("a", "the picture is a PNG. Give it a name that ends in .png."),
        ("none/a.png", "no folder {folder}/none. Make it, or choose another."),
        ("there.png", "a folder. Name a file in it."),
    ],
)
def test_a_picture_that_cannot_be_is_one_line(tmp_path, sample_logs, name, what):
    (tmp_path / "there.png").mkdir()
    picture = tmp_path / name
    told = refused("info", sample_logs / "quadcopter.csv", "--plot", picture)
    assert told == f"--plot {picture}: {what.format(folder=tmp_path)}"
    assert [path.name for path in tmp_path.iterdir()] == ["there.png"]


@pytest.mark.parametrize("name", ["-x.csv", "a flight.csv", "it's.csv", '"q".csv', "$HOME;ls.csv"])
def test_the_command_is_one_that_a_shell_runs(tmp_path, monkeypatch, sample_logs, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes((sample_logs / "quadcopter.csv").read_bytes())
    told = json.loads(info("--json", "--", name).stdout)["command"]
    # as a shell splits it
    program, *words = shlex.split(told)
    assert program == "attest"
    ran = CliRunner().invoke(cli, [*words, "--quiet", "-o", "integration"], catch_exceptions=False)
    assert ran.exit_code == 0
    assert (tmp_path / "attest_out" / Path(name).stem).is_dir()


def test_turns_are_told_in_words(sample_logs):
    text = info(sample_logs / "quadcopter.tlog").stdout
    (line,) = (line for line in text.splitlines() if line.startswith("  turns"))
    assert re.fullmatch(
        r"  turns       as the gyroscope says: magnetometer \(9\d%\), reference \(100%\); "
        r"not as the gyroscope says: accelerometer \(\d%, usual at rest or when accelerating\)",
        line,
    )


def test_long_names_keep_the_columns():
    log = flight()
    gyro, source = log.signals["gyro"], "w_RS_S_x [rad s^-1], w_RS_S_y [rad s^-1], w_RS_S_z"
    signals = {"gyro": replace(gyro, source=source), "mag": log.signals["mag"], "s" * 50: gyro}
    described = report.describe(replace(log, signals=signals))
    lines = report.text_of_info(described).splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("  signal"))
    rows = lines[first : first + 4]
    assert {row.index("Hz") for row in rows[1:]} == {rows[0].index("rate") + 2}
    assert f" {source[:39]}… " in rows[1]
    assert rows[3].startswith(f"  {'s' * 39}… ")


def test_of_many_references_the_first_are_shown():
    log = flight()
    q = np.tile([1.0, 0, 0, 0], (3, 1))
    many = {f"/tf {i}": Reference(f"/tf {i}", "truth", stamps(1.0, 3.0), q) for i in range(50)}
    described = report.describe(replace(log, references=many))
    text = report.text_of_info(described)
    assert len(described["references"]) == 50
    assert "/tf 11 " in text
    assert "/tf 12 " not in text
    assert "\n  and 38 more, which --json has" in text


def test_doubts_are_shown_as_warnings(tmp_path):
    made = simulation.simulate("handheld")
    signals = {**made.signals, "mag": Signal(made.signals["mag"].t, made.signals["mag"].y * 1e3)}
    simulation.write(tmp_path / "flight.csv", replace(made, signals=signals))
    assert "! the magnetometer reads" in info(tmp_path / "flight.csv").stdout


@pytest.mark.parametrize(
    ("name", "factor"), [("gyro", 180.0 / np.pi), ("accel", 1.0 / 9.80665), ("mag", 1e-2)]
)
def test_the_option_of_a_doubt_mends_it_as_it_stands(tmp_path, name, factor):
    path = tmp_path / "flight.csv"
    made = simulation.simulate("handheld")
    signals = {**made.signals, name: Signal(made.signals[name].t, made.signals[name].y * factor)}
    simulation.write(path, replace(made, signals=signals))
    (warning,) = (line for line in info(path).stdout.splitlines() if "input.csv" in line)
    option = shlex.split(warning.rpartition(": ")[2])
    told = json.loads(info(path, *option, "--json").stdout)
    north = "magnetic reference: magnetic north"
    assert all(warning["text"].startswith(north) for warning in told["warnings"])
    ran = ["run", path, *option, "--quiet", "--output", tmp_path]
    assert CliRunner().invoke(cli, [*map(str, ran)], catch_exceptions=False).exit_code == 0


def test_what_a_run_doubts_without_its_observer_is_told_before(tmp_path):
    path = tmp_path / "flight.csv"
    made = simulation.simulate("quadcopter")
    mag = made.signals["mag"]
    # a magnet for a part of the flight, and no dip like the model's
    magnet = np.where((np.arange(len(mag.t)) > len(mag.t) // 2)[:, np.newaxis], 6e-5, 1e-5)
    signals = {**made.signals, "mag": Signal(mag.t, mag.y + magnet * np.array([1.0, -1.0, 0.3]))}
    simulation.write(path, replace(made, signals=signals))
    told = [warning["text"] for warning in json.loads(info(path, "--json").stdout)["warnings"]]
    ran = CliRunner().invoke(cli, ["run", str(path), "--json", "--output", str(tmp_path / "out")])
    assert [warning["text"] for warning in json.loads(ran.stdout)["warnings"]] == told
    assert any("the field turns against the gyroscope" in text for text in told)
    assert any("the field's dip in the log is" in text for text in told)
    for text in told:
        assert text in info(path).stdout


def test_a_log_that_a_run_would_refuse_is_told_why(tmp_path):
    path = tmp_path / "fast.csv"
    rows = "".join(f"{0.01 * i:.2f},5000,0,{i % 7}\n" for i in range(100))
    path.write_text(f"time_s,gyro_x,gyro_y,gyro_z\n{rows}")
    why = "the gyroscope reads over 1000 rad/s. Check its unit."
    assert f"! a run would refuse this log: {why}" in info(path).stdout


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "doubts"),
    [
        ("tlog/quadplane_sitl.tlog", 1),
        ("tlog/bluerov2.tlog", 1),
        ("dataflash/bluerov2.BIN", 1),
        ("dataflash/plane_truncated.BIN", 0),
        ("ulog/auav_x21.ulg", 0),
        ("ulog/cubeorange_rest.ulg", 0),
        ("ulog/sitl_groundtruth.ulg", 0),
        ("rosbag1/ardrone_imu.bag", 1),
        ("rosbag1/phidgets_upside_down.bag", 1),
        ("rosbag1/razor_vector3_gauss.bag", 1),
        ("rosbag1/xsens_tilt_laser.bag", 0),
    ],
)
def test_recorded_logs_are_doubted_only_for_disturbed_fields_and_slow_gyroscopes(
    shared, name, doubts
):
    texts = [note.text for note in inspection.doubts(readers.read(shared / name))]
    assert len(texts) == doubts
    usual = ("not calibrated, or disturbed", "too slow", "upside down")
    assert all(any(words in text for words in usual) for text in texts)
