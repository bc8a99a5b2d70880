"""Batches on a real Dask cluster whose workers are killed, whose logs hang, whose ends vary."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path

import pytest
from unkind import plan, run, short

from attest import batch
from attest.batch import cluster, served
from attest.batch.child import Job
from attest.batch.rows import TIMING
from attest.batch.task import Task
from attest.errors import ConfigError

TESTS = Path(__file__).parents[1]
PLEASANT = 10
LIMITS = batch.Limits(timeout_s=3.0)
UNKIND = """
import sys
if "--multiprocessing-fork" in sys.orig_argv:
    import unkind
    unkind.unkind()
"""
"""What lets logs hang and kill in the processes that run them, wherever these are."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals of POSIX"),
]


class Cluster:
    """A scheduler, and workers that come and go, as processes."""

    def __init__(self, stack, folder):
        self._stack, self._folder, self._number = stack, folder, count()
        self._file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        wait_until(self._file.is_file)
        self.address = json.loads(self._file.read_text())["address"]

    def worker(self, *options):
        """Start a worker with a thread; a lost one is not replaced, unless a nanny is asked for."""
        options = options or ("--no-nanny",)
        return self._start("worker", "--host", "127.0.0.1", "--nthreads", "1", *options)

    def _start(self, what, *options):
        call = [sys.executable, "-m", "distributed.cli.dask_" + what, *options, "--no-dashboard"]
        if what == "worker":
            call += ["--local-directory", str(self._folder / str(next(self._number)))]
        log = self._stack.enter_context((self._folder / f"{what}.log").open("a"))
        process = subprocess.Popen(
            [*call, "--scheduler-file", str(self._file)], stdout=log, stderr=log, cwd=self._folder
        )
        self._stack.callback(ended, process)
        return process


def ended(process):
    process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@pytest.fixture
def dask(tmp_path, monkeypatch):
    """Give what starts a cluster, whose processes run unkind logs."""
    hook = tmp_path / "hook"
    hook.mkdir()
    (hook / "sitecustomize.py").write_text(UNKIND)
    path = [str(hook), str(TESTS), str(TESTS.parent)]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path))
    with ExitStack() as stack:
        yield Cluster(stack, hook)


def wait_until(done, seconds=60.0):
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end
        time.sleep(0.05)


def alike(rows):
    """Return what does not differ between places, by log."""
    told = {"path", "mtime_ns", "etag", "folder", *TIMING}
    return {
        Path(row["path"]).name: {key: row[key] for key in row if key not in told} for row in rows
    }


