"""What can go wrong, and whose it is.

    AttestError              one line for the user; the command's exit code
    ├── ReadError            the log or its data cannot be used (1)
    ├── WriteError           an output cannot be written (1)
    └── ConfigError          wrong usage or configuration (2)

Every message reads ``FILE: what is wrong. What to do.`` and is printed by ``cli`` only.
"""


class AttestError(Exception):
    """An expected failure, told to the user in one line."""

    exit_code = 1


class ReadError(AttestError):
    """The log, or the data in it, cannot be used."""


class WriteError(AttestError):
    """An output cannot be written."""


class ConfigError(AttestError):
    """The command line or the configuration is wrong."""

    exit_code = 2


def printable(text: str) -> str:
    """Return a text for a terminal: what would do something to it is shown as it is escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
