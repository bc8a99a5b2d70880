"""Logs and results in an object store, or behind SSH: each result whole, once, or not there."""

import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from threading import Barrier
from urllib.parse import unquote

import fsspec
import pytest
from sftp_server import PASSWORD, serving
from unkind import plan, run, short

from attest import batch, pipeline
from attest.batch import fetch, store, task, urls
from attest.batch.listing import Stamp
from attest.batch.rows import TIMING
from attest.errors import ConfigError, ReadError, WriteError

NAMES = ("a.csv", "evening é/b c.csv", "evening é/[x]*?.csv", "evening é/b c/d.csv")
RACERS = 6

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="names that Windows has not")


@pytest.fixture
def flight(sample_logs, tmp_path):
    return short(sample_logs, tmp_path / "flight.csv").read_bytes()


@pytest.fixture
def logs(bucket, flight):
    """Fill a folder of the bucket with logs, and what is none."""
    for name in NAMES:
        bucket.put(f"logs/{name}", flight)
    bucket.put("logs/empty.BIN", b"")
    for name in ("notes.txt", "a//b.csv", "../../out.csv", ".hidden.csv"):
        bucket.put(f"logs/{name}", b"windy")
    return bucket.url("logs/")


def remote(url, journal, **choices):
    return plan(journal, results=url, prepare=(), jobs=1, **choices)


def run_remote(named, made):
    found = batch.find(list(map(str, named)), made.output, None, made.results)
    with batch.Journal(made.output) as journal:
        rows = list(batch.run(found.logs, made, journal))
        batch.write_results(journal, made.output, made.results)
    return rows


def attempts(bucket):
    return [key for key in bucket.keys("out") if key.endswith("cgo.json")]


def alike(row):
    """Return what does not differ between places."""
    told = {"path", "mtime_ns", "etag", "folder", "timeout_s", "memory_gb"}
    return {key: value for key, value in row.items() if key not in {*TIMING, *told}}


def test_logs_are_found_by_content_and_what_could_lead_astray_is_left_out(logs):
    found = batch.find([logs], Path("out"))
    assert {log.path.removeprefix(logs) for log in found.logs} == {*NAMES, "empty.BIN"}
    assert [log.size for log in found.logs] == sorted(
        (log.size for log in found.logs), reverse=True
    )
    assert all(log.etag for log in found.logs)
    assert found.left_out == 3


def test_a_pattern_an_object_and_a_folder_that_is_a_log(bucket, logs, sample_logs):
    def paths(name):
        return {log.path for log in batch.find([name], Path("out")).logs}

    assert paths(f"{logs}*.csv") == {f"{logs}a.csv"}
    assert paths(f"{logs}**/b*.csv") == {f"{logs}evening é/b c.csv"}
    assert paths(f"{logs}evening é/[x]*?.csv") == {f"{logs}evening é/[x]*?.csv"}
    folder = next(path.parent for path in sample_logs.rglob("metadata.yaml"))
    for path in folder.iterdir():
        bucket.put(f"ros/deep/{path.name}", path.read_bytes())
    bucket.put("ros/deep/below/more.csv", b"time_s,gyro_x,gyro_y,gyro_z\n")
    assert paths(bucket.url("ros/")) == {bucket.url("ros/deep")}
    assert paths(bucket.url("ros/deep")) == {bucket.url("ros/deep")}
    (found,) = batch.find([bucket.url("ros/deep")], Path("out")).logs
    with fetch.Source(found.path, Stamp(found.size, found.mtime_ns, found.etag)) as source:
        names = {path.name for path in source.path().iterdir()}
    assert names == {path.name for path in folder.iterdir()}


