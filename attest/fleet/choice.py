"""From rows to flights: which rows count, and what is one vehicle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from attest.errors import ConfigError
from attest.fleet.figures import COLUMNS, FIELD, FIELD_SHARE, IRON, MODEL

if TYPE_CHECKING:
    import pyarrow

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

EARLIEST = datetime(1990, 1, 1, tzinfo=UTC).timestamp()
LATEST = datetime(2200, 1, 1, tzinfo=UTC).timestamp()
"""What is earlier or later is a clock that was never set, or not well."""
DAY = 86400.0
LARGEST = 1e100
LONGEST = 9
"""Digits of a part of a version; what has more is a word."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which rows, and what is one vehicle."""

    by: Literal["vehicle", "folder"] = "vehicle"
    observers: tuple[str, ...] = ()
    """None: all."""
    since: date | None = None
    until: date | None = None
    """The last day, itself included, in UTC."""


@dataclass(frozen=True, slots=True, eq=False)
class Flights:
    """The rows that count, in columns, each of shape (n,)."""

    vehicle: Whole
    """Number in `vehicles`."""
    observer: Whole
    reference: Whole
    configuration: Whole
    t: Array
    """Beginning, seconds since 1970; NaN where it is not known."""
    path: "pyarrow.ChunkedArray"
    """Of the log."""
    figures: Mapping[str, Array]
    vehicles: Sequence[str]
    observers: Sequence[str]
    references: Sequence[str]
    configurations: Sequence[str]
    """Their digests."""
    several: Mapping[str, int]
    """How many configurations an observer had, where it is not one."""


def flights(table: "pyarrow.Table", choice: Choice) -> tuple[Flights, dict[str, int]]:
    """Return the rows that count, and how many were left out, by why.

    Raises
    ------
    ConfigError
        An observer that is chosen is in none of the rows.
    """
    import pyarrow
    import pyarrow.compute as pc

    left_out = {"read": table.num_rows}
    table = table.filter(pc.equal(table["status"], "ok"))
    left_out["not ok"] = left_out["read"] - table.num_rows
    newest = _newest(table)
    left_out["twice"] = table.num_rows - len(newest)
    table = table.drop_columns(["status", "sha256", "version", "ran_utc"]).take(newest)
    if choice.observers:
        chosen = _of_observers(table, choice.observers)
        left_out["of other observers"] = table.num_rows - chosen.num_rows
        table = chosen
    t = _times(table["began_utc"])
    within = _within(t, choice)
    left_out["of other days"] = len(t) - int(within.sum())
    found = _flights(table.filter(pyarrow.array(within)), t[within], choice.by)
    left_out["undated"] = int(np.isnan(found.t).sum())
    left_out["without vehicle"] = 0
    if choice.by == "vehicle":
        left_out["without vehicle"] = table["vehicle"].filter(pyarrow.array(within)).null_count
    return found, left_out


def _newest(table: "pyarrow.Table") -> Whole:
    """Return the rows of which no later one is of the same log, vehicle and observer.

    Later is what ran later; where that is not known, a newer version, then what is read later. A
    log may have several vehicles.
    """
    import pyarrow.compute as pc

    log, _ = _coded(pc.coalesce(table["sha256"], table["path"]))
    observer, _ = _coded(table["observer"])
    vehicle, _ = _coded(table["vehicle"])
    version, known = _coded(table["version"])
    versions = known.to_pylist()
    order = sorted(range(len(versions)), key=lambda i: _parts(versions[i]))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    ran = np.nan_to_num(_times(table["ran_utc"]), nan=-np.inf)
    by = np.lexsort((np.arange(len(log)), place[version], ran, vehicle, observer, log))
    one = np.stack([log, observer, vehicle])[:, by]
    last = np.append((one[:, 1:] != one[:, :-1]).any(axis=0), np.ones(min(len(log), 1), np.bool_))
    return np.sort(by[last])


def _coded(column: Any) -> tuple[Whole, Any]:
    """Return a text column as numbers of an array of texts; none is the empty one."""
    import pyarrow.compute as pc

    coded = pc.fill_null(column, "").combine_chunks().dictionary_encode()
    return coded.indices.to_numpy(zero_copy_only=False).astype(np.int64), coded.dictionary


