"""What ``attest calibrate`` found, as YAML that ``attest run --observer`` takes."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from attest.config import Configuration, dump
from attest.errors import printable
from attest.report.info import shown, text_of_notes

WIDTH = 100
"""Columns of a line."""


def text_of_calibration(document: Mapping[str, Any], configuration: Configuration) -> str:
    """Return the configuration as YAML, with what was found as comments before it."""
    lines = [f"# Sensors of {shown(document['log'])}, as far as it tells them"]
    for name, sensor in document["sensors"].items():
        lines += wrap(
            f"{name}: {sensor['told']}",
            WIDTH,
            initial_indent="# ",
            subsequent_indent="#   ",
            break_long_words=False,
        )
    if not any("configuration" in sensor for sensor in document["sensors"].values()):
        lines.append("# Nothing of it is to be applied: the configuration is as it was")
    lines += [f"#{line}" for line in text_of_notes({"notes": [], **document}) if line]
    return "\n".join([*map(printable, lines), dump(configuration)])
