"""The logs that are named, the largest first, each with a folder of its own for its results."""

import glob
import hashlib
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from attest import readers
from attest.batch import urls
from attest.batch.listing import SUFFIXES, Stamp, listed
from attest.config import Csv
from attest.errors import ConfigError, ReadError

OWN = frozenset(
    {"journal.jsonl", "summary.csv", "summary.parquet", "index.html", "fleet.html", "fleet.csv"}
    | {".kernels", ".committed"}
)
"""Names in the output that are not for the results of a log."""


@dataclass(frozen=True, slots=True)
class Log:
    """A log that is to be run."""

    path: str
    """Absolute, or a URL."""
    size: int
    """Bytes; 0 where the system does not tell."""
    mtime_ns: int
    folder: str
    """Of its results, below the output."""
    etag: str = ""
    """What an object store tells of its content."""


@dataclass(frozen=True, slots=True)
class Found:
    """What the names stand for."""

    logs: tuple[Log, ...]
    """The largest first."""
    left_out: int
    """Files that are no logs or that `attest` wrote, and links to folders."""
    closed: tuple[str, ...] = ()
    """Folders that the system does not let us look into."""


def names_in(data: bytes) -> list[str]:
    """Return the paths of a list: one a line, or with a zero byte after each."""
    separator = b"\0" if b"\0" in data else b"\n"
    each = (name.removesuffix(b"\r") for name in data.split(separator))
    return [os.fsdecode(name) for name in each if name]


def find(
    named: Sequence[str],
    output: Path,
    csv: Csv | None = None,
    results: str | None = None,
    listed: Collection[str] = (),
) -> Found:
    """Return the logs that files, folders, patterns and URLs stand for.

    Neither the output nor the URL of the results is looked into. Of names that a list has, one that
    fits nothing is a log that is gone, and no pattern.

    Raises
    ------
    ReadError
        There is none.
    ConfigError
        A name is empty, which would stand for the working folder, or a URL that is not known.
    """
    if "" in named:
        raise ConfigError("an empty name for a log. Name a log, or a folder with logs.")
    walk = _Walk(output, csv, results, frozenset(listed))
    paths, roots = list[str](), set[str]()
    for name in map(urls.checked, named):
        root, inside = walk.below(name)
        paths += inside
        roots.add(root)
    if not paths:
        if walk.closed:
            raise ReadError(
                f"{walk.closed[0]}: cannot look into this folder. Ask for the right to read it."
            )
        what = "no log"
        if csv is not None and csv.maps:
            what += ", and no CSV with the columns of input.csv,"
        where = ", ".join(named[:3])
        raise ReadError(f"{where}: {what} in this folder. Name a log, or a folder with logs.")
    paths = list(dict.fromkeys(paths))
    folders = _folders(paths, common(roots))
    logs = [walk.log(path, folder) for path, folder in zip(paths, folders, strict=True)]
    logs.sort(key=lambda log: (-log.size, log.path))
    return Found(tuple(logs), walk.left_out, tuple(walk.closed))


class _Walk:
    """A search through folders, which counts what it leaves out."""

    def __init__(
        self, output: Path, csv: Csv | None, results: str | None, listed: frozenset[str]
    ) -> None:
        self.left_out = 0
        self.closed: list[str] = []
        self._list = listed
        self._output, self._csv, self._results = output.resolve(), csv, results
        self._stamps: dict[str, Stamp] = {}

    def log(self, path: str, folder: str) -> Log:
        """Return a log that was found."""
        found = self._stamps.get(path) or Stamp(*stamp(path))
        return Log(path, found.size, found.mtime_ns, folder, found.etag)

    def below(self, name: str) -> tuple[str, list[str]]:
        """Return the folder that a name's logs are below, and the logs."""
        if urls.is_url(name):
            found = listed(name, self._csv, self._results, literal=name in self._list)
            self.left_out += found.left_out
            self._stamps |= found.logs
            return found.root, list(found.logs)
        if not os.path.lexists(name) and glob.has_magic(name):
            fits = sorted(glob.glob(name, recursive=True))  # noqa: PTH207  may be absolute
            if fits:
                return str(_absolute(_fixed(name))), list(self._fitting(fits))
            if name not in self._list:
                raise ReadError(f"{name}: nothing fits this pattern. Name a log, or a folder.")
        path = _absolute(Path(name))
        if not _holds(path.is_dir) or readers.is_log(path):
            return str(path.parent), [str(path)]
        return str(path), list(self._logs(str(path)))

    def _fitting(self, names: Sequence[str]) -> Iterator[str]:
        """Yield the logs that names of a pattern stand for."""
        for name in names:
            if readers.is_result(Path(name)):
                self.left_out += 1
            else:
                yield from self.below(name)[1]

    def _logs(self, folder: str) -> Iterator[str]:
        """Yield the logs in a folder, without following links to folders, which may lead back."""
        folders = [folder]
        while folders:
            here = folders.pop()
            inner = []
            for entry in self._entries(here):
                if entry.name.startswith("."):
                    continue
                if not _holds(entry.is_dir):
                    yield from self._file(entry)
                elif entry.is_symlink():
                    self.left_out += 1
                elif readers.is_log(Path(entry.path)):
                    yield entry.path
                elif Path(entry.path).resolve() != self._output:
                    inner.append(entry.path)
            folders += reversed(inner)

    def _entries(self, folder: str) -> list[os.DirEntry[str]]:
        try:
            return _listed(folder)
        except OSError:
            self.closed.append(folder)
            return []

    def _file(self, entry: os.DirEntry[str]) -> Iterator[str]:
        path = Path(entry.path)
        named, there = path.suffix.lower() in SUFFIXES, _holds(entry.is_file)
        gone = entry.is_symlink() and not there  # the disk that it leads to, perhaps
        log = there and not readers.is_result(path) and (named or readers.is_log(path, self._csv))
        if log or (gone and named):
            yield entry.path
        else:
            self.left_out += 1


