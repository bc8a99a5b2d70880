"""What a batch costs beside the runs themselves, and whether it stays linear.

    python tests/benchmarks/bench_batch.py [--logs 200] [--rows 1000000] [--many 0]

Prints the throughput of two jobs against one, the overhead for a log of 60 s at 50 Hz with JSON
alone, the memory of parent and workers over many logs, and journal and summary for simulated rows.
The kernels should be compiled: run it twice.
"""

import argparse
import os
import resource
import shutil
import sys
import tempfile
import time
from pathlib import Path

from attest import batch, pipeline, simulation

LOG = "fts"


def flights(folder: Path, count: int) -> Path:
    """Write copies of a flight of 64 s at 50 Hz."""
    folder.mkdir()
    first = folder / "00000.tlog"
    simulation.write(first, simulation.simulate("quadcopter"))
    for i in range(1, count):
        shutil.copy(first, folder / f"{i:05d}.tlog")
    return folder


def memory(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * resource.getpagesize() / 1e6


def timed(source: Path, output: Path, jobs: int) -> tuple[float, list[float]]:
    """Return seconds for a log after the start of all workers, and the memory seen on the way."""
    plan = batch.Plan(
        configurations={LOG: pipeline.configure(LOG)}, output=output, kinds=(), jobs=jobs
    )
    logs = batch.find([str(source)], output).logs
    ends, seen = [], []
    me = os.getpid()
    with batch.Journal(output) as journal:
        for row, _ in batch.run(logs, plan, journal):
            assert row["status"] == "ok", row
            ends.append(time.perf_counter())
            if len(ends) % max(len(logs) // 10, 1) == 0:
                children = Path(f"/proc/{me}/task/{me}/children").read_text(encoding="ascii")
                seen.append(memory(me) + sum(map(memory, map(int, children.split()))))
    begin = len(ends) // 4  # the second worker starts when the first is ready
    end = len(ends) - 2 * jobs
    return (ends[end] - ends[begin]) / (end - begin), seen


def alone(source: Path, output: Path) -> float:
    """Return seconds for a log that is run and written in this process."""
    configuration = pipeline.configure(LOG)
    taken = []
    for path in sorted(source.iterdir())[:40]:
        began = time.perf_counter()
        result = pipeline.run(path, configuration)
        pipeline.write([result], output / path.stem, kinds=())
        taken.append(time.perf_counter() - began)
    return sum(taken[5:]) / len(taken[5:])


def simulated(output: Path, count: int, row: dict[str, object]) -> None:
    """Write, read and sum up a journal of so many rows, in steps that show if it is linear."""
    for part in (count // 4, count // 2, count):
        folder = output / str(part)
        began, used = time.perf_counter(), time.process_time()
        with batch.Journal(folder) as journal:
            for start in range(0, part, 1000):  # a thousand rows for each wait for the disk
                journal.append(
                    [row | {"path": f"/l/{i:07d}"} for i in range(start, min(start + 1000, part))]
                )
        wrote = time.perf_counter()
        with batch.Journal(folder) as journal:
            opened = time.perf_counter()
            batch.write_results(journal, folder)
        ended = time.perf_counter()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        size = (folder / "journal.jsonl").stat().st_size / 1e6
        sys.stdout.write(
            f"{part:9,d} rows: journal of {size:.0f} MB written in {wrote - began:.1f} s, "
            f"opened in {opened - wrote:.1f} s; summary and page {ended - opened:.1f} s; "
            f"{(ended - began) / part * 1e6:.0f} µs a row, "
            f"{(time.process_time() - used) / part * 1e6:.0f} µs of it work; peak {peak:.0f} MB\n"
        )
        shutil.rmtree(folder)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--rows", type=int, default=1_000_000, help="simulated; 0: none")
    parser.add_argument("--many", type=int, default=0, help="logs to watch the memory over")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = flights(folder / "in", given.logs)
        by_itself = alone(source, folder / "alone")
        one, _ = timed(source, folder / "one", 1)
        two, _ = timed(source, folder / "two", 2)
        sys.stdout.write(
            f"a log: {by_itself * 1e3:.0f} ms by itself, {one * 1e3:.0f} ms with one job "
            f"(overhead {(one - by_itself) * 1e3:.0f} ms), {two * 1e3:.0f} ms with two\n"
            f"two jobs: {one / two:.2f} times the logs of one\n"
        )
        if given.many:
            _, seen = timed(flights(folder / "many", given.many), folder / "out", 2)
            text = ", ".join(f"{value:.0f}" for value in seen)
            sys.stdout.write(f"memory of all processes over {given.many:,} logs: {text} MB\n")
        with batch.Journal(folder / "one") as journal:
            row = next(journal.rows())
        if given.rows:
            simulated(folder, given.rows, row)


if __name__ == "__main__":
    main()
