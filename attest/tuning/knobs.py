"""The keys of a configuration that are tuned: where they start, how far they may go."""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import exp, inf, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from attest import config
from attest.config import Configuration, Section
from attest.errors import ConfigError

Array = NDArray[np.float64]
Values = tuple[float, ...]
"""Of one knob."""

TUNABLE = ("gains", "weights", "conditioning", "plant")
"""Sections whose keys may be tuned; the others say what is read, and against what it is scored."""
NO_GAIN = frozenset({"gains.tolerance"})
"""Positive numbers among the gains that only a solver's accuracy depends on."""
DIGITS = 4
"""Significant digits of a tuned value."""
INSIDE = 0.01
"""Share of the way from a border that is not allowed itself which is left out."""
OUTER = {"minimum": "low", "exclusiveMinimum": "low", "maximum": "high", "exclusiveMaximum": "high"}


@dataclass(frozen=True, slots=True)
class Knob:
    """One key: a positive number, or positive numbers that are scaled as one."""

    key: str
    """Dotted, such as ``gains.k_p``, an entry of a list by its number from 0."""
    start: Values
    low: float
    """Least factor on the start."""
    high: float
    """Greatest factor."""


def knobs(configuration: Configuration, more: Sequence[str], factor: float) -> tuple[Knob, ...]:
    """Return the observer's gains, and more keys, each within a factor of its start.

    Gains that are zero, text, or switches stay what they are.

    Raises
    ------
    ConfigError
        There is no such key, it is no positive number, or there is nothing to tune.
    """
    gains = getattr(configuration, "gains", None)
    keys = [f"gains.{name}" for name in type(gains).model_fields] if gains is not None else []
    document = config.effective(configuration)
    own = [key for key in keys if key not in NO_GAIN and _numbers(_value(document, key))]
    if not own and not more:
        raise ConfigError(
            f"observer {configuration.observer!r} has no gains to tune. Choose another, or name "
            "keys with --key."
        )
    for key in more:
        _refuse(configuration, document, key)
    return tuple(
        _knob(configuration, document, key, factor) for key in dict.fromkeys([*own, *more])
    )


def configured(
    configuration: Configuration, tuned: Sequence[Knob], values: Sequence[Values]
) -> Configuration:
    """Return the configuration with these values of the knobs.

    Raises
    ------
    ConfigError
        The values do not go together.
    """
    document = config.effective(configuration)
    for knob, value in zip(tuned, values, strict=True):
        _assign(document, knob.key, value)
    return config.validate(type(configuration), document, configuration.observer)


def values_at(tuned: Sequence[Knob], u: Array) -> tuple[Values, ...]:
    """Return each knob's value at a point between 0 (low) and 1 (high); the start's exactly."""
    found = []
    for knob, at, begin in zip(tuned, u, start_of(tuned), strict=True):
        scale = exp(log(knob.low) + float(at) * (log(knob.high) - log(knob.low)))
        there = tuple(float(f"{x * scale:.{DIGITS}g}") for x in knob.start)
        found.append(knob.start if at == begin else there)
    return tuple(found)


def points_of(tuned: Sequence[Knob], values: Sequence[Values]) -> list[float]:
    """Return where values are between 0 (low) and 1 (high)."""
    return [
        log(value[0] / knob.start[0] / knob.low) / log(knob.high / knob.low)
        for knob, value in zip(tuned, values, strict=True)
    ]


def start_of(tuned: Sequence[Knob]) -> Array:
    """Return the point of the starting values, shape (n,)."""
    return np.array([log(knob.low) / (log(knob.low) - log(knob.high)) for knob in tuned])


def _knob(
    configuration: Configuration, document: Mapping[str, Any], key: str, factor: float
) -> Knob:
    start = _numbers(_value(document, key))
    low, high = 1.0 / factor, factor
    for name, border in _borders(configuration, key):
        for x in start:
            inside = border + INSIDE * (x - border) if name.startswith("exclusive") else border
            if OUTER[name] == "low":
                low = max(low, inside / x)
            else:
                high = min(high, inside / x)
    if not low < high:
        raise ConfigError(f"--key {key}: the configuration allows no other value. Leave it out.")
    # at the border itself a start has a whole side to go
    return Knob(key, start, min(low, 1.0), max(high, 1.0))


def _borders(configuration: Configuration, key: str) -> Iterator[tuple[str, float]]:
    """Yield the limits that a key's type allows, by their names in JSON Schema."""
    section: Any = configuration
    for name in key.split("."):
        if not isinstance(section, Section):
            return
        inner = getattr(section, name)
        if not isinstance(inner, Section):
            yield from _limits(type(section).model_json_schema()["properties"][name])
        section = inner


def _limits(schema: Any) -> Iterator[tuple[str, float]]:
    if isinstance(schema, list):
        for each in schema:
            yield from _limits(each)
    elif isinstance(schema, dict):
        for name, value in schema.items():
            if name in OUTER:
                yield name, float(value)
            elif name in {"anyOf", "prefixItems"}:
                yield from _limits(value)


def _refuse(configuration: Configuration, document: Mapping[str, Any], key: str) -> None:
    """Refuse a key that is not there, or that cannot be tuned."""
    if key.partition(".")[0] not in TUNABLE:
        raise ConfigError(f"--key {key}: only keys of {', '.join(TUNABLE)} can be tuned.")
    try:
        value = _value(document, key)
    except (KeyError, IndexError, TypeError) as error:
        if isinstance(error, KeyError):  # says what is unknown, and what is known there
            config.validate(type(configuration), _with_unknown(document, key), f"--key {key}")
        raise ConfigError(f"--key {key}: no such key. See `attest config show`.") from None
    if not _numbers(value):
        raise ConfigError(f"--key {key}: no positive number. Give it one with --set, or leave it.")


def _with_unknown(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    *outer, last = key.split(".")
    whole = deepcopy(dict(document))
    place = whole
    for name in outer:
        place = place.setdefault(name, {})
    place[last] = 1.0
    return whole


def _value(document: Mapping[str, Any], key: str) -> Any:
    value: Any = document
    for name in key.split("."):
        value = value[int(name) if isinstance(value, list) and name.isdecimal() else name]
    return value


def _assign(document: dict[str, Any], key: str, values: Values) -> None:
    outer, _, last = key.rpartition(".")
    place = _value(document, outer)
    at = int(last) if isinstance(place, list) else last
    place[at] = list(values) if isinstance(place[at], list) else values[0]


def _numbers(value: Any) -> Values:
    """Return a value's positive numbers; none where it is anything else."""
    values = value if isinstance(value, list) else [value]
    good = [isinstance(x, float) and 0.0 < x < inf for x in values]
    return tuple(values) if values and all(good) else ()