def _in_order(column: Any) -> tuple[Whole, list[str]]:
    """Return a text column as numbers of a sorted list of texts, whatever came first."""
    number, known = _coded(column)
    texts = known.to_pylist()
    order = sorted(range(len(texts)), key=texts.__getitem__)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    return place[number], [texts[i] for i in order]


def _parts(version: str) -> list[tuple[int, str]]:
    """Return what orders versions: numbers as such, words before them."""
    parts = version.replace("+", ".").replace("-", ".").split(".")
    number = [part.isdecimal() and len(part) <= LONGEST for part in parts]
    pairs = zip(parts, number, strict=True)
    return [(int(part), "") if known else (-1, part) for part, known in pairs]


def _of_observers(table: "pyarrow.Table", wanted: Sequence[str]) -> "pyarrow.Table":
    import pyarrow
    import pyarrow.compute as pc

    known = sorted(name for name in pc.unique(table["observer"]).to_pylist() if name)
    for name in wanted:
        if name not in known:
            raise ConfigError(
                f"--observer {name}: not in the summaries. They have: {', '.join(known)}."
            )
    return table.filter(pc.is_in(table["observer"], value_set=pyarrow.array(list(wanted))))


def _times(column: "pyarrow.ChunkedArray") -> Array:
    parts = [np.array(list(map(_seconds, chunk.to_pylist())), float) for chunk in column.chunks]
    return np.concatenate([np.empty(0), *parts])


def _seconds(text: str | None) -> float:
    """Return a time since 1970; NaN for none, or what cannot be."""
    try:
        when = datetime.fromisoformat(text or "")
        seconds = (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return float("nan")
    return seconds if EARLIEST <= seconds < LATEST else float("nan")


def _within(t: Array, choice: Choice) -> NDArray[np.bool_]:
    """Tell which rows are of the days that are chosen; an unknown day is of none."""
    within = np.ones(len(t), np.bool_)
    if choice.since is not None:
        within &= t >= _day(choice.since)
    if choice.until is not None:
        within &= t < _day(choice.until) + DAY
    return within


def _day(day: date) -> float:
    return datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()


def _flights(table: "pyarrow.Table", t: Array, by: str) -> Flights:
    import pyarrow.compute as pc

    named = pc.replace_substring_regex(table["path"], r"[/\\][^/\\]*$", "")
    if by == "vehicle":
        named = pc.replace_substring_regex(named, "^", "folder ", max_replacements=1)
        named = pc.coalesce(table["vehicle"], named)
    vehicle, vehicles = _in_order(named)
    observer, observers = _in_order(table["observer"])
    reference, references = _in_order(table["reference"])
    configuration, configurations = _in_order(table["digest"])
    figures = {name: _sane(table[name].to_numpy()) for name in COLUMNS}
    given = pc.fill_null(pc.equal(table["iron"], "given"), False).to_numpy()
    for name in IRON:
        figures[name] = np.where(given, np.nan, figures[name])
    model = figures.pop(MODEL)
    with np.errstate(all="ignore"):
        figures[FIELD_SHARE] = figures[FIELD] / model
    figures[FIELD] = np.where(np.isfinite(figures[FIELD_SHARE]), np.nan, figures[FIELD])
    return Flights(
        vehicle=vehicle,
        observer=observer,
        reference=reference,
        configuration=configuration,
        t=t,
        path=table["path"],
        figures=figures,
        vehicles=vehicles,
        observers=observers,
        references=references,
        configurations=configurations,
        several=_several(observer, configuration, observers),
    )


def _sane(x: Array) -> Array:
    """Return a column without values that no figure has, whose sums would be infinite."""
    return np.where(np.abs(x) < LARGEST, x, np.nan)


def _several(observer: Whole, configuration: Whole, observers: Sequence[str]) -> dict[str, int]:
    """Return how many configurations each observer had, where it is not one."""
    pairs = np.unique(np.stack([observer, configuration]), axis=1)
    count = np.bincount(pairs[0], minlength=len(observers))
    return {observers[i]: int(count[i]) for i in np.flatnonzero(count > 1).tolist()}
