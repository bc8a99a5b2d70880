"""Temporary folders that a kill leaves behind, and what the next batch does about them."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from attest.batch import temporary

HOLDS = """
import tempfile, time, sys
tempfile.tempdir = sys.argv[1]
from attest.batch import temporary
with temporary.folder() as folder:
    print(folder, flush=True)
    time.sleep(600)
"""


def test_a_folder_is_gone_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with temporary.folder() as folder:
        assert folder.parent == tmp_path
    assert not folder.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="its locks do not tell")
def test_what_a_kill_leaves_is_removed_and_what_is_in_use_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as process:
        held = process.stdout.readline().strip()
        old = time.time() - 2 * temporary.YOUNG
        os.utime(held, (old, old))
        with temporary.folder():
            assert Path(held).exists()
        process.kill()
    os.utime(held, (old, old))
    with temporary.folder():
        assert not Path(held).exists()
