"""Batches over logs that are damaged, hang, kill and crash: a row for each, and each once."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from dataclasses import replace
from datetime import datetime
from itertools import islice
from pathlib import Path

import pyarrow.parquet
import pytest
from unkind import plan, run, short

from attest import batch
from attest.batch import resume
from attest.batch.rows import TIMING
from attest.errors import ConfigError

DRIVER = Path(__file__).parents[1] / "unkind.py"
PLEASANT = 4
THREATS = ("hang", "exit", "segv", "fault", *(("greedy",) if sys.platform == "linux" else ()))
LIMITS = batch.Limits(timeout_s=2.0, memory_gb=2.0)


@pytest.fixture(scope="module")
def flights(tmp_path_factory, sample_logs):
    """A folder of logs of all manners."""
    folder = tmp_path_factory.mktemp("flights")
    for i in range(PLEASANT):
        short(sample_logs, folder / f"evening {i % 2}" / f"slow{i}.csv")
    for name in THREATS:
        short(sample_logs, folder / f"{name}.csv")
    (folder / "empty.BIN").touch()
    (folder / "junk.tlog").write_bytes(bytes(range(256)) * 40)
    return folder


@pytest.fixture(scope="module")
def whole(flights, tmp_path_factory):
    """A batch over them that nothing interrupts."""
    output = tmp_path_factory.mktemp("whole")
    rows = run([flights], plan(output, limits=LIMITS))
    return output, [row for row, _ in rows]


def without_timing(output):
    with (output / "summary.csv").open(newline="") as file:
        return [
            {key: value for key, value in row.items() if key not in TIMING}
            for row in csv.DictReader(file)
        ]


def lines(output):
    return [json.loads(line) for line in (output / "journal.jsonl").read_text().splitlines()]


def test_summary_tells_when_a_log_was_run_and_how(whole):
    output, rows = whole
    with (output / "summary.csv").open(newline="") as file:
        told = list(csv.DictReader(file))
    assert {row["digest"] for row in told} == {rows[0]["digest"]}
    assert all(datetime.fromisoformat(row["ran_utc"]).tzinfo for row in told)


def test_every_log_is_one_row_with_its_status(whole):
    _, rows = whole
    statuses = {Path(row["path"]).name: row["status"] for row in rows}
    assert statuses == {
        **{f"slow{i}.csv": "ok" for i in range(PLEASANT)},
        **{f"{name}.csv": "memory" for name in THREATS if name == "greedy"},
        "hang.csv": "timeout",
        "exit.csv": "crashed",
        "segv.csv": "crashed",
        "fault.csv": "failed",
        "empty.BIN": "failed",
        "junk.tlog": "failed",
    }
    assert all("\n" not in (row["error"] or "") for row in rows)


def test_errors_say_what_happened(whole):
    _, rows = whole
    errors = {Path(row["path"]).stem: row["error"] for row in rows}
    assert errors["hang"] == "not done in 2 s. Raise --timeout, or cut the log."
    assert "exit code 3" in errors["exit"]
    assert sys.platform == "win32" or "SIGSEGV" in errors["segv"]
    assert "a fault of attest" in errors["fault"]
    assert "not what was expected" in errors["fault"]
    assert "file is empty" in errors["empty"]


def test_log_that_ended_its_process_is_known_by_its_content(whole):
    _, rows = whole
    assert all(len(row["sha256"]) == 64 for row in rows)


def test_outputs_keep_the_path_below_the_folder(whole):
    output, rows = whole
    done = {row["folder"] for row in rows if row["status"] == "ok"}
    assert done == {str(Path(f"evening {i % 2}", f"slow{i}")) for i in range(PLEASANT)}
    assert all((output / folder / "cgo.json").is_file() for folder in done)


def test_second_call_does_nothing(whole, flights):
    output, rows = whole
    again = run([flights], plan(output, limits=LIMITS))
    assert len(again) == len(rows)
    # a fault of the program may be mended by the next version: that one is tried again
    assert [Path(row["path"]).stem for row, before in again if not before] == ["fault"]


def test_summary_is_the_same_in_both_forms(whole):
    output, rows = whole
    table = without_timing(output)
    parquet = pyarrow.parquet.read_table(output / "summary.parquet").to_pylist()
    assert len(table) == len(parquet) == len(rows)
    for one, other in zip(table, parquet, strict=True):
        for key, value in one.items():
            assert value == ("" if other[key] is None else str(other[key]))
    assert [row["path"] for row in table] == sorted(row["path"] for row in table)


@pytest.mark.skipif(sys.platform != "linux", reason="signals of POSIX, and asks /proc")
def test_killed_at_any_moment_and_resumed_is_the_same(sample_logs, tmp_path):
    """kill -9 after one row, then after two more, and so on; no worker outlives that."""
    flights, once, often = (tmp_path / name for name in ("flights", "once", "often"))
    for name in ("slow1", "slow2", "slow3", "slow4", "slow5", "kill", "hang"):
        short(sample_logs, flights / f"{name}.csv")
    command = [sys.executable, str(DRIVER), str(flights)]
    assert subprocess.run([*command, str(once)], check=False).returncode == 0
    for moment in (1, 3, 0):
        with subprocess.Popen([*command, str(often)], stdout=subprocess.PIPE, text=True) as process:
            deque(islice((line for line in process.stdout if " False " in line), moment), 0)
            children = descendants(process.pid)
            process.kill()
        wait_until(lambda started=children: not any(map(runs, started)))
    assert subprocess.run([*command, str(often)], check=False).returncode == 0
    assert without_timing(often) == without_timing(once)
    counts = Counter(row["path"] for row in lines(often))
    assert set(counts.values()) == {1}
    assert "memory runs out" in next(r["error"] for r in lines(often) if r["folder"] == "kill")


def descendants(pid):
    tasks = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in tasks]


def runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(done, seconds=5.0):
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_interrupt_leaves_what_can_be_resumed(flights, tmp_path):
    command = [sys.executable, "-m", "attest", "batch", flights, "--output", tmp_path]
    options = ["-o", "paper/cgo", "--write", "json", "--json", "--jobs", "1"]
    with subprocess.Popen(
        [*map(str, command), *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert errors.splitlines()[-1] == "attest: interrupted."
    assert {row["status"] for row in lines(tmp_path)} == {"ok"}


def test_what_ran_into_a_limit_is_done_again_with_more(whole, flights):
    output, rows = whole
    hung = next(row for row in rows if row["status"] == "timeout")
    log = next(log for log in batch.find([str(flights)], output).logs if log.path == hung["path"])
    wanted = resume.Wanted(
        is_there=lambda _: True, digests={"cgo": hung["digest"]}, kinds=(), limits=LIMITS
    )
    more = replace(wanted, limits=batch.Limits(timeout_s=4.0))
    with batch.Journal(output) as journal:
        assert resume.still_good(journal, log, "cgo", wanted) == hung
        assert resume.still_good(journal, log, "cgo", more) is None
        assert resume.still_good(journal, log, "cgo", replace(wanted, retry=True)) is None


def test_changes_of_log_configuration_and_outputs_are_done_again(sample_logs, tmp_path):
    logs = [short(sample_logs, tmp_path / f"{name}.csv") for name in "abcde"]
    made = plan(tmp_path / "out", jobs=1)
    run(logs, made)
    logs[0].write_text(logs[0].read_text() + "\n")
    os.utime(logs[1])
    (tmp_path / "out" / "c" / "cgo.json").unlink()
    logs[3].unlink()
    again = {Path(row["path"]).stem: (row["status"], before) for row, before in run(logs, made)}
    assert again == {
        "a": ("ok", False),
        "b": ("ok", True),
        "c": ("ok", False),
        "d": ("failed", False),
        "e": ("ok", True),
    }


def test_two_batches_in_one_output_are_refused(tmp_path):
    with (
        batch.Journal(tmp_path),
        pytest.raises(ConfigError, match="another batch writes here"),
        batch.Journal(tmp_path),
    ):
        pass


def test_another_call_never_overwrites_logs_of_the_same_name(sample_logs, tmp_path):
    out = tmp_path / "out"
    for day in ("mon", "tue"):
        short(sample_logs, tmp_path / day / "x.csv")
        ((row, _),) = run([tmp_path / day], plan(out, jobs=1))
        assert (out / row["folder"] / "cgo.json").is_file()
    assert len(list(out.glob("*/cgo.json"))) == 2
    assert all(before for day in ("mon", "tue") for _, before in run([tmp_path / day], plan(out)))


@pytest.fixture
def tiny(tmp_path):
    """Give a file system that a single MCAP fills."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=48k", "tmpfs", str(folder)]
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("only root mounts")
    if subprocess.run(mount, check=False, capture_output=True).returncode != 0:
        pytest.skip("not allowed to mount here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)  # noqa: S607


def test_full_disk_is_a_row_and_is_tried_again(sample_logs, tiny, tmp_path):
    logs = [short(sample_logs, tmp_path / f"{name}.csv") for name in "ab"]
    rows = run(logs, plan(tiny, kinds=("mcap",), jobs=1))
    assert {row["status"] for row, _ in rows} == {"failed"}
    assert all("No space left on device. Free some space" in row["error"] for row, _ in rows)
    subprocess.run(["mount", "-o", "remount,size=9m", str(tiny)], check=True)  # noqa: S607
    again = run(logs, plan(tiny, kinds=("mcap",), jobs=1))
    assert {(row["status"], before) for row, before in again} == {("ok", False)}
