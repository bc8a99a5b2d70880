"""The logs below a URL, told by content as in a folder: the first bytes of other names are read."""

import hashlib
import os
import re
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from glob import has_magic
from itertools import accumulate
from pathlib import Path
from typing import Any

from attest import readers
from attest.batch import urls
from attest.batch.urls import Place
from attest.config import Csv
from attest.errors import ReadError
from attest.readers.results import begins_result

SUFFIXES = frozenset({".tlog", ".bin", ".ulg", ".bag", ".mcap", ".db3"})
"""Names that logs alone have: such a file in a folder is one of them even if it is not readable."""
OF_FOLDERS = frozenset({"metadata.yaml", "Gyroscope.csv"})
"""Files that a folder has which is one log."""
OF_RESULTS = re.compile(r"\.[0-9a-f]{8}\.[0-9a-f]{8}/[^/]+\.mcap$")
"""Where a batch puts results at a URL."""
AT_ONCE = 32
"""Objects whose first bytes are asked for together."""

Info = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Stamp:
    """What tells one content of a log from another without reading it."""

    size: int = 0
    mtime_ns: int = 0
    """0 where there is an etag, which does not change with the content's time alone."""
    etag: str = ""


def stamp_of(infos: Sequence[Info]) -> Stamp:
    """Return the stamp of an object, or of the files of a folder together."""
    if len(infos) == 1:
        return _stamp(infos[0])
    each = {_base(info["name"]): _stamp(info) for info in infos}
    text = repr(sorted((name, one.size, one.mtime_ns, one.etag) for name, one in each.items()))
    size = sum(one.size for one in each.values())
    return Stamp(size, 0, hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:32])


def contents(place: Place) -> list[Info]:
    """Return what is told of an object, or of the files in a folder that is a log."""
    info = place.fs.info(place.path)
    if info["type"] == "file":
        return [info]
    inside = place.fs.ls(place.path, detail=True)
    return [info for info in inside if info["type"] == "file"]


def _stamp(info: Info) -> Stamp:
    size = int(info.get("size") or 0)
    etag = str(info.get("ETag") or info.get("etag") or "").strip('"')
    changed = info.get("mtime")
    if etag or changed is None:
        return Stamp(size, 0, etag)
    seconds = changed.timestamp() if isinstance(changed, datetime) else float(changed)
    return Stamp(size, round(seconds * 1e9))


@dataclass(frozen=True, slots=True)
class Listed:
    """What a URL stands for."""

    root: str
    """The folder that its logs are below."""
    logs: Mapping[str, Stamp]
    left_out: int


def listed(url: str, csv: Csv | None, closed: str | None, *, literal: bool = False) -> Listed:
    """Return the logs that a URL stands for; what is not there is a log that cannot be read.

    A ``literal`` one that fits nothing is such a log as well.

    Raises
    ------
    ReadError
        There is no access, or nothing fits a pattern.
    """
    with urls.opened(url) as place, urls.telling(url):
        fs, path = place.fs, place.path
        if has_magic(path) and not fs.exists(path):
            fitting = _matching(place, urls.root(url), csv, closed)
            if fitting is None and not literal:
                raise ReadError(f"{url}: nothing fits this pattern. Name a log, or a folder.")
            return fitting or Listed(_parent(url), {url: Stamp()}, 0)
        root = urls.root(url)
        if not path.endswith("/") and fs.isfile(path):
            return Listed(_parent(root + path), {url: stamp_of([fs.info(path)])}, 0)
        found = _found(place)
        if found is None:
            return Listed(_parent(url), {url: Stamp()}, 0)
        folder = url.rstrip("/")
        logs, left_out = _logs(_Below(place, path, csv, root, closed), found)
        is_log = logs.keys() == {folder}
        return Listed(_parent(folder) if is_log else folder, logs, left_out)


def _found(place: Place) -> dict[str, Info] | None:
    """Return all files below a path; None where there is nothing of this name."""
    try:
        found: dict[str, Info] = place.fs.find(place.path, detail=True)
    except FileNotFoundError:
        return None
    return found if found or place.fs.isdir(place.path) else None


def _matching(place: Place, root: str, csv: Csv | None, closed: str | None) -> Listed | None:
    """Return the logs that fit a pattern, and those in the folders that do; None where none do."""
    found: dict[str, Info] = {}
    for path, info in place.fs.glob(place.path, detail=True).items():
        inside = place.fs.find(path, detail=True) if info["type"] == "directory" else {path: info}
        found |= inside
    if not found:
        return None
    fixed = place.path[: next(i for i, letter in enumerate(place.path) if letter in "*?[")]
    base = fixed.rpartition("/")[0]
    logs, left_out = _logs(_Below(place, base, csv, root, closed), found)
    return Listed(root + base, logs, left_out)


