"""A log where it can be read: a URL's is brought into a temporary folder, under its own name."""

import hashlib
import os
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from attest.batch import urls
from attest.batch.listing import Info, Stamp, contents, stamp_of
from attest.batch.urls import Place
from attest.errors import ReadError, WriteError

LONGEST = 200
"""Bytes of a name that any file system takes."""


class Source:
    """A log that is brought when it is asked for, and removed at the end."""

    def __init__(self, log: str, stamp: Stamp) -> None:
        self._log, self._stamp = log, stamp
        self._stack = ExitStack()
        self._path = None if urls.is_url(log) else Path(log)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def path(self) -> Path:
        """Return where the log can be read.

        Raises
        ------
        ReadError
            There is none, or no access to it, or it is not what was listed.
        WriteError
            There is no room for it.
        """
        if self._path is None:
            try:
                made = tempfile.TemporaryDirectory(prefix="log-", ignore_cleanup_errors=True)
                self._path = _brought(self._log, Path(self._stack.enter_context(made)), self._stamp)
            except OSError as error:
                raise WriteError(
                    f"{self._log}: no room in {tempfile.gettempdir()}: {error.strerror}. Set "
                    "TMPDIR to a larger folder."
                ) from error
        return self._path

    def named(self, text: str) -> str:
        """Return a text in which the log has the name that it is known by."""
        return text if self._path is None else text.replace(str(self._path), self._log)

    def told(self, summary: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return a summary in which the log's path is the URL, where it has one."""
        if not urls.is_url(self._log):
            return summary
        return {**summary, "log": summary["log"] | {"path": self._log}}


def _brought(url: str, folder: Path, stamp: Stamp) -> Path:
    """Bring a log, or the files of a folder that is one, and return where it is."""
    with urls.opened(url) as place, urls.telling(url):
        path = folder / _name(url)
        files = contents(place)
        if len(files) == 1 and files[0]["name"].rstrip("/") == place.path.rstrip("/"):
            _bring(place, files[0], path)
        else:
            path.mkdir()
            for each in files:
                _bring(place, each, path / _name(each["name"]))
        if stamp_of(contents(place)) != stamp:
            raise ReadError(f"{url}: changed since it was listed. Run it again.")
        return path


def _bring(place: Place, file: Info, path: Path) -> None:
    """Bring a file; it is streamed, so that its size is no matter of memory."""
    place.fs.get_file(file["name"], str(path))


def _name(url: str) -> str:
    name = url.rstrip("/").rpartition("/")[2]
    if len(os.fsencode(name)) <= LONGEST:
        return name
    digest = hashlib.sha256(os.fsencode(name)).hexdigest()[:16]
    return digest + Path(name).suffix[:16]
