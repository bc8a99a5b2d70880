"""What configurations of several observers over one log have in common."""

import json
from collections.abc import Mapping
from typing import Any, TypeVar

from attest.config.check import validate
from attest.config.files import effective
from attest.config.sensors import Iron
from attest.config.settings import Configuration
from attest.errors import ConfigError

C = TypeVar("C", bound=Configuration)

OF_THE_SENSORS: dict[str, Any] = {
    "max_age_s": True,
    "restart_gap_s": True,
    "specific_force": True,
    "accelerometer": True,
    "gyroscope": {"bias": True, "scale": True},
    "magnetometer": {"latency_s": True},
}
"""Keys of conditioning that tell of the log, and not of what an observer makes of it."""


def with_its_sensors(model: type[C], name: str, given: Configuration) -> C:
    """Return another observer's own configuration, with the log, vectors and calibration of one."""
    whole = given.model_dump(mode="json", include={"input", "vectors"})
    conditioning = given.conditioning.model_dump(mode="json", include=OF_THE_SENSORS)
    calibrate = given.conditioning.magnetometer.calibrate
    if isinstance(calibrate, Iron):
        conditioning["magnetometer"]["calibrate"] = calibrate.model_dump(mode="json")
    document = {"observer": name, **whole, "conditioning": conditioning}
    return validate(model, document, name)


def sampling(configuration: Configuration) -> str:
    """Return what configurations share if they may share samples."""
    whole = effective(configuration)
    shared = {key: whole.get(key) for key in ("input", "conditioning", "vectors", "points")}
    shared["kind"] = type(configuration.conditioning).__name__  # which tells who says what
    return json.dumps(shared, sort_keys=True)


def refuse_unlike(configurations: Mapping[str, Configuration]) -> None:
    """Refuse to rank errors of different data, or taken in different ways.

    Raises
    ------
    ConfigError
        The configurations, by label, read or score the log in different ways.
    """
    (first, one), *others = configurations.items()
    for label, other in others:
        for section in ("input", "evaluation"):
            ours, theirs = (effective(each)[section] for each in (one, other))
            for key in ours:
                if ours[key] != theirs[key]:
                    raise ConfigError(
                        f"'{section}.{key}' is {ours[key]} of {first} and {theirs[key]} of "
                        f"{label}: their errors do not compare. Set it for all with --set."
                    )
