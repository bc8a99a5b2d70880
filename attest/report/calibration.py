"""What ``attest calibrate`` found, as YAML that ``attest run --observer`` takes."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

import yaml

from attest.report.info import shown

WIDTH = 100
"""Columns of a line."""


def text_of_calibration(document: Mapping[str, Any]) -> str:
    """Return the YAML, with what was found as comments before it."""
    lines = [f"# Sensors of {shown(document['log'])}, as far as it tells them"]
    for name, sensor in document["sensors"].items():
        lines += wrap(
            f"{name}: {sensor['told']}",
            WIDTH,
            initial_indent="# ",
            subsequent_indent="#   ",
            break_long_words=False,
        )
    configuration = {"observer": document["observer"], **document["configuration"]}
    if not document["configuration"]["conditioning"]:
        lines.append("# Nothing of it is to be applied: the observer is as it was")
        return "\n".join([*lines, f"observer: {document['observer']}", ""])
    text = yaml.safe_dump(configuration, sort_keys=False, default_flow_style=None)
    return "\n".join([*lines, text])
