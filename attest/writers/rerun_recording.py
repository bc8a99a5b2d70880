"""One run as a Rerun recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from attest.result import Result
from attest.writers.rerun_layout import layout
from attest.writers.rerun_plots import plots
from attest.writers.rerun_scene import log_scene
from attest.writers.rerun_states import log_states
from attest.writers.rerun_target import Target
from attest.writers.summary_text import markdown


def record(path: Path, result: Result, recording_id: str) -> None:
    """Log a run and its layout to a file.

    Raises
    ------
    RuntimeError
        The file cannot be written, or not to its end.
    """
    recording = rr.RecordingStream("attest", recording_id=recording_id, send_properties=False)
    recording.save(path)
    try:
        with _strict():
            _log(recording, result)
    finally:
        recording.disconnect()
    RrdReader(path).store()  # the end is written without complaint even to a full disk


def _log(recording: rr.RecordingStream, result: Result) -> None:
    target = Target(recording, result.recording.clock, _start(result))
    drawn = plots(result)
    recording.send_recording_name(f"{result.recording.path.name} · {result.estimates.observer}")
    recording.send_blueprint(layout(result, drawn, target.whole(result.estimates.t)))
    target.static("summary", rr.TextDocument(markdown(result), media_type="text/markdown"))
    log_scene(target, result)
    for plot in drawn:
        plot.log(target)
    log_states(target, result)
    recording.flush()


def _start(result: Result) -> int:
    return int(result.estimates.t[0]) if len(result.estimates.t) else 0


@contextmanager
def _strict() -> Iterator[None]:
    """Let the library raise its errors, which it would else only log."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)
