"""A batch whose logs do what the worst logs do, as their names say; also a program to be killed."""

import faulthandler
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from attest import batch, pipeline, readers

HEAD = 300
"""Lines of the sample flight that make a short log."""
read = readers.read


def unkind() -> None:
    """Let logs hang, kill and crash their process, by name."""
    readers.read = by_name


def by_name(path, options=None):
    """Read a log, unless its name is a threat."""
    name = path.name
    if "hang" in name:
        time.sleep(3600)
    if "slow" in name:
        time.sleep(0.15)
    if "kill" in name:
        os.kill(os.getpid(), signal.SIGKILL)
    if "exit" in name:
        os._exit(3)
    if "segv" in name:
        faulthandler.disable()
        faulthandler._sigsegv()
    if "greedy" in name:
        np.ones(1 << 40)
    if "fault" in name:
        raise ValueError("not what\nwas expected")
    return read(path, options)


def plan(output, observers=("paper/cgo",), **choices):
    """Return a plan that is quick: JSON alone, an observer with few kernels, unkind logs."""
    configurations = {name.rpartition("/")[2]: pipeline.configure(name) for name in observers}
    choices = {"kinds": (), "jobs": 2, "prepare": (unkind,)} | choices
    return batch.Plan(configurations=configurations, output=output, **choices)


def run(named, made):
    """Run a whole batch, and return its rows and whether each was done before."""
    logs = batch.find(list(map(str, named)), made.output).logs
    with batch.Journal(made.output) as journal:
        rows = list(batch.run(logs, made, journal))
        batch.write_results(journal, made.output)
    return rows


def short(sample_logs, path):
    """Write a log of some seconds."""
    lines = (sample_logs / "quadcopter.csv").read_text().splitlines(keepends=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(lines[:HEAD]))
    return path


def main() -> None:
    """Run the folder of the first argument into that of the second, a line for each row."""
    source, output = map(Path, sys.argv[1:3])
    made = plan(output, limits=batch.Limits(timeout_s=2.0))
    logs = batch.find([str(source)], output).logs
    with batch.Journal(output) as journal:
        for row, before in batch.run(logs, made, journal):
            sys.stdout.write(f"{row['status']} {before} {row['path']}\n")
            sys.stdout.flush()
        batch.write_results(journal, output)


if __name__ == "__main__":
    main()