@pytest.mark.slow
def test_from_store_to_store_and_again(bucket, logs, flight, tmp_path):
    made = remote(bucket.url("out"), tmp_path / "journal")
    rows = {row["path"].removeprefix(logs): row for row, _ in run_remote([logs], made)}
    assert {name: row["status"] for name, row in rows.items()} == {
        **dict.fromkeys(NAMES, "ok"),
        "empty.BIN": "failed",
    }
    (here, _), *_ = run([tmp_path / "flight.csv"], plan(tmp_path / "here", prepare=()))
    assert alike(rows["a.csv"]) == alike(here)
    for row in (rows[name] for name in NAMES):
        told = json.loads(bucket.fs.cat_file(bucket.url(f"out/{row['folder']}/cgo.json")))
        assert told["log"]["path"] == row["path"]
    page = bucket.fs.cat_file(bucket.url("out/index.html")).decode()
    links = [unquote(link) for link in re.findall(r'href="\./([^"]+)"', page)]
    assert sorted(links) == sorted(key.removeprefix("out/") for key in attempts(bucket))
    before = bucket.keys("out")

    assert all(done for _, done in run_remote([logs], made))
    elsewhere = remote(bucket.url("out"), tmp_path / "another journal")
    again = {row["path"]: row for row, _ in run_remote([logs], elsewhere)}
    assert all(again[row["path"]] == row for row in rows.values() if row["status"] == "ok")
    assert bucket.keys("out") == before

    bucket.put(f"logs/{NAMES[0]}", flight + b"\n")
    bucket.fs.rm_file(bucket.url(f"out/{rows[NAMES[1]]['folder']}/cgo.json"))
    anew = {row["path"].removeprefix(logs) for row, done in run_remote([logs], made) if not done}
    assert anew == {NAMES[0], NAMES[1]}
    assert len(attempts(bucket)) == len(NAMES)

    assert not any(done for _, done in run_remote([logs], replace(made, force=True)))
    assert len(attempts(bucket)) == len(NAMES)
    assert not set(attempts(bucket)) & set(before)


@pytest.fixture
def sftp(monkeypatch):
    """Serve this machine's files over SSH, and let this process and others in."""
    with serving() as port:
        monkeypatch.setenv("FSSPEC_SFTP_PASSWORD", PASSWORD)
        monkeypatch.setitem(fsspec.config.conf, "sftp", {"password": PASSWORD})
        yield f"sftp://me@127.0.0.1:{port}"


@pytest.mark.slow
def test_over_ssh(sftp, sample_logs, tmp_path):
    short(sample_logs, tmp_path / "logs" / "b c#é?.csv")
    made = remote(f"{sftp}{tmp_path}/out", tmp_path / "journal")
    ((row, _),) = run_remote([f"{sftp}{tmp_path}/logs"], made)
    assert row["status"] == "ok", row["error"]
    assert row["path"] == f"{sftp}{tmp_path}/logs/b c#é?.csv"
    assert (tmp_path / "out" / row["folder"] / "cgo.json").is_file()
    assert (tmp_path / "out" / "index.html").is_file()
    assert not list((tmp_path / "out").rglob("*.part"))
    ((_, done),) = run_remote([f"{sftp}{tmp_path}/logs"], made)
    assert done
    fsspec.config.conf["sftp"]["password"] = "other"  # noqa: S105
    with pytest.raises(ReadError, match=r"^sftp://.*: access is refused: Authentication failed"):
        batch.find([f"{sftp}{tmp_path}/logs"], tmp_path)


@pytest.fixture(params=["file", "s3", "sftp"])
def output(request, tmp_path):
    """Give the URL of an output, of each kind of store."""
    if request.param == "s3":
        return request.getfixturevalue("bucket").url("out")
    if request.param == "sftp":
        return f"{request.getfixturevalue('sftp')}{tmp_path}/out"
    return f"file://{tmp_path}/out"


ROW = {"path": "/logs/a.csv", "observer": "cgo", "status": "ok", "size": 7, "mtime_ns": 8}
ROW |= {"kinds": [], "folder": "", "outputs": []}


def job(output, **more):
    made = {
        "log": "/logs/a.csv",
        "size": 7,
        "mtime_ns": 8,
        "output": output,
        "folder": "deep/a [1]*",
        "observers": {"cgo": {}},
        "digests": {"cgo": "0"},
        "kinds": (),
    }
    return task.Task(**made | more)


def attempt(mine, value):
    """Put an attempt, up to its commit, and return the row that it would have."""
    folder = mine.folder("cgo")
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / "cgo.json", folder / "cgo.mcap"]
    for path in written:
        path.write_text(f"{value}")
    names = [path.name for path in written]
    return ROW | {"folder": mine.put(written), "outputs": names, "value": value}


