"""``attest batch`` as a person or a script meets it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from unkind import short

QUICK = ("-o", "paper/cgo", "--write", "json", "--jobs", "1")


def attest(*arguments, text=None, command="batch"):
    call = [sys.executable, "-m", "attest", command, *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True, input=text, check=False)


@pytest.fixture(scope="module")
def flights(tmp_path_factory, sample_logs):
    folder = tmp_path_factory.mktemp("flights")
    short(sample_logs, folder / "good one.csv")
    (folder / "bad.BIN").touch()
    (folder / "notes.txt").write_text("windy")
    return folder


@pytest.fixture(scope="module")
def done(flights, tmp_path_factory):
    output = tmp_path_factory.mktemp("out")
    return attest(flights, "--output", output, *QUICK), output


def test_it_tells_what_came_out_and_what_went_wrong(done, flights):
    found, output = done
    assert found.returncode == 1
    assert found.stdout.splitlines() == [
        "2 logs: 1 ok, 1 failed",
        "  left out    1 that are no logs, results of attest, or links to folders",
        f"  written     {output}/  summary.csv summary.parquet index.html",
    ]
    assert found.stderr.splitlines() == [
        f"attest: {flights / 'bad.BIN'}: cgo failed: the file is empty. "
        "Record or copy the log again.",
        f"attest: 1 of 2 runs did not end well. See {output / 'summary.csv'}.",
    ]


def test_json_is_a_row_a_line_also_of_what_was_done_before(done, flights):
    _, output = done
    again = attest("-", "--output", output, "--json", *QUICK, text=f"{flights}\n")
    rows = [json.loads(line) for line in again.stdout.splitlines()]
    assert {(Path(row["path"]).name, row["status"]) for row in rows} == {
        ("good one.csv", "ok"),
        ("bad.BIN", "failed"),
    }


def test_an_empty_list_is_no_failure(tmp_path):
    found = attest("-", "--output", tmp_path / "out", text="")
    assert (found.returncode, found.stdout) == (0, "")
    assert found.stderr == "attest: the list is empty: no log to run.\n"


@pytest.mark.skipif(sys.platform == "win32", reason="names that Windows has not")
def test_names_do_nothing_to_a_terminal(tmp_path):
    (tmp_path / "a\x1b]0;pwned\x07b.BIN").touch()
    found = attest(tmp_path, "--output", tmp_path / "out", *QUICK)
    assert "a\\x1b]0;pwned\\x07b.BIN: cgo failed: the file is empty." in found.stderr
    assert all(line.isprintable() for line in (found.stderr + found.stdout).splitlines())


@pytest.mark.skipif(sys.platform == "win32", reason="names that Windows has not")
def test_list_file_names_what_is_gone(flights, tmp_path):
    listed = tmp_path / "logs.txt"
    listed.write_bytes(b"%s\0%s\0" % (bytes(flights / "good one.csv"), b"/gone\nwith it.tlog"))
    found = attest(f"@{listed}", "--output", tmp_path / "out", *QUICK)
    assert found.returncode == 1
    assert found.stdout.startswith("2 logs: 1 ok, 1 failed\n")
    assert "attest: /gone with it.tlog: cgo failed: " in found.stderr
    assert len(found.stderr.splitlines()) == 2


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("@no/such/list",), 2, "@no/such/list: No such file or directory. Name a file with"),
        (("*.nothing",), 1, "nothing fits this pattern"),
        (("", "-q"), 2, "an empty name for a log"),
        (("x", "-o", "ftss"), 2, "unknown observer 'ftss'. Did you mean"),
        (("x", "--jobs", "-1"), 2, "--jobs"),
        (("x", "--timeout", "nan"), 2, "nan is no number"),
    ],
)
def test_wrong_usage_is_one_line(tmp_path, arguments, code, words):
    found = attest(*arguments, "--output", tmp_path / "out")
    assert (found.returncode, found.stdout) == (code, "")
    assert words in found.stderr
    assert len(found.stderr.splitlines()) == 1


def test_folder_given_to_run_is_a_batch_and_has_no_viewer(flights):
    found = attest(flights, "--open", command="run")
    assert found.returncode == 2
    assert found.stderr == "attest: --open: a folder has many results. Name a log.\n"