def children():
    """Return the processes of this machine that run tasks for a worker."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if b"attest.batch.child" in entry.read_bytes():
                found.append(int(entry.parent.name))
        except OSError:
            continue
    return found


@contextmanager
def counted(rows):
    """Check that there is one row of each log, all well."""
    counts = Counter(row["path"] for row in rows)
    assert set(counts.values()) == {1}
    yield
    assert {row["status"] for row in rows} == {"ok"}


def test_logs_of_all_manners_on_two_workers_are_as_on_one_machine(dask, sample_logs, tmp_path):
    names = ("hang", "exit", "fault", *(f"slow{i}" for i in range(3)))
    logs = [short(sample_logs, tmp_path / "logs" / f"{name}.csv") for name in names]
    (tmp_path / "logs" / "empty.BIN").touch()
    dask.worker("--nanny")
    dask.worker()
    made = plan(tmp_path / "far", limits=LIMITS, cluster=dask.address, prepare=())
    far = run([tmp_path / "logs"], made)
    near = run([tmp_path / "logs"], plan(tmp_path / "near", limits=LIMITS))
    assert alike(row for row, _ in far) == alike(row for row, _ in near)
    again = run([tmp_path / "logs"], made)
    assert [Path(row["path"]).stem for row, done in again if not done] == ["fault"]
    assert len(again) == len(logs) + 1
    wait_until(lambda: not children())


@pytest.mark.parametrize("where", ["s3", "folder"])
def test_worker_that_is_lost_midway_loses_and_doubles_nothing(
    where, dask, sample_logs, tmp_path, request
):
    for i in range(PLEASANT):
        short(sample_logs, tmp_path / "logs" / f"slow {i}.csv")
    named, place = str(tmp_path / "logs"), {"output": tmp_path / "out"}
    if where == "s3":
        bucket = request.getfixturevalue("bucket")
        for path in (tmp_path / "logs").iterdir():
            bucket.put(f"logs/{path.name}", path.read_bytes())
        named, place = bucket.url("logs"), batch.place(bucket.url("out"), tmp_path / "out")
    workers = [dask.worker(), dask.worker()]
    made = replace(plan(tmp_path / "out", cluster=dask.address, prepare=()), **place)
    rows = []
    found = batch.find([named], made.output, None, made.results)
    with batch.Journal(made.output) as journal:
        for row, _ in batch.run(found.logs, made, journal):
            rows.append(row)
            if len(rows) == 2:
                workers[0].kill()
        batch.write_results(journal, made.output, made.results)
    assert workers[0].wait() == -signal.SIGKILL
    with counted(rows):
        assert len(rows) == PLEASANT
    here = run([tmp_path / "logs"], plan(tmp_path / "here"))
    assert alike(rows) == alike(row for row, _ in here)
    keys = bucket.keys("out") if where == "s3" else map(str, (tmp_path / "out").rglob("*"))
    assert sum(key.endswith("cgo.json") for key in keys) == PLEASANT
    wait_until(lambda: not children())


def attest(*arguments):
    call = [sys.executable, "-m", "attest", "batch", *map(str, arguments)]
    options = ("-o", "paper/cgo", "--write", "json", "--json")
    return subprocess.Popen(
        [*call, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_interrupt_ends_what_runs_and_leaves_what_can_be_resumed(dask, sample_logs, tmp_path):
    for i in range(4):
        short(sample_logs, tmp_path / "logs" / f"slow{i}.csv")
    short(sample_logs, tmp_path / "logs" / "zhang.csv")
    dask.worker()
    where = (tmp_path / "logs", "--output", tmp_path / "out", "--cluster", dask.address)
    with attest(*where) as process:
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 130
    assert errors.lstrip() == "attest: interrupted.\n"
    wait_until(lambda: not children())
    with attest(*where, "--timeout", "3") as process:
        rows = [json.loads(line) for line in process.stdout]
    assert Counter(row["status"] for row in rows) == {"ok": 4, "timeout": 1}


def test_scheduler_that_is_lost_is_one_line(dask, sample_logs, tmp_path):
    for i in range(6):
        short(sample_logs, tmp_path / "logs" / f"slow{i}.csv")
    dask.worker()
    with attest(
        tmp_path / "logs", "--output", tmp_path / "out", "--cluster", dask.address
    ) as process:
        process.stdout.readline()
        dask.scheduler.kill()
        _, errors = process.communicate()
    assert process.returncode == 1
    assert errors == (
        f"attest: --cluster {dask.address}: the scheduler is gone. Run it again: what is done is "
        "kept.\n"
    )


def test_scheduler_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE_S", 1.0)
    with pytest.raises(cluster.ClusterError) as told:
        next(cluster.run(iter(()), "tcp://127.0.0.1:1", None))
    assert str(told.value) == (
        "--cluster tcp://127.0.0.1:1: no Dask scheduler answers there in 1 s. Start one "
        "(`dask scheduler`), or check the address."
    )


def test_no_more_tasks_are_taken_than_keep_the_workers_busy(dask, monkeypatch, tmp_path):
    monkeypatch.setattr(cluster, "LEAST", 2)
    taken = count()
    made = Task(
        log="", size=0, mtime_ns=0, output=f"file://{tmp_path}", folder="a", kinds=(),
        observers={"cgo": {}}, digests={"cgo": "0"},
    )  # fmt: skip
    tasks = (replace(made, log=f"/none/{next(taken)}.csv") for _ in range(12))
    job = Job(token="t", documents={}, kinds=(), limits=LIMITS)  # noqa: S106
    dask.worker()
    rows = []
    for row in cluster.run(tasks, dask.address, job):
        rows.append(row)
        assert int(repr(taken)[6:-1]) - len(rows) <= 2
    assert Counter(row["status"] for row in rows) == {"failed": 12}
    assert len({row["path"] for row in rows}) == 12


def test_worker_of_another_version_is_refused():
    job = Job(token="t", documents={}, kinds=(), limits=LIMITS)  # noqa: S106
    with pytest.raises(ConfigError, match=r"this is 0\.0\.0\. Install the same"):
        served.run("0.0.0", json.dumps(asdict(job)), "")


def test_address_that_is_none_is_refused():
    with pytest.raises(ConfigError, match="name a Dask scheduler, such as tcp://host:8786"):
        next(cluster.run(iter(()), "scheduler", None))
