"""From flights to series: of each vehicle and observer, each figure from flight to flight."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from attest.fleet.choice import Flights
from attest.fleet.figures import FIGURES, Figure

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

SHORT = 8
"""Of a configuration's digest, what tells it from others."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One figure of one vehicle by one observer, in the order of time."""

    vehicle: str
    observers: tuple[str, ...]
    """Several, where they tell the same."""
    figure: Figure
    reference: str
    """Of an error; else empty."""
    configuration: str
    """Of an error, the beginning of its digest where the observer had several; else empty."""
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
    """Yield the series of a figure: one, or one for each kind of error that compares."""
    rows = rows[np.isfinite(flights.figures[figure.column][rows])]
    if not len(rows):
        return
    for part in _comparable(flights, rows) if figure.error else (rows,):
        x = figure.scale * flights.figures[figure.column][part]
        yield Series(
            vehicle=flights.vehicles[flights.vehicle[part[0]]],
            observers=(flights.observers[flights.observer[part[0]]],),
            figure=figure,
            reference=flights.references[flights.reference[part[0]]] if figure.error else "",
            configuration=_configuration(flights, part[0]) if figure.error else "",
            rows=part,
            t=flights.t[part],
            x=_unwound(x) if figure.turn else x,
        )


def _comparable(flights: Flights, rows: Whole) -> Iterator[Whole]:
    """Yield the rows of one observer whose errors compare."""
    unlike = flights.reference * len(flights.configurations) + flights.configuration
    yield from _runs(unlike, rows[np.argsort(unlike[rows], kind="stable")])


def _configuration(flights: Flights, row: np.int64) -> str:
    """Return the beginning of a configuration's digest where its observer had several."""
    if flights.observers[int(flights.observer[row])] not in flights.several:
        return ""
    return flights.configurations[int(flights.configuration[row])][:SHORT]


def _unwound(angle: Array) -> Array:
    """Return angles, degrees, within half a turn of their mean."""
    mean = np.rad2deg(np.angle(np.exp(1j * np.deg2rad(angle)).sum()))
    unwound: Array = mean + (angle - mean + 180.0) % 360.0 - 180.0
    return unwound


def _join(found: list[Series], one: Series) -> None:
    """Add a series, or its observer to one that is the same."""
    for i, other in enumerate(found):
        same = (other.reference, other.configuration) == (one.reference, one.configuration)
        if (
            same
            and np.array_equal(other.x, one.x)
            and np.array_equal(other.t, one.t, equal_nan=True)
        ):
            found[i] = replace(other, observers=other.observers + one.observers)
            return
    found.append(one)
