"""``attest tune`` as a person or a script meets it."""

import json
import subprocess
import sys

import pytest

ATTEST = [sys.executable, "-m", "attest"]
QUICK = ("-o", "cgo", "--set", "gains.k_p=0.01", "--generations", 3)


def attest(*arguments):
    command = [*ATTEST, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def log(sample_logs):
    return sample_logs / "quadcopter.tlog"


@pytest.fixture(scope="module")
def printed(log):
    done = attest("tune", log, *QUICK)
    assert done.returncode == 0, done.stderr
    return done


def test_yaml_is_on_stdout_and_the_table_beside_it(printed, log):
    assert printed.stdout.startswith("# cgo, by attest tune ")
    assert "\nobserver: cgo\n" in printed.stdout
    assert printed.stderr.startswith(f"{log}  cgo\n")
    assert "SIMSTATE (truth)" in printed.stderr
    assert "held back, together" in printed.stderr


def test_yaml_runs(printed, log, tmp_path):
    tuned = tmp_path / "tuned.yaml"
    tuned.write_text(printed.stdout, encoding="utf-8")
    done = attest("run", log, "--observer", tuned, "--output", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    rmse = json.loads(done.stdout)["metrics"]["total"]["rmse"]
    (line,) = [line for line in printed.stdout.splitlines() if "on all: " in line]
    assert line.endswith(f"° -> {rmse:.3f}°")


def test_output_is_the_same_yaml_and_the_table_is_on_stdout(printed, log, tmp_path):
    tuned = tmp_path / "deep" / "tuned.yaml"
    done = attest("tune", log, *QUICK, "--output", tuned, "--jobs", 1)
    assert (done.returncode, done.stderr) == (0, "")
    assert tuned.read_text(encoding="utf-8") == printed.stdout
    assert done.stdout == printed.stderr


def test_json_has_each_fold(log):
    done = attest("tune", log, *QUICK, "--json", "--reference", "ATTITUDE", "--start", 5)
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    assert document["schema"] == 1
    assert document["logs"][0]["kind"] == "autopilot"
    assert set(document["keys"]) == {"gains.k_p", "gains.k_i"}
    assert document["keys"]["gains.k_p"]["start"] == 0.01
    assert len(document["folds"]) == 4
    assert set(document["rmse_deg"]) == {"all", "held_back"}
    # what chose the data is of this log, not of the next
    assert document["configuration"]["evaluation"]["reference"] is None
    assert document["configuration"]["input"]["start_s"] is None


def test_smoother_is_a_reference_as_in_run_and_said_to_be_no_truth(log, tmp_path):
    done = attest("tune", log, "-o", "cgo", "--generations", 1, "--reference", "smoother", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    (used,) = document["logs"]
    assert (used["reference"], used["kind"]) == ("smoother", "smoother")
    assert any(doubt.endswith("not independent, not truth") for doubt in used["doubts"])
    run = attest("run", log, "-o", "cgo", "--reference", "smoother", "--output", tmp_path, "--json")
    rmse = json.loads(run.stdout)["metrics"]["total"]["rmse"]
    assert document["rmse_deg"]["all"]["start"] == pytest.approx(rmse, rel=1e-6)


def test_quiet_prints_the_yaml_only(printed, log):
    done = attest("tune", log, *QUICK, "--quiet")
    assert (done.stdout, done.stderr) == (printed.stdout, "")


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (
            ("-o", "triad"),
            2,
            "observer 'triad' has no gains to tune. Choose another, or name keys with --key.",
        ),
        (
            ("-o", "cgo", "--key", "gains.kp"),
            2,
            "--key gains.kp: unknown key 'gains.kp'. Did you mean 'k_p'? Known: k_p, k_i.",
        ),
        (
            ("--reference", "none"),
            2,
            "--reference none: tuning needs one. Name it, or leave the option out.",
        ),
        (
            ("--output", "tuned.txt"),
            2,
            "--output tuned.txt: name a .yaml file, such as --observer takes.",
        ),
        (
            ("--factor", "nan"),
            2,
            "Invalid value for '--factor': nan is no number. See `python -m attest tune -h`.",
        ),
        (
            ("--skip", "inf"),
            2,
            "Invalid value for '--skip': inf is no number. See `python -m attest tune -h`.",
        ),
        (("--skip", 1000), 1, "{log}: no reference after the first 1000 s. Lower --skip."),
    ],
)
def test_errors_are_one_line(log, options, code, message):
    done = attest("tune", log, *options)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr == f"attest: {message.format(log=log)}\n"


def test_log_without_a_reference_cannot_be_used(tmp_path):
    log = tmp_path / "bare.csv"
    rows = "".join(f"{0.01 * i:.2f},0,0,0,0,0,-9.8\n" for i in range(200))
    log.write_text("time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + rows)
    done = attest("tune", log)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"attest: {log}: no reference to tune towards. Name a file that has it with --reference.\n"
    )


def test_log_that_cannot_be_used_fails_the_command_when_the_others_are_done(log, tmp_path):
    bad = tmp_path / "bad.tlog"
    bad.write_bytes(b"nothing of use")
    other = log.with_name("quadcopter.ulg")
    done = attest("tune", log, other, bad, *QUICK, "--quiet")
    assert done.returncode == 1
    assert "\nobserver: cgo\n" in done.stdout
    assert done.stderr.startswith(f"attest: 1 of 3 logs could not be used. {bad}: ")
    assert done.stderr.count("\n") == 1


def test_interrupt_leaves_nothing(log, tmp_path):
    output = tmp_path / "tuned.yaml"
    code = (
        "import attest.tuning.scoring as s, attest.cli as c, sys\n"
        "def stop(*_, **__): raise KeyboardInterrupt\n"
        "s.squares = stop\n"
        f"sys.argv = ['attest', 'tune', {str(log)!r}, '--output', {str(output)!r}]\nc.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.strip() == "attest: interrupted."
    assert list(tmp_path.iterdir()) == []
