"""How quickly a CSV is read, against numpy.loadtxt, in one run.

    python tests/benchmarks/bench_csv.py [LOG.csv] [--rows 1000000] [--rounds 3]

Without a log, one of 11 columns is made. Prints rates and their ratio, and the peak of memory.
"""

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

NAMES = ["time_s", *(f"{name}_{axis}" for name in ("gyro", "accel", "mag") for axis in "xyz"), "t"]


def make(path: Path, rows: int) -> Path:
    """Write a log of random values, with nine digits each."""
    y = np.random.default_rng(1).standard_normal((rows, len(NAMES) - 1))
    table = np.column_stack([np.arange(rows) * 0.005, y])
    form = ["%.6f"] + ["%.9g"] * (len(NAMES) - 1)
    np.savetxt(path, table, form, delimiter=",", header=",".join(NAMES), comments="")
    return path


def numpy_seconds(log: Path) -> float:
    """Time of the library alone."""
    start = time.perf_counter()
    np.loadtxt(log, delimiter=",", skiprows=1)
    return time.perf_counter() - start


def own_seconds(log: Path) -> float:
    """Time of the whole reader."""
    from attest import readers

    start = time.perf_counter()
    readers.read(log)
    return time.perf_counter() - start


def peak() -> float:
    """Return the most memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?")
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3, help="of which the quickest counts")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = args.log or make(Path(folder) / "made.csv", args.rows)
        before = peak()
        own_seconds(log)  # imports, and the memory of one reading
        held = peak() - before
        # in turn, so that a machine that grew slower or quicker meanwhile favours neither
        pairs = [(own_seconds(log), numpy_seconds(log)) for _ in range(args.rounds)]
        own, theirs = (min(times) for times in zip(*pairs, strict=True))
        size = log.stat().st_size / 1e6
    rates = f"attest {size / own:7.1f} MB/s  numpy.loadtxt {size / theirs:7.1f} MB/s"
    memory = f"memory {held / size:.1f} times the file"
    sys.stdout.write(f"{log.name:24s} {rates}  ratio {theirs / own:5.2f}  {memory}\n")


if __name__ == "__main__":
    main()
