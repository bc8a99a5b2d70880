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
SYSTEM = "system "
"""What begins an id that several vehicles may have."""
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
    return found, left_out | _unsure(table.filter(pyarrow.array(within)), choice.by)


def _unsure(table: "pyarrow.Table", by: str) -> dict[str, int]:
    """Return how many rows have no vehicle, or a name that several vehicles may have."""
    import pyarrow.compute as pc

    if by != "vehicle":
        return {"without vehicle": 0, "without own id": 0}
    weak = pc.fill_null(pc.starts_with(table["vehicle_id"], SYSTEM), True)
    unnamed = pc.and_(pc.is_null(table["vehicle_id"]), pc.is_null(table["vehicle"]))
    nameless, unsure = (int(pc.sum(each).as_py() or 0) for each in (unnamed, weak))
    return {"without vehicle": nameless, "without own id": unsure - nameless}


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

    vehicle, vehicles = _vehicles(table, t, by)
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


def _vehicles(table: "pyarrow.Table", t: Array, by: str) -> tuple[Whole, list[str]]:
    """Return each row's vehicle as a number of a list of names: the latest words, and its id."""
    import pyarrow
    import pyarrow.compute as pc

    folder = pc.replace_substring_regex(table["path"], r"[/\\][^/\\]*$", "")
    if by != "vehicle":
        return _in_order(folder)
    known, words = table["vehicle_id"], pc.fill_null(table["vehicle"], "")
    kind = pc.replace_substring_regex(words, r"\s+\S*[0-9].*$", "")  # without a version
    weak = pc.binary_join_element_wise(kind, known, pyarrow.scalar(", ", known.type))
    own = pc.if_else(pc.starts_with(known, SYSTEM), weak, known)
    folder = pc.replace_substring_regex(folder, "^", "folder ", max_replacements=1)
    vehicle, names = _in_order(pc.coalesce(own, table["vehicle"], folder))
    by_time = np.lexsort((_in_order(words)[0], np.nan_to_num(t, nan=-np.inf)))
    last = np.zeros(len(names), np.int64)
    last[vehicle[by_time]] = by_time
    told = zip(names, words.take(last).to_pylist(), known.take(last).to_pylist(), strict=True)
    return vehicle, [f"{word}, {own}" if word and own else name for name, word, own in told]


def _sane(x: Array) -> Array:
    """Return a column without values that no figure has, whose sums would be infinite."""
    return np.where(np.abs(x) < LARGEST, x, np.nan)


def _several(observer: Whole, configuration: Whole, observers: Sequence[str]) -> dict[str, int]:
    """Return how many configurations each observer had, where it is not one."""
    pairs = np.unique(np.stack([observer, configuration]), axis=1)
    count = np.bincount(pairs[0], minlength=len(observers))
    return {observers[i]: int(count[i]) for i in np.flatnonzero(count > 1).tolist()}
