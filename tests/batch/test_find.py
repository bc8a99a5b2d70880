"""What names stand for, and where the results of each log go."""

import os
import sys
from importlib import import_module
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


OURS = b"\x89MCAP0\r\n\x01\x18\0\0\0\0\0\0\0\x04\0\0\0ros2\x0c\0\0\0attest 0.1.0\x03"


def test_what_attest_wrote_is_no_log_of_a_folder_unless_it_is_named(tmp_path):
    log(tmp_path / "flight.csv")
    result = tmp_path / "attest_out" / "flight" / "fts.mcap"
    result.parent.mkdir(parents=True)
    result.write_bytes(OURS)
    (tmp_path / "cut.mcap").write_bytes(OURS.replace(b"attest", b"rosbag"))
    found = find([str(tmp_path)], OUT)
    assert set(folders(found)) == {"flight.csv", "cut.mcap"}
    assert found.left_out == 1
    matching = find([str(tmp_path / "**" / "*.mcap")], OUT)
    assert (set(folders(matching)), matching.left_out) == ({"cut.mcap"}, 1)
    assert set(folders(find([str(result)], OUT))) == {"fts.mcap"}


@pytest.mark.parametrize("name", ["summary.csv", "Index.html", "journal.jsonl", ".committed"])
def test_results_are_in_no_folder_that_is_for_something_else(tmp_path, name):
    shown = name.removeprefix(".")
    inside = [str(log(tmp_path / name / "x.csv")), str(log(tmp_path / "mon" / "y.csv"))]
    where = folders(find(inside, OUT))
    assert where["y.csv"] == "mon/y"
    assert where["x.csv"].startswith("x-")
    assert shown not in where["x.csv"]


def test_a_pattern_leads_out_of_no_output(tmp_path):
    log(tmp_path / "logs" / "mon" / "a.csv")
    log(tmp_path / "b.csv")
    found = find([str(tmp_path / "logs" / "*" / ".." / ".." / "b.csv")], OUT)
    (folder,) = folders(found).values()
    assert folder.startswith("b-")
    assert ".." not in folder


@pytest.mark.skipif(sys.platform == "win32", reason="links are a privilege there")
def test_a_link_whose_disk_is_gone_is_a_log_that_is_gone(tmp_path):
    log(tmp_path / "a.csv")
    (tmp_path / "flight7.BIN").symlink_to("/mnt/no-such-disk/flight7.BIN")
    (tmp_path / "notes.txt").symlink_to("/mnt/no-such-disk/notes.txt")
    found = find([str(tmp_path)], OUT)
    assert (set(folders(found)), found.left_out) == ({"a.csv", "flight7.BIN"}, 1)


def test_folders_that_are_closed_are_named(tmp_path, monkeypatch):
    module = import_module("attest.batch.find")

    def closed(folder):
        if folder.endswith("secret"):
            raise PermissionError(folder)
        return look(folder)

    look = module._listed
    monkeypatch.setattr(module, "_listed", closed)
    log(tmp_path / "a.csv")
    (tmp_path / "secret").mkdir()
    assert find([str(tmp_path)], OUT).closed == (str(tmp_path / "secret"),)
    (tmp_path / "a.csv").unlink()
    with pytest.raises(ReadError, match=r"secret: cannot look into this folder\. Ask for"):
        find([str(tmp_path)], OUT)


def test_a_name_of_a_list_that_fits_nothing_is_a_log_that_is_gone(tmp_path):
    kept, gone = str(log(tmp_path / "a.csv")), str(tmp_path / "[gone].BIN")
    assert set(folders(find([kept, gone], OUT, listed=[gone]))) == {"a.csv", "[gone].BIN"}
    with pytest.raises(ReadError, match="nothing fits this pattern"):
        find([kept, gone], OUT)
