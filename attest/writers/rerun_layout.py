"""How the viewer is laid out, so that a recording opens usefully without a click."""

from collections.abc import Sequence
from itertools import groupby

import rerun as rr
import rerun.blueprint as rrb

from attest.result import Result
from attest.writers.rerun_plots import Plot
from attest.writers.rerun_scene import in_world
from attest.writers.rerun_target import TIME

EYE = (-2.0, -1.3, -1.1)
"""Behind, to the left and above the vehicle, north-east-down."""

WIDE = {"error": 3.3, "euler": 4.9}
"""Plots in full width, with their share of the height."""


def layout(results: Sequence[Result], drawn: Sequence[Plot], whole: rr.TimeRange) -> rrb.Blueprint:
    """Put the vehicle and the summary on the left, the whole of what happened on the right."""
    left = rrb.Vertical(_scene(results[0]), _summary(), row_shares=[3, 2])
    right = _over_time(drawn, whole) if len(results) == 1 else _of_several(drawn, whole)
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME),
    )


def _scene(result: Result) -> rrb.Spatial3DView:
    world = result.recording.world
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=in_world(EYE, world),
        look_target=(0.0, 0.0, 0.0),
    )
    axes = "north-east-down" if world == "ned" else "east-north-up"
    if result.estimates.frames:
        axes = " of ".join(reversed(result.estimates.frames))
    return rrb.Spatial3DView(origin="world", name=f"Attitude ({axes})", eye_controls=eye)


def _summary() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin="summary", name="Summary")


def _over_time(drawn: Sequence[Plot], whole: rr.TimeRange) -> rrb.Vertical:
    """Stack error and Euler angles in full width, the rest side by side, and the states."""
    axis = _axis(whole)
    wide = [_plot(plot, axis) for plot in drawn if plot.origin in WIDE]
    rest = [_plot(plot, axis) for plot in drawn if plot.origin not in WIDE]
    half = -(-len(rest) // 2)
    narrow = [rrb.Horizontal(*rest[:half]), rrb.Horizontal(*rest[half:])]
    states = _states(axis)
    shares = [WIDE[plot.origin] for plot in drawn if plot.origin in WIDE]
    return rrb.Vertical(*wide, *narrow, states, row_shares=[*shares, 2.7, 2.7, 4.8])


def _of_several(drawn: Sequence[Plot], whole: rr.TimeRange) -> rrb.Vertical:
    """Put the first plot, whose legend is that of all, in full width, and the rest in rows."""
    axis = _axis(whole)
    rows = [
        rrb.Horizontal(*(_plot(plot, axis, legend=plot is drawn[0]) for plot in plots))
        for _, plots in groupby(drawn, lambda plot: "" if plot is drawn[0] else _row(plot))
    ]
    shares = [5.0, *[2.7] * (len(rows) - 1), 6.0]
    return rrb.Vertical(*rows, _states(axis), row_shares=shares)


def _row(plot: Plot) -> str:
    """Name the row of a plot: errors, angles, or whatever else there is."""
    first = plot.origin.split("/", maxsplit=1)[0]
    return first if first in WIDE else "rest"


def _axis(whole: rr.TimeRange) -> rrb.TimeAxis:
    return rrb.TimeAxis(link=rrb.components.LinkAxis.Independent, view_range=whole)


def _states(axis: rrb.TimeAxis) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin="state", name="State", time_view=axis)


def _plot(plot: Plot, axis: rrb.TimeAxis, *, legend: bool = True) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=plot.origin,
        name=plot.title,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=legend),
        axis_x=axis,
    )
