"""The summary as Markdown, for a text panel."""

import re
from collections.abc import Iterator, Sequence
from itertools import cycle

from attest.metrics import Metrics, Statistics
from attest.result import Result

KINDS = {
    "truth": "truth",
    "autopilot": "the autopilot's own estimate from the same sensors: not independent, not truth",
    "smoother": "attest's own smoother over the whole log, from the same sensors: not truth",
}

SCENE = (
    "*In the 3D view: solid, the estimate; outlined, the reference; thick arrows, directions as"
    " measured; thin ones, as known.*"
)
"""How to read the picture beside the text."""
SCENE_OF_SEVERAL = (
    "*In the 3D view: solid, the best observer; outlined in their colours, the others; outlined in"
    " pale grey, the reference; thick arrows, directions as the best has them; thin ones, as"
    " known.*"
)


def markdown(result: Result) -> str:
    """Say what was run, how good it was, and what to doubt."""
    parts = (_head(result), _scores(result), _promises(result), _notes(result), [SCENE])
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def markdown_of_several(results: Sequence[Result], colors: Sequence[str]) -> str:
    """Say how the observers did, the best first, and what to doubt."""
    parts = (_ranking(results, colors), _notes(results[0]), [SCENE_OF_SEVERAL])
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _ranking(results: Sequence[Result], colors: Sequence[str]) -> Iterator[str]:
    yield f"# {len(results)} observers on {escape(results[0].recording.path.name)}"
    yield ""
    metrics = results[0].metrics
    if metrics is None:
        yield "No reference: the order is that of Wahba's mean cost, consistency only."
    else:
        kind = KINDS.get(metrics.kind, escape(metrics.kind))
        yield f"Against **{escape(metrics.reference)}** ({kind}):"
    yield ""
    yield "| observer | colour | RMSE [deg] | heading | inclination | median | p95 | Wahba's cost |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|"
    for result, color in zip(results, cycle(colors), strict=False):
        yield _ranked(result, color)


def _ranked(result: Result, color: str) -> str:
    scores = ["-"] * 5
    if (m := result.metrics) is not None:
        figures = (m.total.rmse, m.heading.rmse, m.inclination.rmse, m.total.median, m.total.p95)
        scores = [f"{figure:.2f}" for figure in figures]
    cost = float(result.estimates.cost.mean())
    cells = (escape(result.estimates.observer), color, *scores, f"{cost:.3g}")
    return f"| {' | '.join(cells)} |"


def escape(text: str) -> str:
    """Keep text from a log from being read as Markdown."""
    line = " ".join(text.split())
    return re.sub(r"([\\`*_{}\[\]()<>#+!|~&-])", r"\\\1", line)


def _head(result: Result) -> Iterator[str]:
    recording = result.recording
    t = result.estimates.t
    seconds = (t[-1] - t[0]) * 1e-9 if len(t) else 0.0
    yield f"# {escape(result.estimates.observer)} on {escape(recording.path.name)}"
    yield ""
    vehicle = f"{escape(recording.vehicle)}, " if recording.vehicle else ""
    yield f"{vehicle}{len(t)} estimates over {seconds:.1f} s"


def _scores(result: Result) -> Iterator[str]:
    metrics = result.metrics
    if metrics is None:
        yield "No reference: the error is not known; the residuals tell of consistency only."
        return
    kind = KINDS.get(metrics.kind, escape(metrics.kind))
    yield f"Against **{escape(metrics.reference)}** ({kind}):"
    yield ""
    yield "| error [deg] | RMSE | mean | median | p95 | max |"
    yield "|---|---:|---:|---:|---:|---:|"
    yield from _rows(metrics)
    yield ""
    yield _settling(metrics)


def _rows(metrics: Metrics) -> Iterator[str]:
    yield _row("total", metrics.total)
    yield _row("heading", metrics.heading)
    yield _row("inclination", metrics.inclination)
    offset = f"{metrics.heading_offset_deg:.2f}°"
    yield _row(f"total without heading offset {offset}", metrics.without_heading_offset)
    if metrics.after_settling:
        yield _row("total after settling", metrics.after_settling)


def _row(name: str, s: Statistics) -> str:
    values = " | ".join(f"{value:.2f}" for value in (s.rmse, s.mean, s.median, s.p95, s.max))
    return f"| {name} | {values} |"


def _settling(metrics: Metrics) -> str:
    bound = f"{metrics.settling_bound_deg:g}°"
    if metrics.settling_time_s is None:
        return f"{metrics.scored} samples scored; the error never stays below {bound}."
    return f"{metrics.scored} samples scored; below {bound} after {metrics.settling_time_s:.1f} s."


def _promises(result: Result) -> Iterator[str]:
    """Say what theory promises and what was seen."""
    marks = {True: "✓", False: "✗", None: "?"}
    if result.claims:
        yield "## Promised and seen"
        yield ""
    for claim in result.claims:
        yield (
            f"- {marks[claim.holds]} {escape(claim.statement)} *({escape(claim.source)})*: "
            f"{escape(claim.seen)}"
        )


def _notes(result: Result) -> Iterator[str]:
    notes = sorted(result.notes, key=lambda note: not note.doubt)
    if notes:
        yield "## Notes"
        yield ""
    for note in notes:
        mark = "**Warning:** " if note.doubt else ""
        yield f"- {mark}{note.count} × {escape(note.text)}"