def contents(output):
    """Return what is in the results of an output, by path, without rows and notes."""
    with urls.opened(output) as place:
        paths = [path for path in store.there(output) if not path.startswith(store.COMMITTED)]
        return {path: place.fs.cat_file(place.below(path)).decode() for path in paths}


def test_of_attempts_that_race_one_is_the_result_as_a_whole(output):
    start = Barrier(RACERS)

    def race(value):
        with store.Store(job(output)) as mine:
            assert mine.found("cgo") is None
            row = attempt(mine, value)
            start.wait()
            return mine.commit("cgo", row)

    with ThreadPoolExecutor(RACERS) as threads:
        rows = list(threads.map(race, range(RACERS)))
    assert all(row == rows[0] for row in rows)
    with store.Store(job(output)) as later:
        assert later.found("cgo") == rows[0]
    whole = {f"{rows[0]['folder']}/{name}": str(rows[0]["value"]) for name in rows[0]["outputs"]}
    assert contents(output) == whole


def test_what_is_cut_off_half_way_is_no_result_and_is_tidied_later(output):
    dead = store.Store(job(output))  # never left: its process was killed
    attempt(dead, "torn")
    with store.Store(job(output)) as mine:
        assert mine.found("cgo") is None
        row = mine.commit("cgo", attempt(mine, "whole"))
    assert set(contents(output).values()) == {"whole"}
    with store.Store(job(output, again="by force")) as mine:
        assert mine.found("cgo") is None
        anew = mine.commit("cgo", attempt(mine, "newer"))
        assert anew["folder"] != row["folder"]
    assert set(contents(output).values()) == {"newer"}
    dead.discard()
    dead._stack.close()


@pytest.mark.parametrize(
    "row", [b"", b"[]", b'{"folder": "a"}', json.dumps(ROW | {"folder": "../.."}).encode()]
)
def test_row_that_is_torn_is_none_and_in_nobodys_way(output, row):
    with store.Store(job(output)) as mine:
        assert mine.found("cgo") is None
        mine.commit("cgo", attempt(mine, "first"))
    with urls.opened(output) as place:
        (path,) = (path for path in store.there(output) if path.endswith("0.json"))
        place.fs.pipe_file(place.below(path), row)
    with store.Store(job(output)) as mine:
        assert mine.found("cgo") is None
        made = mine.commit("cgo", attempt(mine, "second"))
    with store.Store(job(output)) as later:
        assert later.found("cgo") == made
    assert set(contents(output).values()) == {"second"}


def test_attempt_that_fails_leaves_nothing(output):
    with store.Store(job(output)) as mine:
        attempt(mine, "unwanted")
        mine.discard()
        assert contents(output) == {}


def test_commit_whose_answer_is_lost_is_still_ours(bucket, monkeypatch):
    put = type(bucket.fs).pipe_file

    def lost(self, path, data, **options):
        put(self, path, data, **options)
        raise OSError("At least one of the pre-conditions did not hold")

    with store.Store(job(bucket.url("out"))) as mine:
        assert mine.found("cgo") is None
        row = attempt(mine, "whole")
        monkeypatch.setattr(type(bucket.fs), "pipe_file", lost)
        assert mine.commit("cgo", row) == row
    assert set(contents(bucket.url("out")).values()) == {"whole"}


def test_log_that_changes_under_way_is_no_log(bucket, flight):
    bucket.put("a.csv", flight)
    (log,) = batch.find([bucket.url("a.csv")], Path("out")).logs
    bucket.put("a.csv", flight + b"\n")
    with (
        fetch.Source(log.path, Stamp(log.size, log.mtime_ns, log.etag)) as source,
        pytest.raises(ReadError, match="changed since it was listed"),
    ):
        source.path()


def test_log_that_is_gone_and_bucket_that_is_not_there_are_rows(bucket, tmp_path):
    made = task.Task(
        **asdict(job(str(tmp_path)))
        | {"observers": {"cgo": effective()}, "log": "", "size": 0}
        | {"mtime_ns": 0}
    )
    for url in (bucket.url("none.csv"), "s3://no-such-bucket/a.csv"):
        (log,) = batch.find([url], tmp_path).logs
        (row,) = task.run(replace(made, log=log.path))
        assert (row["path"], row["status"], row["final"]) == (url, "failed", False)
        assert row["error"] == f"{url}: no such bucket, folder or object. Check the URL."


