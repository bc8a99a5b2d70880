"""An observer as text: its paper, and what each of its settings means."""

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from attest.config import Configuration, dump


def text_of_observer(title: str, paper: str, defaults: Configuration) -> str:
    """Return an observer's paper, its gains with meaning, range and default, and its YAML."""
    gains = type(defaults).model_fields["gains"].annotation
    lines = [f"{defaults.observer}  {title}", f"  {paper}", "", "  gains"]
    lines += _settings(gains)
    lines += ["", "  YAML, with every default", ""]
    lines += [f"    {line}" for line in dump(defaults).splitlines()]
    return "\n".join(lines)


def _settings(model: Any) -> Iterator[str]:
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        return
    for name, field in model.model_fields.items():
        meaning = " ".join((field.description or "").split())
        yield f"    {name:8s}{field.default!s:8s}{_range(field):18s}{meaning}"


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