def _holds(question: Callable[[], bool]) -> bool:
    """Ask the system about a file; a link that leads to itself is nothing."""
    try:
        return question()
    except OSError:
        return False


def _listed(folder: str) -> list[os.DirEntry[str]]:
    """Return what is in a folder, in name order."""
    with os.scandir(folder) as entries:
        return sorted(entries, key=lambda entry: entry.name)


def _absolute(path: Path) -> Path:
    """Return the path from the root, without steps up, which could lead out of the output."""
    return path.resolve() if ".." in path.parts else path.absolute()


def _fixed(pattern: str) -> Path:
    """Return the folder at the beginning of a pattern."""
    parts = Path(pattern).parts
    first = next(i for i, part in enumerate(parts) if glob.has_magic(part))
    return Path(*parts[:first])


def common(roots: Collection[str]) -> str | None:
    """Return the deepest folder that all of them are in; None of none, or several drives."""
    try:
        return os.path.commonpath(roots)
    except ValueError:
        return None


def stamp(path: str) -> tuple[int, int]:
    """Return size and time of change of a file, or of a folder's files together; 0 where gone."""
    try:
        if Path(path).is_dir():
            each = [entry.stat() for entry in _listed(path) if entry.is_file()]
            return sum(s.st_size for s in each), max((s.st_mtime_ns for s in each), default=0)
        found = Path(path).stat()
    except (OSError, ValueError):
        return 0, 0
    return found.st_size, found.st_mtime_ns


def _folders(paths: Sequence[str], base: str | None) -> list[str]:
    """Return a folder for each log: its path below the base, without the suffix where one has it.

    Where two would share a folder, both keep their suffix; where that is not enough, or the name is
    not free, or would lead out of the output, a digest of the path tells them apart. Letters of
    either case are the same here, as they are to some file systems.
    """
    short = [_below(path, base, short=True) for path in paths]
    long = [_below(path, base, short=False) for path in paths]
    shared = Counter(name.casefold() for name in short)
    names = [a if shared[a.casefold()] == 1 else b for a, b in zip(short, long, strict=True)]
    taken = Counter(name.casefold() for name in names)
    return [
        name if taken[name.casefold()] == 1 and _is_free(name) else marked(_kept(name), path)
        for name, path in zip(names, paths, strict=True)
    ]


def _is_free(folder: str) -> bool:
    """Whether a folder is below the output, and in none that is for something else."""
    parts = Path(folder).parts
    return ".." not in parts and parts[0].casefold() not in OWN


def _kept(folder: str) -> str:
    """Return what of a folder may be kept where it is not free: the end of it, if it is not."""
    return folder if _is_free(folder) or len(Path(folder).parts) == 1 else Path(folder).name


def _below(path: str, base: str | None, *, short: bool) -> str:
    name = (Path(path).stem if short else Path(path).name).strip(".") or "log"
    if base is None:
        return name
    return str(Path(os.path.relpath(Path(path).parent, base), name))


def marked(folder: str, path: str) -> str:
    """Return a folder that no other log's results are in."""
    return f"{folder}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"
