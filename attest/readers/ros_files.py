"""The files of a ROS log: told by their first bytes, a folder by its ``metadata.yaml``."""

import tempfile
from collections.abc import Callable, Iterable
from itertools import takewhile
from pathlib import Path, PurePosixPath

import zstandard

from attest.errors import ReadError
from attest.readers.ros_topics import UNPACK_ERRORS, ZSTD, Crate, Topic

METADATA = "metadata.yaml"
LARGEST_METADATA = 1 << 20
"""Bytes; a longer one is not needed, as the files tell the same."""
MAGICS = {b"#ROSBAG V2.0\n": "bag", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "db3"}
_FILES = "relative_file_paths:"
_BLOCK = 1 << 20


def recognises(head: bytes, path: Path) -> bool:
    """Whether a file begins as one of the containers, or a folder is a ROS 2 log."""
    return is_folder(path) if path.is_dir() else _form(head) is not None


def is_folder(path: Path) -> bool:
    """Whether a folder is one ROS 2 log: its metadata, and files of messages beside it."""
    try:
        return (path / METADATA).is_file() and bool(storage(path))
    except OSError:
        return False


def storage(folder: Path) -> list[Path]:
    """Return the files of messages in a folder, by their first bytes, in name order."""
    files = sorted(path for path in folder.iterdir() if path.is_file())
    return [path for path in files if _form(_first(path)) or _first(path)[:4] == ZSTD]


def read(path: Path, settle: Callable[[Iterable[Topic]], int]) -> tuple[str, Crate]:
    """Return which container it is, and its topics, their messages handed to be decoded."""
    files = [path] if path.is_file() else storage(path)
    crate = Crate(sum(file.stat().st_size for file in files), settle)
    for name in _missing(path, files) if path.is_dir() else ():
        crate.damage[f"{name}, which {METADATA} names, is not in the folder"] = 1
    forms = [_read(file, crate) for file in files]
    crate.close()
    return forms[0], crate


def _first(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(16)
    except OSError:
        return b""


def _form(head: bytes) -> str | None:
    return next((form for magic, form in MAGICS.items() if head.startswith(magic)), None)


def _missing(folder: Path, files: list[Path]) -> list[str]:
    """Return the files that the metadata names and the folder lacks."""
    try:
        if (folder / METADATA).stat().st_size > LARGEST_METADATA:
            return []
        text = (folder / METADATA).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return []  # the files tell the same
    names = {PurePosixPath(name).name for name in _listed(text.splitlines())}
    return sorted(names - {file.name for file in files})[:100]


def _listed(lines: list[str]) -> list[str]:
    """Return the file names in a folder's metadata, as ROS writes them: one to a line.

    A parser of YAML takes half a minute for a megabyte made to slow it down.
    """
    stripped = [line.strip() for line in lines]
    if _FILES not in stripped:
        return []
    behind = stripped[stripped.index(_FILES) + 1 :]
    items = takewhile(lambda line: line.startswith("- "), behind)
    return [item[2:].strip(" '\"") for item in items]


def _read(path: Path, crate: Crate) -> str:
    """Take the messages of one file into the crate, and return which container it is."""
    from attest.readers import ros_bag, ros_db3, ros_mcap

    form = _form(_first(path))
    if form is None:
        return _unpacked(path, crate)
    {"bag": ros_bag.read, "mcap": ros_mcap.read, "db3": ros_db3.read}[form](path, crate)
    return form


def _unpacked(path: Path, crate: Crate) -> str:
    """Read a file that was compressed whole, by way of a temporary one."""
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "log"
        try:
            with path.open("rb") as packed, plain.open("wb") as file:
                reader = zstandard.ZstdDecompressor().stream_reader(packed)
                left = crate.effort // 8
                while left > 0 and (block := reader.read(_BLOCK)):
                    left -= file.write(block)
        except UNPACK_ERRORS:
            crate.damage[f"{path.name} does not unpack to its end"] += 1
        crate.effort -= plain.stat().st_size
        if _form(_first(plain)) is None:
            raise ReadError(f"{path}: holds no MCAP and no database. Copy the log again.")
        return _read(plain, crate)
