"""Where a run is logged to, and on which timelines."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from attest.recording import Clock

Columns = Callable[[slice], Iterable[rr.ComponentColumn]]
"""Makes the columns of some rows."""

CHUNK_ROWS = 65_536
"""Three times as fast to send and to show as one chunk of a million rows."""

TIME = "time"
"""UTC where the log allows it, else the log's clock."""
ELAPSED = "elapsed"
"""Since the first estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A recording in the making, and what its times count from."""

    recording: rr.RecordingStream
    clock: Clock
    start: int
    """The first estimate, nanoseconds on the recording's clock."""

    def static(self, entity: str, *what: rr.AsComponents) -> None:
        """Log what holds at all times."""
        self.recording.log(entity, *what, static=True)

    def rows(
        self,
        entity: str,
        t: NDArray[np.int64],
        columns: Columns,
    ) -> None:
        """Log rows at their times, as many at once as suits the viewer."""
        for begin in range(0, len(t), CHUNK_ROWS):
            part = slice(begin, begin + CHUNK_ROWS)
            self.recording.send_columns(entity, self._timelines(t[part]), columns(part))
            self.recording.flush()  # else all that is to be written waits in memory

    def whole(self, t: NDArray[np.int64]) -> rr.TimeRange:
        """Return the span of some stamps on the first timeline."""
        ends = (int(t[0]), int(t[-1])) if len(t) else (0, 0)
        first, last = (end + (self.clock.utc_offset or 0) for end in ends)
        boundary = rr.TimeRangeBoundary.absolute
        return rr.TimeRange(start=boundary(nanos=first), end=boundary(nanos=last))

    def _timelines(self, t: NDArray[np.int64]) -> list[rr.TimeColumn]:
        elapsed = (t - self.start).astype("timedelta64[ns]")
        if self.clock.utc_offset is None:
            time = rr.TimeColumn(TIME, duration=t.astype("timedelta64[ns]"))
        else:
            stamp = (t + self.clock.utc_offset).astype("datetime64[ns]")
            time = rr.TimeColumn(TIME, timestamp=stamp)
        return [time, rr.TimeColumn(ELAPSED, duration=elapsed)]


def recent(t: NDArray[np.int64], happened: NDArray[np.bool_], window: int) -> NDArray[np.bool_]:
    """Tell where something happened within a window before, so that slow sensors do not flicker."""
    never = np.iinfo(np.int64).min
    last = np.maximum.accumulate(np.where(happened, t, never)) if len(t) else t
    return (last > never) & (last >= t - window)
