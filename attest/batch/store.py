"""Results at a URL: each is there as a whole, or not at all, whoever else works at it.

Every attempt at a log and an observer puts its files into a folder of its own. What makes them the
result is a single small object below ``.committed``, the row: it is put only if there is none, on
the condition of the object store, or by a rename that replaces nothing. Who comes second removes
what it has put, and takes the first one's row. Nobody looks at files that no row names.
"""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Self
from uuid import uuid4

import attest
from attest.batch import urls
from attest.batch.journal import parsed
from attest.batch.rows import Row
from attest.batch.urls import Place
from attest.errors import WriteError

if TYPE_CHECKING:
    from attest.batch.task import Task

COMMITTED = ".committed"
ABOUT = b"The rows of attest batch that are the results; what is beside them and in none is not.\n"
OBJECTS = ("s3", "gs")
"""Protocols of stores without folders, that put an object only if there is none."""


class Store:
    """The results of a task at a URL."""

    def __init__(self, task: "Task") -> None:
        self._task = task
        self._place: Place | None = None
        self._folder = ""
        """Of the attempt that is under way, below the output; none where it is over."""
        self._rows: dict[str, str] = {}
        """Where the row of an observer is to be, by label."""
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.discard()
        self._stack.close()

    def found(self, label: str) -> Row | None:
        """Return the row of an observer that an earlier attempt committed, if all of it is there.

        Raises
        ------
        WriteError
            The server refuses.
        """
        begins = f"{_above(self._task, label)}/{_key(self._task, label)[:32]}"
        row_of_it = re.compile(re.escape(begins) + r"\.(\d{1,9})\.json")
        taken = [-1]
        with urls.telling(self._task.output, WriteError):
            for path in _files(self._at(), begins.rpartition("/")[0]):
                if match := row_of_it.fullmatch(path):
                    taken.append(int(match[1]))
                    row = self._read(path)
                    if row is not None and self._is_whole(row):
                        return row
        self._rows[label] = f"{begins}.{max(taken) + 1}.json"
        return None

    def _is_whole(self, row: Row) -> bool:
        """Whether nobody has removed a file of a result."""
        place = self._at()
        return all(place.fs.exists(place.below(row["folder"], name)) for name in row["outputs"])

    def folder(self, label: str) -> Path:
        """Return a folder of this machine to write the results in, for a new attempt."""
        name = f"{label}.{_key(self._task, label)[:8]}.{uuid4().hex[:8]}"
        self._folder = f"{Path(self._task.folder).as_posix()}/{name}"
        if self._task.output.startswith("file://"):
            return Path(self._at().below(self._folder))
        return Path(self._stack.enter_context(TemporaryDirectory(prefix="results-")))

    def put(self, written: Sequence[Path]) -> str:
        """Put files of an attempt where nobody looks yet, and return the folder that they are in.

        Raises
        ------
        WriteError
            The server refuses.
        """
        with urls.telling(self._task.output, WriteError):
            place = self._at()
            if place.protocol != "file":  # else they are there
                _make(place, place.below(self._folder))
                for path in written:
                    place.fs.put_file(str(path), place.below(self._folder, path.name))
                    path.unlink()
        return self._folder

    def commit(self, label: str, row: Row) -> Row:
        """Make an attempt the result, and return its row; or the row of another that was faster.

        Raises
        ------
        WriteError
            The server refuses.
        """
        path = self._rows[label]
        with urls.telling(self._task.output, WriteError):
            try:
                _put_new(self._at(), path, json.dumps(row).encode())
            except OSError:  # each server tells in its way that there is one
                first = self._read(path)
                if first is None:
                    raise
                if first["folder"] != row["folder"]:  # else our own: the answer to it was lost
                    self.discard()
                    return first
            self._folder = ""
            self._tidy(path, row["folder"])
        return row

    def discard(self) -> None:
        """Remove what an attempt has put that will not be the result."""
        if self._folder:
            with suppress(Exception):  # no row names it
                _remove(self._at(), _files(self._at(), self._folder))
        self._folder = ""

    def _tidy(self, kept: str, ours: str) -> None:
        """Remove results that this one replaces, and what attempts that died left of this one."""
        with suppress(Exception):  # they are in nobody's way
            place = self._at()
            for path in _files(place, kept.rpartition("/")[0]):
                if path != kept and path.endswith(".json"):
                    old = self._read(path)
                    place.fs.rm_file(place.below(path))
                    if old is not None and old["folder"] != ours:
                        _remove(place, [f"{old['folder']}/{name}" for name in old["outputs"]])
            alike = ours.rpartition(".")[0] + "."
            others = _files_of(place, alike)
            _remove(place, [path for path in others if not path.startswith(f"{ours}/")])

    def _read(self, path: str) -> Row | None:
        """Return a row; None where there is none, or one that is torn or not ours."""
        try:
            row = parsed(self._at().fs.cat_file(self._at().below(path)))
        except FileNotFoundError:
            return None
        if row is None:
            return None
        inside = [row["folder"], *row["outputs"]]
        return None if any(".." in name.split("/") for name in inside) else row

    def _at(self) -> Place:
        if self._place is None:
            self._place = self._stack.enter_context(urls.opened(self._task.output))
        return self._place


