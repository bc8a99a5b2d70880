"""The observers, by name; each is imported when asked for, so that ``--help`` waits for none."""

from importlib import import_module
from typing import TYPE_CHECKING

from attest.errors import ConfigError

if TYPE_CHECKING:
    from attest.observers.observer import Observer

NAMES = (
    "fts",
    "vae",
    "game",
    "cgo",
    "eso",
    "relative_fts",
    "mekf",
    "triad",
    "wahba",
    "integration",
    "vqf",
    "smoother",
)


def get(name: str) -> "Observer":
    """Import an observer.

    Raises
    ------
    ConfigError
        There is none of this name.
    """
    if name not in NAMES:
        raise ConfigError(f"unknown observer {name!r}. Choose one of: {', '.join(NAMES)}.")
    observer: Observer = import_module(f"attest.observers.{name}").OBSERVER
    return observer
