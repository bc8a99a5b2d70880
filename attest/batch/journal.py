"""The batch's memory: a line of JSON for each log and observer that ended.

A line is on the disk before the next log counts as done. Only the last line can be torn, by a
power cut or a kill, and is then cut off. The file is locked while a batch writes to it; the system
takes the lock away from a process that ends, however it does.
"""

import hashlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import Any, Self

from attest.batch.rows import COLUMNS, Row
from attest.errors import ConfigError
from attest.files import refused

NAME = "journal.jsonl"
OF_ROWS: Mapping[str, type] = {
    **dict.fromkeys(("path", "observer", "status", "folder"), str),
    **dict.fromkeys(("size", "mtime_ns"), int),
    **dict.fromkeys(("outputs", "kinds"), list),
}
"""What every row has."""
TYPES: Mapping[str, tuple[type, ...]] = {
    "text": (str, list, type(None)),
    "float": (float, int, type(None)),
    "int": (int, type(None)),
}
"""What a column of the summary may hold; a list is of texts."""
CHECKED = {**COLUMNS, "kinds": "text"}
LARGEST = 1 << 63
"""Integers that every table takes are below this."""


class Journal:
    """An open journal; of its lines only their places are in memory."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.damaged = 0
        """Lines that are not rows and are left out."""
        self._places: dict[bytes, int] = {}
        with ExitStack() as stack:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                # unbuffered: what the disk refuses is not tried again behind our back
                self._out = stack.enter_context(self.path.open("ab", buffering=0))
                self._in = stack.enter_context(self.path.open("rb"))
                _lock(self._out, folder)
                self._end = self._index()
                self._out.truncate(self._end)
            except OSError as error:
                raise refused(self.path, error) from error
            self._files = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    def append(self, rows: Iterable[Row]) -> None:
        """Add rows, and wait until they are on the disk.

        Raises
        ------
        WriteError
            The system refuses to write; none of the rows is then there.
        """
        lines = [(_key(row), json.dumps(row).encode() + b"\n") for row in rows]
        try:
            _write(self._out, b"".join(line for _, line in lines))
        except OSError as error:
            with suppress(OSError):
                self._out.truncate(self._end)
            raise refused(self.path, error) from error
        for key, line in lines:
            self._places[key] = self._end
            self._end += len(line)

    def find(self, path: str, observer: str) -> Row | None:
        """Return the last row of a log and an observer."""
        place = self._places.get(_key({"path": path, "observer": observer}))
        return None if place is None else self._at(place)

    def rows(self) -> Iterator[Row]:
        """Yield the last row of each log and observer, in their order."""
        keys = []
        for place in self._places.values():
            row = self._at(place)
            keys.append((row["path"], row["observer"], place))
        for _, _, place in sorted(keys):
            yield self._at(place)

    def _at(self, place: int) -> Row:
        self._in.seek(place)
        row: Row = json.loads(self._in.readline())
        return row

    def _index(self) -> int:
        """Find the rows, and return where the last whole line ends."""
        end = 0
        for line in self._in:
            if not line.endswith(b"\n"):
                break
            row = parsed(line)
            if row is None:
                self.damaged += 1
            else:
                self._places[_key(row)] = end
            end += len(line)
        return end


def _write(file: FileIO, data: bytes) -> None:
    """Write all of it, to the disk."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]
    os.fsync(file.fileno())


def parsed(line: bytes) -> Row | None:
    """Return a row that was written as JSON; None where it is none."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return row if isinstance(row, dict) and _fits(row) else None


def _fits(row: Row) -> bool:
    """Whether a row, which may be another's or damaged, has what is done with rows."""
    return all(type(row.get(name)) is kind for name, kind in OF_ROWS.items()) and all(
        type(row.get(name)) in TYPES[kind] and _is_plain(row.get(name))
        for name, kind in CHECKED.items()
    )


def _is_plain(value: object) -> bool:
    if isinstance(value, list):
        return all(isinstance(each, str) for each in value)
    return not isinstance(value, int) or -LARGEST <= value < LARGEST


def _key(row: Mapping[str, Any]) -> bytes:
    """Return what stands for a log and an observer, of equal length for all."""
    text = f"{row['path']}\0{row['observer']}"
    return hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=16).digest()


def _lock(file: FileIO, folder: Path) -> None:
    """Keep other batches out of this output."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(1 << 40)  # far behind the end: this byte stands for the file
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError) as error:
        raise ConfigError(
            f"{folder}: another batch writes here. Wait for its end, or choose another --output."
        ) from error
