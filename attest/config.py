"""The configuration of a run: YAML, checked before anything is read.

Precedence: code defaults < YAML < ``--set``. What ran is saved with the results and reproduces
them. An observer's module extends `Configuration` by its gains; the rest is the same for all.
"""

import json
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from attest.errors import ConfigError

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

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


class Section(BaseModel):
    """A group of keys: unknown keys and infinities are refused, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Weights(Section):
    """Weights K of Wahba's cost."""

    k: Vector3 = (3.0, 2.0, 1.0)
    """Along the world's axes; a turn about one axis feels the sum of the other two."""

    @field_validator("k")
    @classmethod
    def _make_cost_a_morse_function(cls, k: Vector3) -> Vector3:
        if len(set(k)) < 3 or min(k) < 1.0:
            raise ValueError("three distinct values of at least 1 are needed [FTS, Lemma 1]")
        return k


class Initial(Section):
    """Where the observer starts."""

    attitude: Literal["triad", "identity"] | Quaternion = "triad"
    """From the first vectors (triad), identity, or a quaternion [w, x, y, z], body to world."""
    bias: Vector3 = (0.0, 0.0, 0.0)
    """Gyroscope bias, rad/s."""
    angular_velocity: Vector3 | None = None
    """Estimate of the angular velocity, rad/s; null takes the first measurement less the bias."""

    @field_validator("attitude")
    @classmethod
    def _refuse_zero(cls, attitude: str | Quaternion) -> str | Quaternion:
        if not isinstance(attitude, str) and sum(x * x for x in attitude) < 1e-12:
            raise ValueError("a quaternion of length zero is no attitude")
        return attitude


class Vector(Section):
    """A direction that is measured in the body and known in the world."""

    signal: str
    """Name of the signal, such as accel, mag, or a CSV's further vector."""
    reference: Literal["gravity", "specific_force", "magnetic", "north"] | Vector3 | None = None
    """gravity; specific_force (needs velocity); magnetic (World Magnetic Model at place and date);
    north (magnetic north, dip from the log); [x, y, z] in the world. null: what suits the signal
    and the log best."""

    @field_validator("reference")
    @classmethod
    def _refuse_zero(cls, reference: str | Vector3 | None) -> str | Vector3 | None:
        if isinstance(reference, tuple) and not any(reference):
            raise ValueError("a vector of length zero has no direction")
        return reference


class SpecificForce(Section):
    """The accelerometer's reference a - g from the log's velocity."""

    smoothing_s: Annotated[float, Field(gt=0, le=60)] = 0.5
    """Standard deviation of the Gaussian that smooths acceleration and accelerometer alike, s."""
    lag_s: Annotated[float | None, Field(ge=-5, le=5)] = None
    """How late the log's velocity is, s; null finds it from |a - g| and |accelerometer|."""


class Magnetometer(Section):
    """The magnetometer's own ways."""

    latency_s: Annotated[float | None, Field(ge=0, le=5)] = None
    """How late its values are against the gyroscope, s; null finds it from the log's turns."""


class Conditioning(Section):
    """What is done to the measurements before the observer sees them."""

    max_step_s: Annotated[float, Field(gt=0, le=10)] = 0.01
    """Longest step of the observer; a slower log is sub-stepped, its gyroscope interpolated."""
    max_age_s: Annotated[float, Field(ge=0, le=600)] = 1.0
    """How far a vector may be carried by the gyroscope from its nearest sample."""
    restart_gap_s: Annotated[float, Field(gt=0)] = 5.0
    """A gyroscope silent for longer than this makes the observer start anew."""
    specific_force: SpecificForce = SpecificForce()
    magnetometer: Magnetometer = Magnetometer()


class Input(Section):
    """How the log is read."""

    imu: str | None = None
    """Message or topic to take the inertial signals from; null takes the best."""
    vehicle: str | None = None
    """System id, or system/component, where a log has several vehicles."""
    world: Literal["ned", "enu"] | None = None
    """World axes of a format that does not say; null is ned."""
    start_s: Annotated[float | None, Field(ge=0)] = None
    """Leave out what is earlier than this, seconds from the log's first gyroscope sample."""
    end_s: Annotated[float | None, Field(gt=0)] = None
    """Leave out what is later than this, seconds from the log's first gyroscope sample."""


