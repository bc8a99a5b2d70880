"""GPS time, which has no leap seconds, and UTC."""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

EPOCH = 315_964_800
"""6 January 1980, unix seconds, at which GPS time and UTC were the same."""
WEEK = 604_800
SECOND = 10**9
LEAPS = (
    (1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7),
    (1993, 7), (1994, 7), (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7),
    (2015, 7), (2017, 1),
)  # fmt: skip
"""Months that begin with one leap second more between the two (IERS, Bulletin C); 18 in all since
2017, and none announced after that."""
_AT = np.array([int(datetime(*leap, 1, tzinfo=UTC).timestamp()) for leap in LEAPS], np.int64)
"""The same, unix seconds."""


def to_unix(week: Ints, ms: Ints) -> Ints:
    """Return unix nanoseconds of GPS weeks and of milliseconds within them."""
    gps = (EPOCH + week * WEEK) * SECOND + ms * 1_000_000
    ahead = np.searchsorted((_AT + np.arange(1, len(_AT) + 1)) * SECOND, gps, side="right")
    return np.asarray(gps - ahead * SECOND, np.int64)


def from_unix(unix: Ints) -> tuple[Ints, Ints]:
    """Return GPS weeks, and nanoseconds within them, of unix nanoseconds."""
    ahead = np.searchsorted(_AT * SECOND, unix, side="right")
    week, within = np.divmod(unix + (ahead - EPOCH) * SECOND, WEEK * SECOND)
    return week, within
