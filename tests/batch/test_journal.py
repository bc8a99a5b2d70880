"""What a journal remembers, also when its last line was torn or the disk was full."""

import json
import os
import subprocess
import sys
from collections import deque

import pytest

from attest.batch.journal import Journal
from attest.errors import WriteError


def row(path="a", observer="fts", **more):
    known = {"path": path, "observer": observer, "status": "ok", "folder": path, "outputs": []}
    return known | {"size": 1, "mtime_ns": 1, "kinds": []} | more


def test_last_row_counts_and_order_is_of_path_and_observer(tmp_path):
    with Journal(tmp_path) as journal:
        journal.append([row("b"), row("a", "vae"), row("a", n=1)])
        journal.append([row("a", n=2)])
        assert journal.find("a", "fts") == row("a", n=2)
        assert journal.find("c", "fts") is None
    with Journal(tmp_path) as journal:
        assert list(journal.rows()) == [row("a", n=2), row("a", "vae"), row("b")]


@pytest.mark.parametrize("torn", [b"{", b'{"path": "b", "observer": "fts", "status": "ok"}'])
def test_torn_last_line_is_cut_off(tmp_path, torn):
    with Journal(tmp_path) as journal:
        journal.append([row("a")])
    with journal.path.open("ab") as file:
        file.write(torn)
    with Journal(tmp_path) as journal:
        assert journal.find("b", "fts") is None
        journal.append([row("c")])
    with Journal(tmp_path) as journal:
        assert [each["path"] for each in journal.rows()] == ["a", "c"]
        assert journal.damaged == 0


def test_lines_that_are_no_rows_are_left_out(tmp_path):
    text = f"\x00\n[1]\n{json.dumps(row('a'))}\n" + '{"path": 1}\n'
    (tmp_path / "journal.jsonl").write_text(text)
    with Journal(tmp_path) as journal:
        assert [each["path"] for each in journal.rows()] == ["a"]
        assert journal.damaged == 3


@pytest.mark.skipif(sys.platform == "win32", reason="names are text there")
def test_any_name_is_remembered(tmp_path):
    name = os.fsdecode(b"/\xff\n\xc3\xbc")
    with Journal(tmp_path) as journal:
        journal.append([row(name)])
    with Journal(tmp_path) as journal:
        assert journal.find(name, "fts") == row(name)


def test_output_that_cannot_be_written_is_refused_in_one_line(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(WriteError, match="cannot write"):
        Journal(tmp_path / "file")


@pytest.fixture
def tiny(tmp_path):
    """Give a file system of 64 kB."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("only root mounts")
    if subprocess.run(mount, check=False, capture_output=True).returncode != 0:
        pytest.skip("not allowed to mount here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)  # noqa: S607


def test_full_disk_leaves_whole_rows(tiny):
    with Journal(tiny) as journal:
        many = ([row(f"{i:03d}", error="x" * 500)] for i in range(1000))
        with pytest.raises(WriteError, match=r"journal.jsonl: cannot write: No space left"):
            deque(map(journal.append, many), 0)
        before = list(journal.rows())
    assert 50 < len(before) < 200
    with Journal(tiny) as journal:
        assert list(journal.rows()) == before
        assert journal.damaged == 0


@pytest.mark.parametrize(
    "more",
    [
        {"outputs": None},
        {"outputs": [1]},
        {"folder": 7},
        {"size": 1.0},
        {"total_rmse_deg": "bad"},
        {"scored": 1e400},
        {"scored": 1 << 63},
        {"warnings_count": True},
        {"vehicle": {"a": 1}},
    ],
)
def test_lines_that_would_spoil_the_summary_are_left_out(tmp_path, more):
    lines = [json.dumps(row("a")), json.dumps(row("b", **more)), "[" * 100_000]
    (tmp_path / "journal.jsonl").write_text("\n".join(lines) + "\n")
    with Journal(tmp_path) as journal:
        assert [each["path"] for each in journal.rows()] == ["a"]
        assert journal.damaged == 2
