"""Logs of many formats, read into one `Recording`.

A format is one module here with ``recognises(head, path)`` and ``read(path, options)``, and one
name in `NAMES`. Files are told by what is in them, never by their names.
"""

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from attest.config import Csv
from attest.errors import ReadError
from attest.readers import sensors
from attest.readers.options import ReadOptions, told, without_idle
from attest.readers.results import is_result
from attest.recording import Recording

__all__ = ["NAMES", "ReadOptions", "is_log", "is_result", "logs_in", "read", "recognise"]

NAMES = ("ros", "ulog", "dataflash", "tlog", "sensor_logger", "csv")
"""Modules in the order they are asked; imported on use."""
HEAD = 1 << 16
"""Bytes that a reader may look at to recognise a file."""


class _Reader(Protocol):
    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether the file is of this format."""

    def read(self, path: Path, options: ReadOptions) -> Recording:
        """Read the whole log."""


def recognise(path: Path, *, mapped: bool = False) -> str:
    """Return the name of the reader for a file; of a CSV whose columns are told, any file's.

    Raises
    ------
    ReadError
        There is no such file, or no reader knows it.
    """
    from attest.readers import sensor_logger, unknown

    head = _head(path)
    if (packed := unknown.compressed(path, head)) is not None:
        raise packed
    for name in NAMES:
        if _reader(name).recognises(head, path):
            return name
    if mapped and path.is_file():
        return "csv"
    if path.is_file() and sensor_logger.is_folder(path.parent):
        raise ReadError(
            f"{path}: one file of a recording of Sensor Logger, whose folder is one log. "
            f"Name the folder: {path.parent}"
        )
    raise unknown.refusal(path, head, ", ".join(NAMES))


def is_log(path: Path, csv: Csv | None = None) -> bool:
    """Whether some reader knows the file, or the folder is one log, as those of ROS 2 are.

    With the columns of a CSV told, also a file that has them.
    """
    from attest.readers import csv_plan

    try:
        recognise(path)
    except ReadError:
        return csv is not None and path.is_file() and csv_plan.fits(path, csv)
    return True


def logs_in(folder: Path, csv: Csv | None = None) -> list[Path]:
    """Return the logs of a folder and of those in it, by content, in name order.

    What is hidden is left out, and what `attest` itself wrote; a folder that is one log is named
    once, not file by file.
    """
    if is_log(folder):
        return [folder]
    logs = []
    for path in sorted(folder.glob("[!.]*")):
        if path.is_dir() and not path.is_symlink():
            logs += logs_in(path, csv)
        elif path.is_file() and is_log(path, csv) and not is_result(path):
            logs.append(path)
    return logs


def read(path: Path, options: ReadOptions | None = None) -> Recording:
    """Read a log of any known format.

    Raises
    ------
    ReadError
        The log cannot be read or holds nothing to work with.
    ConfigError
        The options ask for what the log does not hold.
    """
    options = options or ReadOptions()
    name = recognise(path, mapped=options.csv is not None and options.csv.maps)
    try:
        recording = _reader(name).read(path, without_idle(name, options))
    except OSError as error:
        raise _unreadable(path, error) from error
    read = sensors.as_told(recording, without_idle(name, options))
    return replace(read, notes=(*told(name, options), *read.notes))


def _reader(name: str) -> _Reader:
    return cast(_Reader, import_module(f"attest.readers.{name}"))


def _head(path: Path) -> bytes:
    if path.is_dir():
        from attest.readers import ros_files, sensor_logger

        if ros_files.is_folder(path) or sensor_logger.is_folder(path):
            return b""
        raise ReadError(f"{path}: a folder, and no log in this folder was named. Give a log file.")
    if path.exists() and not path.is_file():
        raise ReadError(f"{path}: not a regular file. Give a log file.")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not head:
        raise ReadError(f"{path}: the file is empty. Record or copy the log again.")
    return head


def _unreadable(path: Path, error: Exception) -> ReadError:
    if isinstance(error, FileNotFoundError):
        return ReadError(f"{path}: no such file. Check the path.")
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return ReadError(f"{path}: cannot be read: {reason}. Check the file and its permissions.")
