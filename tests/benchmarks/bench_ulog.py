"""How quickly an on-board log of PX4 is read, against pyulog, in one run.

    python tests/benchmarks/bench_ulog.py LOG... [--rounds 5]

Reads each log here, and with pyulog alone, both for the same topics; prints rates and their ratio.
"""

import argparse
import sys
import time
from pathlib import Path

from pyulog import ULog


def pyulog_seconds(log: Path, wanted: set[str]) -> float:
    """Time of the library alone."""
    start = time.perf_counter()
    ULog(str(log), list(wanted))
    return time.perf_counter() - start


def own_seconds(log: Path) -> float:
    """Time of the whole reader."""
    from attest import readers

    start = time.perf_counter()
    readers.read(log)
    return time.perf_counter() - start


def main() -> None:
    """Measure and print."""
    from attest.readers.ulog_topics import WANTED

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="+")
    parser.add_argument("--rounds", type=int, default=5, help="of which the quickest counts")
    args = parser.parse_args()
    for log in args.log:
        # in turn, so that a machine that grew slower or quicker meanwhile favours neither
        pairs = [(own_seconds(log), pyulog_seconds(log, WANTED)) for _ in range(args.rounds)]
        own, theirs = (min(times) for times in zip(*pairs, strict=True))
        size = log.stat().st_size / 1e6
        rates = f"attest {size / own:7.1f} MB/s  pyulog {size / theirs:7.1f} MB/s"
        sys.stdout.write(f"{log.name:24s} {rates}  ratio {theirs / own:5.2f}\n")


if __name__ == "__main__":
    main()