class Evaluation(Section):
    """How the estimate is compared."""

    reference: str | None = None
    """Name of the reference; null takes the best of the log, none compares with nothing."""
    settling_bound_deg: Annotated[float, Field(gt=0, le=180)] = 5.0
    """The total error counts as settled when it stays below this."""
    longest_gap_s: Annotated[float, Field(gt=0)] = 2.0
    """The reference is never interpolated across a longer gap than this."""
    apply_time_offset: bool = False
    """Shift the reference by the time offset that was found before scoring."""
    apply_heading_offset: bool = False
    """Take the constant heading offset out before scoring."""
    apply_misalignment: bool = False
    """Take the constant rotation between the two bodies out before scoring."""


class Configuration(Section):
    """What every observer's configuration has."""

    observer: str
    weights: Weights = Weights()
    initial: Initial = Initial()
    vectors: tuple[Vector, ...] | None = None
    """null: accelerometer and magnetometer, as far as the log has them."""
    input: Input = Input()
    conditioning: Conditioning = Conditioning()
    evaluation: Evaluation = Evaluation()

    @field_validator("vectors")
    @classmethod
    def _refuse_twice(cls, vectors: tuple[Vector, ...] | None) -> tuple[Vector, ...] | None:
        names = [vector.signal for vector in vectors or ()]
        if len(set(names)) < len(names):
            raise ValueError("a signal is named twice")
        return vectors


C = TypeVar("C", bound=Configuration)


def folder() -> Path:
    """Return where the shipped configurations are: in the package, or beside it in a checkout."""
    packaged = Path(__file__).parent / "configs"
    return packaged if packaged.is_dir() else Path(__file__).parents[1] / "configs"


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


def _explain(model: type[BaseModel], error: ValidationError) -> str:
    """Say the first error in one line: the key, what was given, what is allowed."""
    errors = error.errors(include_url=False)
    unknown = next((e for e in errors if e["type"] == "extra_forbidden"), None)
    if unknown is not None:
        return _unknown_key(model, unknown["loc"])
    first = errors[0]
    keys = _keys(first["loc"])
    dotted = ".".join(map(str, keys))
    if first["type"] == "missing":
        return f"{dotted!r} is missing. Add it."
    given = json.dumps(first["input"], default=str)[:80]
    if first["type"] == "value_error":
        return f"{dotted!r} is {given}: {first['msg'].removeprefix('Value error, ')}."
    # of a union, each branch says what it allows
    allowed = [e["msg"].removeprefix("Input should be ") for e in errors if _keys(e["loc"]) == keys]
    return f"{dotted!r} is {given}. It must be: {' or '.join(dict.fromkeys(allowed))}."


def _unknown_key(model: type[BaseModel], loc: tuple[int | str, ...]) -> str:
    """Name the key, the nearest known one, and all that are known in its place."""
    outer, key = _keys(loc[:-1]), str(loc[-1])
    known = _known(model, outer)
    near = get_close_matches(key, known, n=1, cutoff=0.5)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    dotted = ".".join(map(str, [*outer, key]))
    return f"unknown key {dotted!r}. {hint}Known: {', '.join(known)}."


def _keys(loc: tuple[int | str, ...]) -> list[int | str]:
    """Leave the names of a union's branches out of pydantic's location."""
    return [key for key in loc if not isinstance(key, str) or _is_key(key)]


def _is_key(part: str) -> bool:
    """Whether a part of pydantic's location is a key, and not the branch of a union."""
    return part.isidentifier() and part not in {"str", "float", "tuple", "literal"}


def _known(model: type[BaseModel], keys: list[Any]) -> list[str]:
    """Return the keys that the model knows at a place."""
    for key in keys:
        if isinstance(key, int):
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
    return list(model.model_fields)


def _parts(annotation: Any) -> list[Any]:
    """Return an annotation and everything inside it."""
    return [annotation, *(p for inner in get_args(annotation) for p in _parts(inner))]
