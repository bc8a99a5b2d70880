"""What a message advises, done."""

import re
import shlex

from attest.readers import sensors
from attest.readers.options import ReadOptions
from attest.recording import Recording


def assignments(text: str) -> list[str]:
    """Return the first ``--set KEY=VALUE`` of a message, and those that follow it at once."""
    found = re.search(r"--set ('[^']*'|\S+)( --set '[^']*')*", text)
    return [] if found is None else shlex.split(found[0])[1::2]


def axes(text: str) -> dict[str, list[str]]:
    """Return the axes that a message advises, by signal."""
    told = (one.partition("=") for one in assignments(text))
    return {key.removeprefix("input.axes."): value[1:-1].split(",") for key, _, value in told}


def mended(log: Recording, text: str) -> Recording:
    """Return a log whose sensors' axes are as a message advises."""
    return sensors.as_told(log, ReadOptions(axes=axes(text)))
