"""One run as a Rerun recording."""

import os
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from attest.result import Result
from attest.writers.json import clean
from attest.writers.rerun_comparison import plots_of_several
from attest.writers.rerun_layout import layout
from attest.writers.rerun_plots import plots
from attest.writers.rerun_scene import COLOR_NAMES, log_scene
from attest.writers.rerun_states import log_states
from attest.writers.rerun_target import Target
from attest.writers.summary_text import markdown, markdown_of_several

BLOCK = 1 << 20
"""Bytes copied at once."""


def record(file: BinaryIO, results: Sequence[Result], recording_id: str) -> None:
    """Log runs over one log and their layout to a file."""
    recording = rr.RecordingStream("attest", recording_id=recording_id, send_properties=False)
    with _saved(recording, file), _strict():
        _log(recording, results)


def _log(recording: rr.RecordingStream, results: Sequence[Result]) -> None:
    first = results[0]
    t = _ends(results)
    target = Target(recording, first.recording.clock, int(t[0]) if len(t) else 0)
    drawn = plots(first) if len(results) == 1 else plots_of_several(results)
    names = ", ".join(result.estimates.observer for result in results)
    recording.send_recording_name(clean(f"{first.recording.path.name} · {names}"))
    recording.send_blueprint(layout(results, drawn, target.whole(t)))
    text = markdown(first) if len(results) == 1 else markdown_of_several(results, COLOR_NAMES)
    target.static("summary", rr.TextDocument(clean(text), media_type="text/markdown"))
    log_scene(target, results)
    for plot in drawn:
        plot.log(target)
    log_states(target, results)


def _ends(results: Sequence[Result]) -> NDArray[np.int64]:
    """Return the first and last times of the runs, in order."""
    every = [result.estimates.t for result in results]
    return np.sort(np.concatenate([end for t in every for end in (t[:1], t[-1:])]))


@contextmanager
def _saved(recording: rr.RecordingStream, file: BinaryIO) -> Iterator[None]:
    """Have a recording written by us, as it comes.

    When the library itself writes to a disk that is full, it tells so in its own log only, and may
    wait for ever. Through its memory it would hold the whole recording, more than once.
    """
    if os.name != "posix":  # no path leads to a pipe: through memory then
        encoded = rr.binary_stream(recording)
        yield
        file.write(encoded.read() or b"")
        return
    source, sink = os.pipe()
    with ThreadPoolExecutor(1) as pool:
        copied = pool.submit(_copy, source, file)
        try:
            recording.save(f"/dev/fd/{sink}")
        finally:
            os.close(sink)  # the library has opened its own
        try:
            yield
        finally:
            recording.disconnect()
        copied.result()


def _copy(source: int, file: BinaryIO) -> None:
    """Write what comes through a pipe, and empty the pipe even when the file takes no more."""
    with os.fdopen(source, "rb", buffering=0) as pipe:
        try:
            shutil.copyfileobj(pipe, file, BLOCK)
            file.flush()
        except OSError:
            while pipe.read(BLOCK):
                pass
            raise


@contextmanager
def _strict() -> Iterator[None]:
    """Let the library raise its errors, which it would else only log."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)