def begin(url: str) -> None:
    """Put a note into an output, which tells whether we may before any log is run.

    Raises
    ------
    WriteError
        The server refuses, or there is no such bucket.
    """
    with urls.opened(url) as place, urls.telling(url, WriteError):
        _make(place, place.below(COMMITTED))
        place.fs.pipe_file(place.below(COMMITTED, "about.txt"), ABOUT)


def there(url: str) -> frozenset[str]:
    """Return the paths of all files below the URL of an output."""
    with urls.opened(url) as place, urls.telling(url):
        return frozenset(_files(place, ""))


def publish(paths: Iterable[Path], url: str) -> None:
    """Put files into the output, each as a whole.

    Raises
    ------
    WriteError
        The server refuses.
    """
    with urls.opened(url) as place, urls.telling(url, WriteError):
        for path in paths:
            target = place.below(path.name)
            if place.protocol in OBJECTS:  # which are whole or not there
                place.fs.put_file(str(path), target)
                continue
            _make(place, place.path)
            part = place.below(f".{path.name}.{uuid4().hex[:8]}.part")
            place.fs.put_file(str(path), part)
            place.fs.ftp.posix_rename(part, target)


def _key(task: "Task", label: str) -> str:
    """Return what two attempts at the same have in common."""
    what = (
        *(task.log, task.size, task.mtime_ns, task.etag, label, task.digests[label]),
        *(attest.__version__, sorted(task.kinds), task.again),
    )
    return hashlib.sha256(json.dumps(what).encode()).hexdigest()


def _above(task: "Task", label: str) -> str:
    """Return the folder of the rows of a log and an observer, whatever they were made with."""
    who = hashlib.sha256(json.dumps((task.log, label)).encode()).hexdigest()[:32]
    return f"{COMMITTED}/{who}"


def _put_new(place: Place, path: str, data: bytes) -> None:
    """Put an object as a whole, only if there is none; else this is an OSError."""
    target = place.below(path)
    if place.protocol in OBJECTS:
        place.fs.pipe_file(target, data, mode="create")
        return
    part = f"{target}.{uuid4().hex[:8]}.part"
    _make(place, part.rpartition("/")[0])
    try:
        with place.fs.open(part, "wb") as file:
            file.write(data)
            if place.protocol == "file":
                file.flush()
                os.fsync(file.fileno())
        if place.protocol == "sftp":
            place.fs.ftp.rename(part, target)  # of SFTP itself: it refuses to replace
        else:
            os.link(part, target)
    finally:
        with suppress(OSError):  # renamed
            place.fs.rm_file(part)


def _make(place: Place, folder: str) -> None:
    """Make a folder, which others may be making too."""
    if place.protocol in OBJECTS:
        return
    for _ in range(3):
        with suppress(OSError):
            place.fs.makedirs(folder, exist_ok=True)
            return
    place.fs.makedirs(folder, exist_ok=True)


def _files(place: Place, folder: str) -> list[str]:
    """Return the paths of all files in a folder of the output and below, from the output on."""
    try:
        found = place.fs.find(place.below(folder) if folder else place.path)
    except FileNotFoundError:
        return []
    base = place.path.rstrip("/") + "/"
    return [path.removeprefix(base) for path in found]


def _files_of(place: Place, alike: str) -> list[str]:
    """Return the paths of the files in all folders whose paths begin alike."""
    folder, _, name = alike.rpartition("/")
    where = place.below(folder)
    if place.protocol in OBJECTS:
        found = place.fs.find(where, prefix=name)
    else:
        inside = place.fs.ls(where, detail=False)
        fit = [path for path in inside if path.rpartition("/")[2].startswith(name)]
        found = [file for path in fit for file in place.fs.find(path)]
    base = place.path.rstrip("/") + "/"
    return [path.removeprefix(base) for path in found]


def _remove(place: Place, paths: Iterable[str]) -> None:
    """Remove files of the output that need not be there, and the folders that they leave empty."""
    folders = set()
    for path in paths:
        with suppress(Exception):  # gone, or not ours to remove: no row names it
            place.fs.rm_file(place.below(path))
        folders.add(path.rpartition("/")[0])
    for folder in () if place.protocol in OBJECTS else folders:
        with suppress(Exception):  # others are in it
            place.fs.rmdir(place.below(folder))
