"""Outputs are whole or not there: on a kill, an exception, a full disk, a folder out of reach."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from attest import files
from attest.errors import WriteError
from attest.files import replacing

TESTS = Path(__file__).parent

KILLED = """
import os, signal, sys
from pathlib import Path
from unittest import mock
from attest.writers.mcap import write_mcap
from attest.writers.rerun import write_rerun
from results import result

def die(*_):
    if next(calls) == int(sys.argv[3]):
        os.kill(os.getpid(), signal.SIGKILL)
    return real(*_)

calls = iter(range(1_000_000))
module, name = sys.argv[2].rsplit(".", 1)
real = getattr(sys.modules[module], name)
write = write_rerun if sys.argv[1].endswith(".rrd") else write_mcap
with mock.patch(sys.argv[2], die):
    write(Path(sys.argv[1]), [result(3000)])
"""
"""Writes to the path in the first argument, and is killed at the nth call of a function."""


def write_half_and_raise(path, error):
    with replacing(path) as part:
        part.write_bytes(b"half")
        raise error


@pytest.mark.skipif(os.name != "posix", reason="there is no SIGKILL")
@pytest.mark.parametrize(
    ("name", "function", "call"),
    [
        ("fts.mcap", "attest.writers.mcap_file.start", 0),
        ("fts.mcap", "attest.writers.mcap_file.add_chunk", 2),
        ("fts.mcap", "attest.files._flush_to_disk", 0),
        ("fts.rrd", "attest.files._flush_to_disk", 0),
    ],
)
@pytest.mark.parametrize("old", [None, b"old"])
def test_kill_leaves_the_old_file_or_none(tmp_path, name, function, call, old):
    path = tmp_path / name
    if old:
        path.write_bytes(old)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    arguments = [sys.executable, "-c", KILLED, path, function, str(call)]
    done = subprocess.run(arguments, env=environment, check=False)
    assert done.returncode == -signal.SIGKILL
    left = {other.name for other in tmp_path.iterdir()}
    assert left - {name}, "nothing was being written"
    assert all(other.startswith(f".{name}.") for other in left - {name})
    assert (path.read_bytes() if path.exists() else None) == old
    with replacing(path) as part:  # the next run takes the leftovers away
        part.write_bytes(b"new")
    assert [other.name for other in tmp_path.iterdir()] == [name]
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, SystemExit])
def test_exception_leaves_the_old_file_and_goes_on(tmp_path, error):
    path = tmp_path / "out"
    path.write_bytes(b"old")
    with pytest.raises(error):
        write_half_and_raise(path, error)
    assert [other.name for other in tmp_path.iterdir()] == ["out"]
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (
            errno.ENOSPC,
            "No space left on device. Free some space, or choose another folder with --output.",
        ),
        (
            errno.EACCES,
            "Permission denied. Choose a folder that you may write to with --output.",
        ),
        (errno.EIO, "Input/output error. Choose another folder with --output."),
    ],
)
def test_refusal_of_the_system_is_one_line(tmp_path, monkeypatch, number, message):
    def refuse(_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(files, "_flush_to_disk", refuse)
    path = tmp_path / "out"
    with pytest.raises(WriteError) as caught, replacing(path) as part:
        part.write_bytes(b"half")
    assert str(caught.value) == f"{path}: cannot write: {message}"
    assert not list(tmp_path.iterdir())


def test_full_disk_while_writing_leaves_nothing(tmp_path):
    path = tmp_path / "out"
    with pytest.raises(WriteError, match="No space left on device"):
        write_half_and_raise(path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert not list(tmp_path.iterdir())


def test_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    path = tmp_path / "file" / "out"
    with pytest.raises(WriteError) as caught, replacing(path):
        pass
    assert str(caught.value).startswith(f"{path}: cannot write: ")
    assert str(caught.value).endswith("Choose another folder with --output.")


@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root may write everywhere")
def test_folder_without_permission_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    path = tmp_path / "out"
    try:
        with pytest.raises(WriteError) as caught, replacing(path) as part:
            part.write_bytes(b"")
    finally:
        tmp_path.chmod(0o700)
    assert str(caught.value) == (
        f"{path}: cannot write: Permission denied. "
        "Choose a folder that you may write to with --output."
    )


def test_folder_is_made(tmp_path):
    path = tmp_path / "a" / "b" / "out"
    with replacing(path) as part:
        part.write_bytes(b"new")
    assert path.read_bytes() == b"new"


def test_part_of_a_running_process_and_other_names_stay(tmp_path):
    kept = {f".out.{os.getppid()}.part", ".out.x.part", ".other.999999999.part", "out.1.part"}
    for name in (*kept, ".out.999999999.part"):
        (tmp_path / name).write_bytes(b"")
    with replacing(tmp_path / "out") as part:
        part.write_bytes(b"new")
    assert {other.name for other in tmp_path.iterdir()} == kept | {"out"}
