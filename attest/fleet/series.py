"""From rows to series: of each vehicle and observer, each figure from flight to flight."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from attest.errors import ConfigError
from attest.fleet.figures import COLUMNS, FIELD, FIELD_SHARE, FIGURES, IRON, MODEL, Figure

if TYPE_CHECKING:
    import pyarrow

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

EARLIEST = datetime(1990, 1, 1, tzinfo=UTC).timestamp()
"""What is earlier is a clock that was never set."""
DAY = 86400.0


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
    t: Array
    """Beginning, seconds since 1970; NaN where it is not known."""
    path: "pyarrow.ChunkedArray"
    """Of the log."""
    figures: Mapping[str, Array]
    vehicles: Sequence[str]
    observers: Sequence[str]
    references: Sequence[str]


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One figure of one vehicle by one observer, in the order of time."""

    vehicle: str
    observers: tuple[str, ...]
    """Several, where they tell the same."""
    figure: Figure
    reference: str
    """Of an error; else empty."""
    rows: Whole
    """Of the flights, shape (n,)."""
    t: Array
    """Seconds since 1970, rising, NaN behind them where it is not known, shape (n,)."""
    x: Array
    """In the unit of the figure, shape (n,)."""

    @property
    def dated(self) -> int:
        """How many flights have a date; these are first."""
        return int(np.count_nonzero(np.isfinite(self.t)))


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
    table = table.drop_columns(["status", "sha256", "version"]).take(newest)
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

    The newest version is the latest, of one version what is read last. A log may have several
    vehicles.
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
    by = np.lexsort((np.arange(len(log)), place[version], vehicle, observer, log))
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
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


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
    return seconds if seconds >= EARLIEST else float("nan")


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
    figures = {name: table[name].to_numpy() for name in COLUMNS}
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
        t=t,
        path=table["path"],
        figures=figures,
        vehicles=vehicles,
        observers=observers,
        references=references,
    )


def series(flights: Flights) -> Iterator[Series]:
    """Yield every series, by vehicle and figure; what several observers tell alike once."""
    unknown_last = np.lexsort((flights.t, flights.observer, flights.vehicle))
    for vehicle in _runs(flights.vehicle, unknown_last):
        parts = list(_runs(flights.observer, vehicle))
        parts.sort(key=lambda rows: flights.observers[flights.observer[rows[0]]])
        for figure in FIGURES:
            found: list[Series] = []
            for rows in parts:
                for one in _of(flights, figure, rows):
                    _join(found, one)
            yield from found


def _runs(key: Whole, rows: Whole) -> Iterator[Whole]:
    """Yield the rows in which a key is the same; it is so in neighbours."""
    if len(rows):
        yield from np.split(rows, np.flatnonzero(np.diff(key[rows])) + 1)


def _of(flights: Flights, figure: Figure, rows: Whole) -> Iterator[Series]:
    """Yield the series of a figure: one, or one for each reference."""
    rows = rows[np.isfinite(flights.figures[figure.column][rows])]
    if not len(rows):
        return
    parts: Iterator[Whole] = iter((rows,))
    if figure.error:
        by = rows[np.argsort(flights.reference[rows], kind="stable")]
        parts = _runs(flights.reference, by)
    for part in parts:
        x = figure.scale * flights.figures[figure.column][part]
        yield Series(
            vehicle=flights.vehicles[flights.vehicle[part[0]]],
            observers=(flights.observers[flights.observer[part[0]]],),
            figure=figure,
            reference=flights.references[flights.reference[part[0]]] if figure.error else "",
            rows=part,
            t=flights.t[part],
            x=_unwound(x) if figure.turn else x,
        )


def _unwound(angle: Array) -> Array:
    """Return angles, degrees, within half a turn of their mean."""
    mean = np.rad2deg(np.angle(np.exp(1j * np.deg2rad(angle)).sum()))
    unwound: Array = mean + (angle - mean + 180.0) % 360.0 - 180.0
    return unwound


def _join(found: list[Series], one: Series) -> None:
    """Add a series, or its observer to one that is the same."""
    for i, other in enumerate(found):
        same = other.reference == one.reference and np.array_equal(other.x, one.x)
        if same and np.array_equal(other.t, one.t, equal_nan=True):
            found[i] = replace(other, observers=other.observers + one.observers)
            return
    found.append(one)
