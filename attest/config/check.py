"""A document checked against an observer's configuration, and what is wrong with it in one line."""

import json
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from attest.config.section import Section
from attest.config.settings import Configuration
from attest.errors import ConfigError

C = TypeVar("C", bound=Configuration)


def validate(model: type[C], document: Mapping[str, Any], source: str) -> C:
    """Check a document against an observer's configuration.

    Raises
    ------
    ConfigError
        A key is unknown, or a value has the wrong type or is out of range; the first one is told.
    """
    try:
        # through JSON, where strict typing still lets a YAML list be a tuple
        return model.model_validate_json(json.dumps(document), strict=True)
    except (TypeError, ValueError, RecursionError) as error:
        if not isinstance(error, ValidationError):
            raise ConfigError(f"{source}: {error}. Use plain numbers, text and lists.") from error
        raise ConfigError(f"{source}: {_explain(model, error)}") from error


def _explain(model: type[Section], error: ValidationError) -> str:
    """Say the first error in one line: the key, what was given, what is allowed."""
    errors = error.errors(include_url=False)
    unknown = next((e for e in errors if e["type"] == "extra_forbidden"), None)
    if unknown is not None:
        return _unknown_key(model, unknown["loc"])
    first = errors[0]
    # of a union, the branch that was meant is the one whose own keys were looked at
    first = next((e for e in errors if _inside(e["loc"], first["loc"])), first)
    keys = _keys(first["loc"])
    dotted = ".".join(map(str, keys))
    if first["type"] == "missing":
        return f"{dotted!r} is missing. Add it."
    given = json.dumps(first["input"], default=str)[:80]
    if first["type"] == "value_error":
        return f"{dotted!r} is {given}: {first['msg'].removeprefix('Value error, ')}."
    # of a union, each branch says what it allows
    allowed = [e["msg"].removeprefix("Input should be ") for e in errors if _keys(e["loc"]) == keys]
    why = _model_at(model, keys[:-1]).theorem
    must = " or ".join(dict.fromkeys(allowed)) + (f" {why}" if why else "")
    return f"{dotted!r} is {given}. It must be: {must}."


def _unknown_key(model: type[Section], loc: tuple[int | str, ...]) -> str:
    """Name the key, the nearest known one, and all that are known in its place."""
    outer, key = _keys(loc[:-1]), str(loc[-1])
    known = _known(model, outer)
    near = get_close_matches(key, known, n=1, cutoff=0.5)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    dotted = ".".join(map(str, [*outer, key]))
    return f"unknown key {dotted!r}. {hint}Known: {', '.join(known) or 'none'}."


def _inside(loc: tuple[int | str, ...], outer: tuple[int | str, ...]) -> bool:
    keys, around = _keys(loc), _keys(outer)
    return len(keys) > len(around) and keys[: len(around)] == around


def _keys(loc: tuple[int | str, ...]) -> list[int | str]:
    """Leave the names of a union's branches out of pydantic's location."""
    return [key for key in loc if not isinstance(key, str) or _is_key(key)]


def _is_key(part: str) -> bool:
    """Whether a part of pydantic's location is a key, and not the branch of a union."""
    return part.isidentifier() and part not in {"str", "int", "float", "tuple", "literal", "Iron"}


def _known(model: type[Section], keys: list[Any]) -> list[str]:
    """Return the keys that the model knows at a place."""
    return list(_model_at(model, keys).model_fields)


def _model_at(model: type[Section], keys: list[Any]) -> type[Section]:
    """Return the section at a place, the nearest one around it where it is none."""
    for key in keys:
        if key not in model.model_fields:
            continue
        inner = model.model_fields[key].annotation
        model = next(
            (
                part
                for part in _parts(inner)
                if isinstance(part, type) and issubclass(part, Section)
            ),
            model,
        )
    return model


def _parts(annotation: Any) -> list[Any]:
    """Return an annotation and everything inside it."""
    return [annotation, *(p for inner in get_args(annotation) for p in _parts(inner))]
