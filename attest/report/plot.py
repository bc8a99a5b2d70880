"""The signals of a log as a PNG, to look at before anything is estimated."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from attest.errors import ReadError
from attest.files import replacing
from attest.recording import Recording, Signal, seconds
from attest.report.info import GAP, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

WIDTH, HEIGHT, DPI = 10.0, 2.0, 120
"""Of a panel, inches, and dots per inch."""
MOST_PANELS = 20
EARTH_RADIUS = 6_371_000.0
"""m."""
COLUMNS = 2_000
"""Of a panel: of more samples, the least and the greatest in each are drawn, so none is hidden."""


def plot(recording: Recording, path: Path) -> None:
    """Draw each signal over time.

    Raises
    ------
    ReadError
        The log has no signal.
    WriteError
        The system refuses to write.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    signals = {name: s for name, s in recording.signals.items() if len(s.t)}
    if not signals:
        raise ReadError(f"{recording.path}: no signal to plot.")
    shown = dict(list(signals.items())[:MOST_PANELS])
    origin = min(int(signal.t[0]) for signal in signals.values())
    figure = Figure(figsize=(WIDTH, HEIGHT * len(shown)), layout="constrained")
    FigureCanvasAgg(figure)
    for i, (name, signal) in enumerate(shown.items(), start=1):
        axes = figure.add_subplot(len(shown), 1, i)
        _draw(axes, name, signal, origin)
    axes.set_xlabel("time since the first sample, s")
    figure.suptitle(recording.path.name, fontsize=10, parse_math=False)
    with replacing(path) as part:
        figure.savefig(part, format="png", dpi=DPI)


def _draw(axes: "Axes", name: str, signal: Signal, origin: int) -> None:
    t = seconds(signal.t, origin)
    labels, y, unit = tuple("xyz"), signal.y, unit_of(name)
    if name == "position":  # whose degrees and metres share no axis
        labels, y, unit = ("north", "east", "up"), _moved(y), "m from the first"
    for axis, column in zip(labels, y.T, strict=False):
        axes.plot(*_thinned(t, column), label=axis, linewidth=0.7)
    axes.set_ylabel(f"{name} [{unit}]" if unit else name, parse_math=False)
    axes.grid(visible=True, alpha=0.3)
    axes.margins(x=0.0)
    axes.legend(loc="upper right", fontsize=7)


def _moved(position: Array) -> Array:
    """Return how far north, east and up of the first one positions are, m, shape (n, 3)."""
    latitude, longitude = np.deg2rad(position[:, 0]), np.unwrap(np.deg2rad(position[:, 1]))
    north = EARTH_RADIUS * (latitude - latitude[0])
    east = EARTH_RADIUS * np.cos(latitude[0]) * (longitude - longitude[0])
    return np.stack([north, east, position[:, 2] - position[0, 2]], axis=1)


def _thinned(t: Array, x: Array) -> tuple[Array, Array]:
    """Return the least and the greatest value of each stretch where there are many samples.

    Behind a sample, or a stretch, that a gap follows stands one that is not drawn.
    """
    steps = np.diff(t)
    gap = np.append(steps > GAP * np.median(steps), False) if len(steps) else np.zeros(1, np.bool_)
    size = len(x) // COLUMNS
    if size < 4:
        return _broken(t, x, np.flatnonzero(gap) + 1)
    whole = len(x) // size * size
    parts = x[:whole].reshape(-1, size)
    both = np.stack([parts.min(axis=1), parts.max(axis=1)], axis=1).ravel()
    after = 2 * np.flatnonzero(gap[:whole].reshape(-1, size).any(axis=1)) + 2
    t, x = np.append(np.repeat(t[:whole:size], 2), t[-1]), np.append(both, x[-1])
    return _broken(t, x, after)


def _broken(t: Array, x: Array, after: NDArray[np.intp]) -> tuple[Array, Array]:
    """Put what is not drawn at some places."""
    return np.insert(t, after, np.nan), np.insert(x, after, np.nan)
