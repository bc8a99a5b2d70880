"""What `attest` wrote: a file to be read where it is named, and no log of the folder it is in."""

import re
from pathlib import Path

OURS = re.compile(rb"\x89MCAP0\r\n\x01.{8}\x04\0\0\0ros2.{4}attest ", re.DOTALL)
"""Magic and header record of an MCAP whose library is `attest` [MCAP, Header (op=0x01)]."""
HEAD = 64
"""Bytes that it takes to tell."""


def is_result(path: Path) -> bool:
    """Whether the file is an MCAP that a run has written."""
    try:
        with path.open("rb") as file:
            return begins_result(file.read(HEAD))
    except (OSError, ValueError):
        return False


def begins_result(head: bytes) -> bool:
    """Whether a file that begins so is one."""
    return OURS.match(head) is not None
