"""Kernels compiled once, by the first worker, where the others find them."""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import attest
from attest import config, observers, pipeline, simulation
from attest.batch import temporary
from attest.errors import AttestError

SCENARIO = "quadcopter"
"""A flight with all that a vehicle's log carries."""


def cache_folder(output: Path, usual: tuple[Path, ...] | None = None) -> str | None:
    """Return a folder for compiled code in the output, where it cannot be kept where it usually is.

    numba keeps it beside the source or in the user's cache folder, and in neither of a package and
    a home that are read-only.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return None
    if usual is None:
        cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        usual = (Path(attest.__file__).parent / "geometry", Path(cache))
    return None if any(map(_takes_files, usual)) else str(output.resolve() / ".kernels")


def _takes_files(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@contextmanager
def compilation(
    documents: Mapping[str, Mapping[str, Any]], kinds: tuple[str, ...]
) -> Iterator[Callable[[], None]]:
    """Give what compiles all kernels of the observers; nothing where there is no room for that."""
    with ExitStack() as stack:
        try:
            flight = stack.enter_context(temporary.folder()) / "flight.csv"
            simulation.write(flight, simulation.simulate(SCENARIO))
        except (OSError, AttestError):
            yield _nothing
        else:
            yield partial(_compile, flight, documents, kinds)


def _nothing() -> None:
    """Compile when the first log asks for it."""


def _compile(
    flight: Path, documents: Mapping[str, Mapping[str, Any]], kinds: tuple[str, ...]
) -> None:
    """Run every observer over the flight, and write what it leaves behind beside it.

    Later it is not to be compiled, nor its libraries imported, in the time of a log.
    """
    for label, document in documents.items():
        model = observers.get(str(document["observer"])).config
        usual = {"input": config.Input(), "evaluation": config.Evaluation()}
        with suppress(Exception):  # it needs what this flight has not; its logs will tell
            configuration = config.validate(model, document, label).model_copy(update=usual)
            result = pipeline.run(flight, configuration)
            pipeline.write([result], flight.parent / str(os.getpid()), kinds=kinds)
