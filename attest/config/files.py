"""Configurations as YAML: found by name, read, overridden, and written out whole."""

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import yaml

from attest.config.settings import Configuration
from attest.errors import ConfigError

LARGEST_FILE = 1 << 20
"""Bytes; no configuration is larger, and YAML takes memory many times its size."""


_NOT_YAML = (yaml.YAMLError, ValueError, LookupError, AttributeError, TypeError, RecursionError)
"""What PyYAML raises over text that is no YAML, or that is tagged as what it is not."""


class _Loader(yaml.SafeLoader):
    """Plain values without aliases: a dozen lines of them can stand for billions of values."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not taken")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [getattr(key, "value", None) for key, _ in node.value]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise yaml.YAMLError(f"the key {twice!r} stands twice")
        return super().construct_mapping(node, deep)


# YAML 1.1 takes 1e-3 for text, since it has no point
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)


def folder() -> Path:
    """Return where the shipped configurations are: in the package, or beside it in a checkout."""
    packaged = Path(__file__).parents[1] / "configs"
    return packaged if packaged.is_dir() else Path(__file__).parents[2] / "configs"


def shipped() -> list[str]:
    """Return the names of the shipped configurations, such as ``fts`` and ``paper/fts``."""
    return sorted(
        path.relative_to(folder()).with_suffix("").as_posix() for path in folder().rglob("*.yaml")
    )


def find(name: str) -> Path:
    """Return the file of a shipped configuration's name, or of a path.

    Raises
    ------
    ConfigError
        Neither exists.
    """
    path = Path(name)
    if path.suffix.lower() in {".yaml", ".yml"}:
        if not path.is_file():
            raise ConfigError(f"{name}: no such file. Name a YAML file, or one of: {_names()}.")
        return path
    if name not in shipped():
        near = get_close_matches(name, shipped(), n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise ConfigError(f"unknown observer {name!r}.{hint} Choose one of: {_names()}.")
    return folder() / f"{name}.yaml"


def read(path: Path) -> dict[str, Any]:
    """Read a YAML mapping.

    Raises
    ------
    ConfigError
        The file cannot be read, is no YAML, or is no mapping with an ``observer``.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ConfigError(f"{path}: over 1 MiB. A configuration is a small YAML file.")
        document = _parse(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ConfigError(
            f"{path}: {error.strerror}. Name a YAML file that can be read."
        ) from error
    except _NOT_YAML as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{path}: not YAML: {reason}. See `attest config show fts`.") from error
    if not isinstance(document, dict):
        raise ConfigError(f"{path}: a mapping is needed. See `attest config show fts`.")
    if not isinstance(document.get("observer"), str):
        raise ConfigError(f"{path}: no 'observer'. Add a line such as 'observer: fts'.")
    return document


def override(document: Mapping[str, Any], assignments: Iterable[str]) -> dict[str, Any]:
    """Return the document with ``--set`` assignments, each ``dotted.key=YAML value``.

    Raises
    ------
    ConfigError
        An assignment has no ``=``, no YAML value, or goes through something that has no keys.
    """
    merged: dict[str, Any] = {**document}
    for assignment in assignments:
        dotted, equals, text = assignment.partition("=")
        if not equals or not dotted.strip():
            raise ConfigError(f"--set {assignment}: write it as key=value, such as gains.k_p=2.")
        try:
            value = _parse(text)
        except _NOT_YAML as error:
            raise ConfigError(f"--set {assignment}: the value is not YAML.") from error
        _assign(merged, dotted.strip().split("."), value, assignment)
    return merged


def effective(configuration: Configuration) -> dict[str, Any]:
    """Return the whole configuration as JSON-like data, defaults included."""
    return configuration.model_dump(mode="json")


def dump(configuration: Configuration) -> str:
    """Return the whole configuration as YAML."""
    return yaml.safe_dump(effective(configuration), sort_keys=False, default_flow_style=None)


def _parse(text: str) -> Any:
    return yaml.load(text, Loader=_Loader)  # noqa: S506 - a SafeLoader


def _names() -> str:
    return ", ".join(shipped())


def _assign(document: dict[str, Any], keys: list[str], value: Any, assignment: str) -> None:
    *outer, last = keys
    for key in outer:
        inner = document.get(key)
        if inner is not None and not isinstance(inner, dict):
            raise ConfigError(f"--set {assignment}: {key!r} is a value and has no keys.")
        document[key] = {**(inner or {})}
        document = document[key]
    document[last] = value
