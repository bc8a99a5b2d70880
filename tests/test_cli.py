"""The command line, as a person or a script meets it: exit codes and exact messages."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from attest import config

ATTEST = [sys.executable, "-m", "attest"]


def attest(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [*ATTEST, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def fails(code: int, message: str, *arguments: object) -> None:
    done = attest(*arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr == f"attest: {message}\n"


@pytest.fixture(scope="module")
def finished(tmp_path_factory, sample_logs):
    output = tmp_path_factory.mktemp("out")
    done = attest("run", sample_logs / "quadcopter.tlog", "--output", output)
    assert done.returncode == 0, done.stderr
    return done, output / "quadcopter"


def test_run_prints_a_table_and_names_what_it_wrote(finished):
    done, folder = finished
    assert done.stderr == ""
    for piece in (
        "SIMSTATE (truth)",
        "RMSE",
        "inclination",
        "gyro bias",
        "fts.mcap fts.rrd fts.json",
    ):
        assert piece in done.stdout
    assert sorted(p.name for p in folder.iterdir()) == ["fts.json", "fts.mcap", "fts.rrd"]


def test_json_is_the_contract_for_scripts(finished):
    summary = json.loads((finished[1] / "fts.json").read_text())
    assert summary["schema"] == 1
    promised = "log observer configuration reference metrics warnings timing versions"
    assert set(summary) >= set(promised.split())
    assert set(summary["log"]) >= {"path", "sha256", "format", "duration_s", "signals"}
    assert summary["log"]["signals"]["gyro"]["count"] == 3123
    assert summary["reference"] == {"name": "SIMSTATE", "kind": "truth", "independent": True}


def test_run_json_prints_what_it_writes(tmp_path, sample_logs):
    done = attest("run", sample_logs / "quadcopter.tlog", "--output", tmp_path, "--json")
    assert done.stdout == (tmp_path / "quadcopter" / "fts.json").read_text()


def test_same_input_gives_the_same_bytes_but_for_timing(finished, tmp_path, sample_logs):
    attest("run", sample_logs / "quadcopter.tlog", "--output", tmp_path, "--quiet")
    once, again = finished[1], tmp_path / "quadcopter"
    assert (once / "fts.mcap").read_bytes() == (again / "fts.mcap").read_bytes()
    documents = [json.loads((folder / "fts.json").read_text()) for folder in (once, again)]
    for document in documents:
        del document["timing"]
    assert documents[0] == documents[1]


def test_quiet_prints_nothing(tmp_path, sample_logs):
    done = attest("run", sample_logs / "quadcopter.tlog", "--output", tmp_path, "-q")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_logs_of_one_stem_never_overwrite_each_other(tmp_path, sample_logs):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        text = (sample_logs / "quadcopter_truth.csv").read_text().splitlines()
        cut = 200 if folder == "a" else 300
        (tmp_path / folder / "flight.csv").write_text("\n".join(text[:cut]) + "\n")
    out = tmp_path / "out"
    logs = [tmp_path / folder / "flight.csv" for folder in ("a", "b")]
    done = attest("run", *logs, "--output", out, "-q")
    assert done.returncode == 0, done.stderr
    assert len(list(out.iterdir())) == 2
    attest("run", tmp_path / "a" / "flight.csv", "--output", out, "-q")
    attest("run", tmp_path / "b" / "flight.csv", "--output", out, "-q")
    assert len(list(out.iterdir())) == 2
    lengths = {json.loads(p.read_text())["estimates"]["count"] for p in out.glob("*/fts.json")}
    assert len(lengths) == 2


def test_missing_file_is_one_line(tmp_path):
    gone = tmp_path / "gone.tlog"
    fails(1, f"{gone}: no such file. Check the path.", "run", gone)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.tlog", b""),
        ("notes.txt", b"the flight went well\n" * 50),
        ("photo.tlog", b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(range(256)) * 40),
    ],
)
@pytest.mark.parametrize("command", ["run", "info"])
def test_what_is_no_log_is_refused_in_one_line(tmp_path, command, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    done = attest(command, path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"attest: {path}: ")
    assert done.stderr.count("\n") == 1


def test_folder_without_logs_is_one_line(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here")
    message = f"{tmp_path}: no log in this folder. Name a log, or a folder with logs."
    fails(1, message, "run", tmp_path)


def test_folder_runs_what_it_can_and_exits_1_for_the_rest(tmp_path, sample_logs):
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "good.tlog").write_bytes((sample_logs / "quadcopter.tlog").read_bytes())
    (logs / "bad.csv").write_text("time_s,gyro_x,gyro_y,gyro_z\n")
    done = attest("run", logs, "--output", tmp_path / "out", "-q")
    assert done.returncode == 1
    table = tmp_path / "out" / "summary.csv"
    assert done.stderr.endswith(f"attest: 1 of 2 runs did not end well. See {table}.\n")
    assert (tmp_path / "out" / "good" / "fts.json").is_file()


def test_unknown_key_names_the_nearest_and_the_known(sample_logs):
    message = "fts: unknown key 'gains.kp'. Did you mean 'k_p'? Known: k_p, k_v, kappa, mu, p, k_b."
    log = sample_logs / "quadcopter.tlog"
    fails(2, message, "run", log, "--set", "gains.kp=1")


def test_value_outside_the_theorem_is_refused(sample_logs):
    log = sample_logs / "quadcopter.tlog"
    message = "fts: 'gains.mu' is 1.5. It must be: less than 1 [FTS, Theorem 1]."
    fails(2, message, "run", log, "--set", "gains.mu=1.5")


def test_unknown_reference_names_those_there_are(sample_logs):
    log = sample_logs / "quadcopter.tlog"
    message = f"{log}: no reference 'FOO', and no such file. The log has: SIMSTATE, ATTITUDE."
    fails(2, message, "run", log, "--reference", "FOO")


def test_unknown_option_is_wrong_usage():
    done = attest("run", "x.tlog", "--nonsense")
    assert done.returncode == 2
    assert "No such option" in done.stderr


def test_unwritable_output_is_one_line(tmp_path, sample_logs):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    done = attest("run", sample_logs / "quadcopter.tlog", "--output", blocked)
    assert done.returncode == 1
    assert done.stderr.startswith("attest: ")
    assert done.stderr.count("\n") == 1


def test_info_tells_signals_rates_and_references(sample_logs):
    done = attest("info", sample_logs / "quadcopter.tlog")
    assert done.returncode == 0
    for piece in ("RAW_IMU", "50.0 Hz", "SIMSTATE", "truth", "(default)", "UTC known"):
        assert piece in done.stdout
    described = json.loads(attest("info", sample_logs / "quadcopter.tlog", "--json").stdout)
    assert described["signals"]["mag"]["unit"] == "T"


def test_config_show_is_a_configuration_that_checks(tmp_path):
    for name in config.shipped():
        shown = tmp_path / f"{name.replace('/', '_')}.yaml"
        shown.write_text(attest("config", "show", name).stdout)
        done = attest("config", "check", shown)
        observer = config.read(config.find(name))["observer"]
        assert done.stdout == f"{shown}: right, for observer {observer!r}.\n"


def test_config_schema_is_json_schema():
    schema = json.loads(attest("config", "schema", "fts").stdout)
    assert schema["$defs"]["Gains"]["properties"]["mu"]["exclusiveMaximum"] == 1


def test_observers_lists_and_explains():
    assert attest("observers").stdout.startswith("fts ")
    assert "> 0, < 1" in attest("observers", "fts").stdout


def test_simulate_lets_a_sensor_fail_for_a_while(tmp_path):
    from attest import readers

    faults = ["--jump", "velocity=10:20:5,0,0", "--stuck", "velocity=30:33", "--stuck",
              "velocity=40:43", "--silent", "position=20:25"]  # fmt: skip
    for name, options in (("sound.csv", []), ("failing.csv", faults)):
        done = attest("simulate", "quadcopter", "-o", tmp_path / name, *options)
        assert (done.returncode, done.stderr) == (0, "")
    sound, failing = (readers.read(tmp_path / name) for name in ("sound.csv", "failing.csv"))
    before, after = sound.signals["velocity"], failing.signals["velocity"]
    seconds = (before.t - sound.signals["gyro"].t[0]) * 1e-9
    off = after.y - before.y
    during = (seconds > 10.5) & (seconds < 19.5)
    assert np.abs(off[during] - [5.0, 0.0, 0.0]).max() < 1e-6
    for start in (30.0, 40.0):
        held = after.y[(seconds > start + 0.1) & (seconds < start + 2.9)]
        assert np.ptp(held, axis=0).max() == 0.0
    silent = (failing.signals["position"].t - sound.signals["gyro"].t[0]) * 1e-9
    assert not ((silent > 20.1) & (silent < 24.9)).any()


def test_simulate_makes_the_sample_log_again(tmp_path, sample_logs):
    made = tmp_path / "quadcopter.tlog"
    assert attest("simulate", "quadcopter", "-o", made).returncode == 0
    assert made.read_bytes() == (sample_logs / "quadcopter.tlog").read_bytes()


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom attest.cli import cli\n"
        "try:\n cli.main(['--help'])\nexcept SystemExit:\n pass\n"
        "heavy = {'numpy', 'numba', 'rerun', 'pymavlink', 'rosbags', 'pydantic', 'mcap', 'rich',"
        " 'pyarrow', 'yaml'}\n"
        "sys.exit(str(sorted(heavy & set(sys.modules))) if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_help_shows_examples_and_every_command_has_them():
    for command in ([], ["run"], ["info"], ["observers"], ["simulate"], ["config", "show"]):
        done = attest(*command, "-h")
        assert done.returncode == 0
        assert "attest" in done.stdout.split("Example")[1]


def test_debug_shows_the_traceback(tmp_path):
    done = attest("--debug", "run", tmp_path / "gone.tlog")
    assert done.returncode == 1
    assert "Traceback" in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="kills by signal")
@pytest.mark.slow
def test_kill_at_any_moment_leaves_whole_files_or_none(tmp_path, sample_logs, finished):
    whole = {path.name: path.stat().st_size for path in finished[1].iterdir()}
    log, out = sample_logs / "quadcopter.tlog", tmp_path / "out"
    for tenth in range(4, 22, 2):
        process = subprocess.Popen([*ATTEST, "run", str(log), "--output", str(out), "-q"])
        time.sleep(tenth / 10)
        process.send_signal(signal.SIGKILL)
        process.wait()
        for path in (out / "quadcopter").glob("[!.]*"):
            if path.suffix != ".json":  # its timing differs
                # row ids of the .rrd are random, and compress so or so
                assert path.stat().st_size == pytest.approx(whole[path.name], rel=0.01)
    assert attest("run", log, "--output", out, "-q").returncode == 0
    assert sorted(p.name for p in (out / "quadcopter").iterdir()) == sorted(whole)  # no litter


def test_interrupt_exits_130(sample_logs):
    code = (
        "import attest.pipeline as p, attest.cli as c, sys\n"
        "def stop(*_, **__): raise KeyboardInterrupt\n"
        "p.run = stop\n"
        f"sys.argv = ['attest', 'run', {str(sample_logs / 'quadcopter.tlog')!r}]\nc.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr


def test_a_log_whose_stem_is_dots_stays_in_the_output_folder(tmp_path, sample_logs):
    log = tmp_path / "logs" / "...csv"
    log.parent.mkdir()
    log.write_bytes((sample_logs / "quadcopter_truth.csv").read_bytes())
    done = attest("run", log, "--output", tmp_path / "out", "-q")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["logs", "out"]
    assert list((tmp_path / "out").glob("*/fts.json"))


@pytest.fixture
def two_logs(tmp_path, sample_logs):
    """Make a folder with two of the sample logs."""
    folder = tmp_path / "two"
    folder.mkdir()
    for name in ("quadcopter.tlog", "quadcopter_truth.csv"):
        (folder / name).write_bytes((sample_logs / name).read_bytes())
    return folder


def test_one_log_that_does_not_suit_leaves_the_others_to_run(tmp_path, two_logs):
    done = attest("run", two_logs, "--reference", "SIMSTATE", "--output", tmp_path, "-q")
    assert done.returncode == 1
    assert "no reference 'SIMSTATE'" in done.stderr
    assert (tmp_path / "quadcopter" / "fts.json").is_file()


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
def test_a_name_that_is_not_utf_8_is_taken(tmp_path, sample_logs):
    log = os.fsencode(tmp_path) + b"/fl\xffight.csv"
    with open(log, "wb") as file:  # noqa: PTH123  (a name of bytes)
        file.write((sample_logs / "quadcopter_truth.csv").read_bytes())
    command = [*map(os.fsencode, ATTEST), b"run", log, b"-o", b"fts", b"-q", b"--output"]
    done = subprocess.run(
        [*command, os.fsencode(tmp_path / "out")], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", ""], "an empty name for a log"),
        (["run", "{log}", "--start", "10", "--end", "5"], "the end is not behind the start"),
        (["simulate", "quadcopter", "-o", "{tmp}/a.csv", "--seed", "-1"], "x>=0"),
        (["simulate", "quadcopter", "-o", "{tmp}/a.csv", "--truth", "{tmp}/a.csv"], "both the log"),
        (["simulate", "quadcopter", "-o", "{tmp}/a.csv", "--jump", "mag=1,2"], "form FROM:TO"),
        (["simulate", "quadcopter", "-o", "{tmp}/a.csv", "--stuck", "mag=5"], "form FROM:TO"),
        (["simulate", "quadcopter", "-o", "{tmp}/a.csv", "--silent", "mag=a:b"], "not a number"),
        (["run", "{log}", "--world", "xyz"], "'xyz' is not one of"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(tmp_path, sample_logs, arguments, words):
    named = [a.format(log=sample_logs / "quadcopter.tlog", tmp=tmp_path) for a in arguments]
    done = attest(*named, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_output_whose_name_is_too_long_is_one_line(tmp_path, sample_logs):
    output = tmp_path / ("a" * 300)
    done = attest("run", sample_logs / "quadcopter.tlog", "--output", output, "-q")
    assert done.returncode == 1
    assert "cannot write" in done.stderr
    assert done.stderr.count("\n") == 1


def test_json_of_several_logs_is_a_line_each(tmp_path, two_logs):
    done = attest("run", *sorted(two_logs.iterdir()), "--output", tmp_path, "--json")
    documents = [json.loads(line) for line in done.stdout.splitlines()]
    assert [document["schema"] for document in documents] == [1, 1]