@dataclass(frozen=True, slots=True)
class _Below:
    """Where is looked for logs, and how."""

    place: Place
    path: str
    csv: Csv | None
    root: str
    """What makes a URL of a path."""
    closed: str | None
    """A URL that is not looked into."""

    def hides(self, path: str) -> bool:
        """Whether a file is hidden, or below what is closed."""
        parts = path.removeprefix(self.path.rstrip("/")).split("/")
        if self.closed and f"{self.root}{path}".startswith(self.closed.rstrip("/") + "/"):
            return True
        return any(part.startswith(".") and part.strip(".") for part in parts)


def _logs(where: _Below, found: Mapping[str, Info]) -> tuple[dict[str, Stamp], int]:
    """Choose the logs of all that was found, and count what is left out."""
    files = {
        path: info
        for path, info in found.items()
        if info["type"] == "file" and not where.hides(path)
    }
    kept = {path: info for path, info in files.items() if _is_path(path)}
    left_out = len(files) - len(kept)
    folders = dict(_folder_logs(where, kept))
    alone = {path: info for path, info in kept.items() if not _above(path) & folders.keys()}
    ours = [path for path in alone if OF_RESULTS.search(path)]
    for path, head in _heads(where.place, ours):
        if begins_result(head):
            del alone[path]
            left_out += 1
    doubtful = [path for path in alone if Path(path).suffix.lower() not in SUFFIXES]
    known = alone.keys() - set(doubtful) | set(_recognised(where, doubtful))
    logs = {where.root + path: stamp_of(infos) for path, infos in folders.items()}
    logs |= {where.root + path: stamp_of([alone[path]]) for path in known}
    return logs, left_out + len(alone) - len(known)


def _above(path: str) -> set[str]:
    """Return the folders that a file is in."""
    return set(accumulate(path.split("/")[:-1], lambda above, part: f"{above}/{part}"))


def _is_path(path: str) -> bool:
    """Whether a key can be a path below a folder, which does not lead out of it."""
    parts = path.removeprefix("/").split("/")
    return not (any(part in {"", ".", ".."} for part in parts) or "\0" in path) and (
        os.name == "posix" or not set(path) & set('\\:*?"<>|')
    )


def _folder_logs(where: _Below, files: Mapping[str, Info]) -> Iterator[tuple[str, list[Info]]]:
    """Yield the folders that are one log, and their files."""
    inside: dict[str, list[Info]] = defaultdict(list)
    for path, info in files.items():
        inside[_parent(path)].append(info)
    found: set[str] = set()
    for folder, infos in sorted(inside.items()):
        named = OF_FOLDERS & {_base(info["name"]) for info in infos}
        if named and not _above(folder) & found and _is_folder_log(where, infos):
            found.add(folder)
            yield folder, infos


def _is_folder_log(where: _Below, infos: Sequence[Info]) -> bool:
    """Whether a reader knows the folder by the first bytes of its files."""
    paths = [str(info["name"]) for info in infos]
    telling = [
        path
        for path in paths
        if _base(path) in OF_FOLDERS or Path(path).suffix.lower() in {".zstd", *SUFFIXES}
    ]
    with tempfile.TemporaryDirectory(prefix="attest-") as folder:
        for path, head in _heads(where.place, telling):
            Path(folder, _base(path)).write_bytes(head)
        return readers.is_log(Path(folder))


def _recognised(where: _Below, paths: Sequence[str]) -> Iterator[str]:
    """Yield those that a reader knows by their first bytes."""
    with tempfile.TemporaryDirectory(prefix="attest-") as folder:
        for path, head in _heads(where.place, paths):
            file = Path(folder, "head" + Path(path).suffix[:16])
            file.write_bytes(head)
            if readers.is_log(file, where.csv):
                yield path
            file.unlink()


def _heads(place: Place, paths: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    """Yield the first bytes of files; what cannot be read has none."""
    for first in range(0, len(paths), AT_ONCE):
        some = list(paths[first : first + AT_ONCE])
        ends = [readers.HEAD] * len(some)
        heads = place.fs.cat_ranges(some, [0] * len(some), ends, on_error="return")
        for path, head in zip(some, heads, strict=True):
            yield path, head if isinstance(head, bytes) else b""


def _parent(path: str) -> str:
    return path.rpartition("/")[0]


def _base(path: str) -> str:
    return str(path).rpartition("/")[2]
