"""The summary as JSON, the contract for scripts."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from attest.files import replacing


def write_json(path: Path, document: Mapping[str, object]) -> None:
    """Write a summary.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    with replacing(path) as part:
        text = to_json(document, indent=2) + "\n"
        # a lone surrogate, from a file name that is not UTF-8, becomes its JSON escape
        part.write_bytes(text.encode("utf-8", "backslashreplace"))


def to_json(value: object, indent: int | None = None) -> str:
    """Spell a value as JSON, keys sorted, what is not a finite number as null."""
    return json.dumps(
        plain(value), indent=indent, sort_keys=True, ensure_ascii=False, allow_nan=False
    )


def plain(value: object) -> object:
    """Turn JSON-like mappings, sequences and numpy scalars to JSON's own types."""
    match value:
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case np.generic() | np.ndarray():
            return plain(value.tolist())
        case float():
            return value if math.isfinite(value) else None
        case None | bool() | int() | str():
            return value
        case Iterable():
            return [plain(item) for item in value]
        case _:
            return str(value)


def clean(text: str) -> str:
    """Replace what UTF-8 cannot hold: lone surrogates, from file names in other encodings."""
    return text.encode("utf-8", "replace").decode("utf-8")
