"""An observer as text: its paper, and what each of its settings means."""

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from attest.config import Configuration, dump

OWN = ("gains", "plant")
"""Sections that an observer adds to what all have."""


def text_of_observer(title: str, paper: str, defaults: Configuration) -> str:
    """Return an observer's paper, its gains with meaning, range and default, and its YAML."""
    lines = [f"{defaults.observer}  {title}", f"  {paper}"]
    fields = type(defaults).model_fields
    for name in (name for name in OWN if name in fields):
        settings = list(_settings(fields[name].annotation))
        lines += ["", f"  {name}", *(settings or ["    none"])]
    lines += ["", "  YAML, with every default", ""]
    lines += [f"    {line}" for line in dump(defaults).splitlines()]
    return "\n".join(lines)


def _settings(model: Any) -> Iterator[str]:
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        return
    fields = model.model_fields
    widest = max(map(len, fields), default=0)
    for name, field in fields.items():
        meaning = " ".join((field.description or "").split())
        yield f"    {name:{widest + 2}s}{_default(field):18s}{_range(field):18s}{meaning}"


def _default(field: FieldInfo) -> str:
    """Return a default as YAML spells it."""
    match field.default:
        case None:
            return "null"
        case bool(flag):
            return str(flag).lower()
        case tuple(values):
            return f"[{', '.join(f'{value:g}' for value in values)}]"
        case float(number):
            return f"{number:g}"
        case other:
            return str(other)


def _range(field: FieldInfo) -> str:
    """Return the limits of a number, such as ``> 0, < 1``."""
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    limits = [
        f"{sign} {getattr(bound, name):g}"
        for bound in field.metadata
        for name, sign in signs.items()
        if getattr(bound, name, None) is not None
    ]
    return ", ".join(limits)
