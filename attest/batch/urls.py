"""URLs of logs and results, and what stands behind them; what goes wrong there is one line."""

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import SplitResult, urlsplit

from attest.errors import AttestError, ConfigError, ReadError

EXTRA = "pip install 'attest[cluster]'"
PROTOCOLS = ("s3", "gs", "sftp", "file")
PATIENCE_S = 10.0
"""For a connection over SSH."""


@dataclass(frozen=True, slots=True)
class Place:
    """A file system of fsspec, and a path as it takes it."""

    fs: Any
    path: str
    protocol: str

    def below(self, *names: str) -> str:
        """Return the path of what lies in it."""
        return "/".join((self.path.rstrip("/"), *names))


def is_url(name: str) -> bool:
    """Whether a name is a URL, and no path."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*://", name) is not None


def checked(name: str) -> str:
    """Return a URL as it is, a ``file://`` URL as the path that it names, a path as it is.

    Raises
    ------
    ConfigError
        It is of another protocol, or carries a password, which everybody would see.
    """
    if not is_url(name):
        return name
    protocol, rest = _parts(name)
    if protocol not in PROTOCOLS:
        known = ", ".join(f"{each}://" for each in PROTOCOLS)
        raise ConfigError(f"{shown(name)}: unknown protocol. Known are {known}.")
    if protocol == "file":
        return rest
    if not rest.partition("/")[0]:
        raise ConfigError(f"{name}: names no {'host' if protocol == 'sftp' else 'bucket'}.")
    if protocol == "sftp" and _authority(name).password is not None:
        raise ConfigError(
            f"{shown(name)}: a password in a URL is seen by others. Use a key, or set "
            "FSSPEC_SFTP_PASSWORD where it runs."
        )
    return name


def shown(url: str) -> str:
    """Return a URL without its password."""
    return re.sub(r"^([^:]*://[^/@]*?):[^/]*@", r"\1:***@", url)


def root(url: str) -> str:
    """Return what stands before the paths of a URL's file system."""
    protocol, rest = _parts(url)
    return f"{protocol}://{rest.partition('/')[0]}" if protocol == "sftp" else f"{protocol}://"


@contextmanager
def opened(url: str) -> Iterator[Place]:
    """Give what stands behind a URL; connections of SSH, which may fall asleep, are closed.

    Raises
    ------
    ConfigError
        A library is missing.
    ReadError
        There is no connection.
    """
    protocol, rest = _parts(url)
    with telling(url):
        fs = _file_system(protocol, url)
    try:
        path = f"/{rest.partition('/')[2]}" if protocol == "sftp" else rest
        yield Place(fs, path, protocol)
    finally:
        if protocol == "sftp":
            fs.client.close()


def _file_system(protocol: str, url: str) -> Any:
    import fsspec

    if protocol == "sftp":
        found = _authority(url)
        named = {"username": found.username, "port": found.port}
        return fsspec.filesystem(
            "sftp",
            host=found.hostname,
            timeout=PATIENCE_S,
            skip_instance_cache=True,
            **{key: value for key, value in named.items() if value is not None},
        )
    if protocol == "file":
        return fsspec.filesystem("file", auto_mkdir=True)
    return fsspec.filesystem(protocol, use_listings_cache=False)  # others write there too


def _parts(url: str) -> tuple[str, str]:
    protocol, _, rest = url.partition("://")
    return protocol.lower(), rest


def _authority(url: str) -> SplitResult:
    return urlsplit("//" + _parts(url)[1].partition("/")[0])


@contextmanager
def telling(url: str, kind: type[AttestError] = ReadError) -> Iterator[None]:
    """Tell in one line what goes wrong behind a URL; what libraries raise has no common base.

    Raises
    ------
    ConfigError
        A library is missing.
    AttestError
        All else, as the kind of error that is asked for.
    """
    try:
        yield
    except AttestError:
        raise
    except ImportError as error:
        raise ConfigError(f"{shown(url)}: {_short(error)}: {EXTRA}.") from error
    except FileNotFoundError as error:
        raise kind(f"{shown(url)}: no such bucket, folder or object. Check the URL.") from error
    except MemoryError:
        raise
    except Exception as error:
        if getattr(error, "errno", None) == errno.ENOSPC:
            what = "no space left. Free some where it runs, or set TMPDIR to a larger folder"
        elif isinstance(error, PermissionError) or "Credential" in type(error).__name__:
            what = f"access is refused: {_short(error)}. Check the credentials where it runs"
        elif "Authentication" in type(error).__name__:
            what = f"access is refused: {_short(error)}. Check the keys where it runs"
        else:
            what = f"{_short(error)}. Check the URL, its server and the connection"
        raise kind(f"{shown(url)}: {what}.") from error


def _short(error: Exception) -> str:
    return (
        " ".join(str(getattr(error, "strerror", None) or error).split())[:300].rstrip(".")
        or type(error).__name__
    )
