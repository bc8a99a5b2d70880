"""Figures of an experiment as PNG, on the papers' axes."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from attest.files import replacing
from attest.reproduction.experiment import Experiment, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT, DPI = 7.0, 3.0, 150
"""Of a panel, inches, and dots per inch."""


def write(experiment: Experiment, folder: Path) -> Iterator[Path]:
    """Write each figure, and yield its path.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    for name, panels in experiment.panels.items():
        figure = Figure(figsize=(WIDTH, HEIGHT * len(panels)), layout="constrained")
        FigureCanvasAgg(figure)
        for i, panel in enumerate(panels, start=1):
            _draw(figure.add_subplot(len(panels), 1, i), panel)
        figure.suptitle(f"{experiment.name}: {experiment.title}", fontsize=10)
        path = folder / f"{name}.png"
        with replacing(path) as part:
            figure.savefig(part, format="png", dpi=DPI)
        yield path


def _draw(axes: "Axes", panel: Panel) -> None:
    for name, (x, y) in panel.lines.items():
        axes.plot(x, y, label=name, linewidth=0.9)
    if panel.log:
        axes.set_yscale("log")
    if panel.bounds is not None:
        axes.set_ylim(*panel.bounds)
    axes.set_title(panel.title, fontsize=9)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)
    axes.grid(visible=True, alpha=0.3)
    axes.margins(x=0.0)
    if len(panel.lines) > 1:
        axes.legend(loc="upper right", fontsize=8)
