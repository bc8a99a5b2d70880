"""What to say of a file that no reader knows, by what is in it."""

from pathlib import Path

from attest.errors import ReadError
from attest.readers import csv_head, csv_layouts, csv_preamble

COMPRESSED = {
    b"\x1f\x8b": "gzip",
    b"PK\x03\x04": "zip",
    b"PK\x05\x06": "zip",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"BZh": "bzip2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""By the bytes that a file begins with."""
SHOWN = 8
"""Names of columns that fit one line."""
MAP = "by input.csv in a YAML (README.md, Configuration), and name it by --observer"


def compressed(path: Path, head: bytes) -> ReadError | None:
    """Return what to say of a file that must be unpacked; None of any other."""
    for begins, name in COMPRESSED.items():
        if head.startswith(begins):
            return ReadError(f"{path}: is compressed ({name}). Unpack it first.")
    return None


def refusal(path: Path, head: bytes, formats: str) -> ReadError:
    """Return what to say of a file that is no log."""
    if csv_layouts.of_trajectory(path) is not None:
        return csv_layouts.no_log(path)
    text = head.decode("utf-16", "replace").encode() if head.startswith(csv_head.UTF16) else b""
    if csv_preamble.columns(text) is not None:
        return csv_head.in_utf16(path)
    found = csv_preamble.columns(head)
    if found is None:
        return ReadError(
            f"{path}: not a log that attest knows ({formats}). Check that it is the file you meant."
        )
    if not found.names:
        skip = f" and skip: {found.skip}" if found.skip else ""
        return ReadError(
            f"{path}: a CSV without names of its columns. Tell their numbers {MAP}, "
            f"with header: false{skip}."
        )
    skip = f", with skip: {found.skip}" if found.skip else ""
    return ReadError(
        f"{path}: a CSV whose columns attest does not know: {listed(found.names)}. "
        f"Tell them {MAP}{skip}."
    )


def listed(names: list[str]) -> str:
    """Return the first of some names, and how many there are in all."""
    shown = ", ".join(name[:40] for name in names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown}, … ({len(names)} in all)"
