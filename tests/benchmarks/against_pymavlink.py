"""What the benchmarks of telemetry and on-board logs share."""

import argparse
import resource
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

Rate = tuple[float, int]


def arguments(doc: str, log: str) -> argparse.ArgumentParser:
    """Return what can be asked of either; log says what it takes."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("log", type=Path, help=log)
    parser.add_argument("--megabytes", type=float, default=100.0)
    parser.add_argument("--pymavlink-megabytes", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3, help="of which the quickest counts")
    return parser


def pymavlink_rate(
    log: Path, opened: Callable[[str], AbstractContextManager[Any]], wanted: set[str]
) -> Rate:
    """Bytes per second of ``recv_match`` over a log, and the messages it gave."""
    start, count = time.perf_counter(), 0
    with opened(str(log)) as reader:
        while reader.recv_match(type=list(wanted)) is not None:
            count += 1
    return log.stat().st_size / (time.perf_counter() - start), count


def own_rate(log: Path) -> Rate:
    """Bytes per second of the whole reader, and the samples of its gyroscope."""
    from attest import readers

    start = time.perf_counter()
    recording = readers.read(log)
    seconds = time.perf_counter() - start
    return log.stat().st_size / seconds, len(recording.signals["gyro"].t)


def report(long: Path, rounds: int, pymavlink: Callable[[], Rate]) -> None:
    """Measure both, and print rates, their ratio and the highest memory use."""
    own, samples = max(own_rate(long) for _ in range(rounds))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    theirs, count = max(pymavlink() for _ in range(2))
    # again, so that a machine that grew slower or quicker meanwhile favours neither
    own = max(own, *(own_rate(long)[0] for _ in range(rounds)))
    out = sys.stdout.write
    out(f"attest     {own / 1e6:8.1f} MB/s  {samples} gyro samples, peak memory {peak:.0f} MB\n")
    out(f"pymavlink  {theirs / 1e6:8.2f} MB/s  {count} messages\n")
    out(f"ratio      {own / theirs:8.1f}\n")
