"""What names stand for, and where the results of each log go."""

import os
import sys
from pathlib import Path

import pytest

from attest.batch.find import find, names_in
from attest.errors import ConfigError, ReadError

CSV = "time_s,gyro_x,gyro_y,gyro_z\n0,0,0,0\n0.01,0,0,0\n"
OUT = Path("nowhere")


def log(path, lines=1):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(CSV + "0.02,0,0,0\n" * lines)
    return path


def folders(found):
    return {Path(log.path).name: Path(log.folder).as_posix() for log in found.logs}


def test_largest_is_first(tmp_path):
    for name, lines in (("b", 5), ("a", 5), ("c", 90)):
        log(tmp_path / f"{name}.csv", lines)
    found = find([str(tmp_path)], OUT)
    assert [Path(each.path).stem for each in found.logs] == ["c", "a", "b"]
    assert found.logs[0].size > found.logs[1].size


def test_files_of_a_folder_are_told_by_content_or_a_logs_suffix(tmp_path):
    log(tmp_path / "flight.txt")
    (tmp_path / "broken.BIN").write_bytes(b"junk")
    (tmp_path / "notes.txt").write_text("windy")
    log(tmp_path / ".hidden.csv")
    found = find([str(tmp_path)], OUT)
    assert set(folders(found)) == {"flight.txt", "broken.BIN"}
    assert found.left_out == 1


def test_paths_below_the_folder_are_kept_and_twins_keep_their_suffix(tmp_path):
    for name in ("mon/x.csv", "tue/x.csv", "tue/y.csv", "tue/Y.txt", "journal.jsonl.csv"):
        log(tmp_path / name)
    found = {each.path: Path(each.folder).as_posix() for each in find([str(tmp_path)], OUT).logs}
    named = {Path(path).relative_to(tmp_path).as_posix(): where for path, where in found.items()}
    assert named.pop("journal.jsonl.csv").startswith("journal.jsonl-")
    assert named == {
        "mon/x.csv": "mon/x",
        "tue/x.csv": "tue/x",
        "tue/y.csv": "tue/y.csv",
        "tue/Y.txt": "tue/Y.txt",
    }


def test_logs_named_one_by_one_are_placed_below_what_they_have_in_common(tmp_path):
    names = [str(log(tmp_path / name)) for name in ("mon/1.csv", "tue/1.csv")]
    assert {each.folder for each in find(names, OUT).logs} == {
        str(Path("mon", "1")),
        str(Path("tue", "1")),
    }
    assert find(names[:1], OUT).logs[0].folder == "1"
    up = str(tmp_path / "mon" / ".." / "tue" / "1.csv")
    assert len(find([*names, up], OUT).logs) == 2


def test_steps_up_never_lead_out_of_the_output(tmp_path):
    log(tmp_path / "a" / "b" / "1.csv")
    log(tmp_path / "c.csv")
    names = [str(tmp_path / "a" / "b"), str(tmp_path / "a" / "b" / ".." / ".." / "c.csv")]
    assert all(".." not in Path(each.folder).parts for each in find(names, OUT).logs)


def test_patterns_and_what_fits_none(tmp_path):
    for name in ("mon/x.csv", "tue/y.csv"):
        log(tmp_path / name)
    found = find([str(tmp_path / "**" / "*.csv")], OUT)
    assert folders(found) == {"x.csv": "mon/x", "y.csv": "tue/y"}
    with pytest.raises(ReadError, match="nothing fits this pattern"):
        find([str(tmp_path / "*.ulg")], OUT)


def test_log_that_is_gone_is_kept_for_its_row(tmp_path):
    (gone,) = find([str(tmp_path / "gone.tlog")], OUT).logs
    assert (gone.size, gone.mtime_ns) == (0, 0)


def test_output_is_not_looked_into(tmp_path):
    log(tmp_path / "x.csv")
    log(tmp_path / "out" / "y.csv")
    assert folders(find([str(tmp_path)], tmp_path / "out")) == {"x.csv": "x"}


def test_nothing_and_an_empty_name_are_refused(tmp_path):
    with pytest.raises(ReadError, match="no log in this folder"):
        find([str(tmp_path)], OUT)
    with pytest.raises(ConfigError, match="empty name"):
        find([""], OUT)


@pytest.mark.skipif(sys.platform == "win32", reason="names that Windows has not")
def test_any_name_is_found(tmp_path):
    names = ["a b.csv", "ü☃.csv", "new\nline.csv", "=cmd.csv", os.fsdecode(b"\xff.csv")]
    for name in names:
        log(tmp_path / name)
    assert set(folders(find([str(tmp_path)], OUT))) == set(names)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights on Windows")
def test_links_lead_nowhere_twice(tmp_path):
    log(tmp_path / "in" / "x.csv")
    (tmp_path / "in" / "up").symlink_to(tmp_path, target_is_directory=True)
    (tmp_path / "in" / "self.csv").symlink_to(tmp_path / "in" / "self.csv")
    (tmp_path / "in" / "same.csv").symlink_to(tmp_path / "in" / "x.csv")
    found = find([str(tmp_path)], OUT)
    assert set(folders(found)) == {"x.csv", "same.csv"}
    assert found.left_out == 2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")
def test_pipes_are_not_opened(tmp_path):
    log(tmp_path / "x.csv")
    os.mkfifo(tmp_path / "pipe.tlog")
    assert find([str(tmp_path)], OUT).left_out == 1


def test_folder_of_5000_files(tmp_path):
    for i in range(5000):
        (tmp_path / f"{i:04d}.csv").write_text(CSV)
    found = find([str(tmp_path)], OUT)
    assert len({each.folder for each in found.logs}) == 5000


def test_lists_take_lines_or_zero_bytes():
    assert names_in(b"a b\r\nc\n\n") == ["a b", "c"]
    assert names_in(b"a\nb\0c\0") == ["a\nb", "c"]