def effective():
    from attest import config

    return config.effective(pipeline.configure("paper/cgo"))


def test_error_of_a_log_names_its_url(bucket, tmp_path):
    url = bucket.put("a b.csv", b"")
    (log,) = batch.find([url], tmp_path).logs
    made = replace(
        job(str(tmp_path), log=url, size=0, mtime_ns=0, observers={"cgo": effective()}),
        etag=log.etag,
    )
    (row,) = task.run(made)
    assert row["error"].startswith(f"{url}: the file is empty")


def test_refused_keys_are_one_line(bucket, logs, tmp_path):
    bucket.refuse()
    try:
        with pytest.raises(ReadError, match=r"^s3://.*/logs/: access is refused: .*\.$") as told:
            batch.find([logs], tmp_path)
        with pytest.raises(WriteError, match="access is refused"):
            store.begin(bucket.url("out"))
    finally:
        bucket.refuse("inf")
    assert "\n" not in str(told.value)


def test_no_output_is_refused_before_any_log_is_run(bucket, flight, tmp_path):
    url = bucket.put("a.csv", flight)
    made = remote("s3://no-such-bucket/out", tmp_path)
    with pytest.raises(WriteError, match="no such bucket"):
        run_remote([url], made)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("ftp://host/a", "unknown protocol. Known are s3://, gs://, sftp://, file://."),
        ("s3:///a", "names no bucket"),
        ("sftp:///a", "names no host"),
        ("sftp://me:secret@host/a", "sftp://me:***@host/a: a password in a URL"),
        ("http://me:secret@host/a", "http://me:***@host/a: unknown protocol"),
    ],
)
def test_url_that_is_not_for_us_is_one_line_without_its_password(url, words):
    with pytest.raises(ConfigError) as told:
        urls.checked(url)
    assert words in str(told.value)
    assert "secret" not in str(told.value)


def test_chain_of_protocols_is_a_path_that_is_not_there():
    assert not urls.is_url("simplecache::s3://bucket/a")


def test_file_url_is_a_path(sample_logs, tmp_path):
    log = short(sample_logs, tmp_path / "a b.csv")
    (found,) = batch.find([f"file://{log}"], tmp_path).logs
    assert found.path == str(log)
    assert batch.place(f"file://{tmp_path}", None) == {"output": tmp_path}


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        ("fsspec", ("s3://bucket/logs",)),
        ("s3fs", ("s3://bucket/logs",)),
        ("distributed", (__file__, "--cluster", "tcp://127.0.0.1:1", "-o", "paper/cgo")),
    ],
)
def test_missing_library_says_what_to_install(module, arguments, tmp_path):
    code = f"import sys; sys.modules[{module!r}] = None; from attest.cli import main; main()"
    call = [sys.executable, "-c", code, "batch", *arguments, "--output", str(tmp_path)]
    found = subprocess.run(call, capture_output=True, text=True, check=False)
    assert found.returncode == 2
    assert found.stderr.count("\n") == 1
    assert "pip install 'attest[cluster]'." in found.stderr


def test_one_machine_needs_none_of_the_libraries(tmp_path):
    (tmp_path / "empty.BIN").touch()
    names = ["fsspec", "s3fs", "distributed", "dask", "paramiko"]
    code = f"import sys; sys.modules.update(dict.fromkeys({names}))\n"
    code += "from attest.cli import main\nif __name__ == '__main__': main()\n"
    (tmp_path / "main.py").write_text(code)
    call = [sys.executable, str(tmp_path / "main.py"), "batch", str(tmp_path / "empty.BIN")]
    options = ["--jobs", "1", "-o", "paper/cgo", "--write", "json", "--output", str(tmp_path)]
    found = subprocess.run([*call, *options], capture_output=True, text=True, check=False)
    assert found.stdout.startswith("1 logs: 1 failed\n"), found.stderr
    assert "the file is empty" in found.stderr
