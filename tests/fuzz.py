"""Feed the readers files that are damaged or made to do harm, and tell what goes wrong.

    python tests/fuzz.py                          20,000 files for each reader
    python tests/fuzz.py --reader ros --count 500 --first 1000
    python tests/fuzz.py --reader ros --case 1234 --keep bad.bag     one again, with its traceback

A case is a reader and a number: the same file each time. Each is described and run in a worker
process, which may compute for `TIMEOUT` seconds, and take `TIMES` times the file and `ROOM` more
memory than it had before. A one-line error is the right answer to a broken file; everything else is
reported, with the case that makes it again. Warnings of libraries are errors.
"""

import argparse
import dataclasses
import multiprocessing
import random
import resource
import signal
import sys
import tempfile
import threading
import traceback
import warnings
from collections import Counter
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import mutations
import numpy as np
import ros_logs

from attest import pipeline, preview, readers, report, simulation
from attest.errors import AttestError
from attest.readers import reference_file
from attest.readers.options import ReadOptions
from attest.simulation import dataflash
from attest.writers.json import to_json

LOGS = Path(__file__).parent.parent / "sample_logs"
TIMEOUT, WAIT = 10, 60
"""Of computing, and on the clock of a machine that does other things too, s."""
TIMES, ROOM = 10, 300 << 20
COUNT = 20_000
SPAN = (20.0, 22.0)
"""Of the sample flight, s: small files are quick to read."""
SUFFIXES = {"tlog": (".tlog",), "dataflash": (".bin",), "ulog": (".ulg",), "csv": (".csv",),
            "ros": (".bag", ".mcap", ".db3")}  # fmt: skip
EXTRA = {"csv": (mutations.text,) * 8, "dataflash": (mutations.text,), "ros": (mutations.bomb,)}
"""Mutations of one format, by their weight beside the common ones."""
HEAD = 16
"""Bytes that mostly stay, for a file that no reader knows tells nothing."""


class Excess(Exception):
    """Too long, or too much memory."""


@cache
def seeds(reader):
    """Return small logs of a format that are whole."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for scenario in ("quadcopter", "docking"):
            for suffix in SUFFIXES[reader]:
                path = Path(folder) / f"{scenario}{suffix}"
                if scenario == "quadcopter" or reader in {"csv", "ros"}:
                    simulation.write(path, _part(simulation.simulate(scenario)))
                    found.append(path.read_bytes())
        for kind in ros_logs.KINDS if reader == "ros" else ():  # without compression
            path = ros_logs.compass(ros_logs.flight(ros_logs.Log(kind))).write(Path(folder))
            file = path if path.is_file() else next(path.glob("log_*"))
            found.append(file.read_bytes())
    if reader == "tlog":
        found.append(_raw(found[0]))
    if reader == "dataflash":
        found.append(_text(found[0]))
    return tuple(found)


def _part(flight):
    """Return a few seconds of a flight."""
    start = int(flight.t[0])
    low, high = (start + round(s * 1e9) for s in SPAN)
    rows = (low <= flight.t) & (flight.t < high)
    signals = {}
    for name, one in flight.signals.items():
        kept = (low <= one.t) & (one.t < high)
        signals[name] = dataclasses.replace(one, t=one.t[kept], y=one.y[kept])
    truth = {
        name: getattr(flight, name)[rows] for name in ("t", "q", "omega", "position", "velocity")
    }
    autopilot = None if flight.autopilot is None else flight.autopilot[rows]
    return dataclasses.replace(flight, signals=signals, autopilot=autopilot, **truth)


def _raw(tlog):
    """Return a telemetry log without the receiver's stamps."""
    frames, at = [], 0
    while at < len(tlog):
        end = at + 8 + 12 + tlog[at + 9]
        frames.append(tlog[at + 8 : end])
        at = end
    return b"".join(frames)


def _text(log):
    """Return an on-board log as text, as ground stations convert it."""
    kinds = {kind.number: (name, dataflash._dtype(kind)) for name, kind in dataflash._KINDS.items()}
    lines, at = [], 0
    while at < len(log):
        name, dtype = kinds[log[at + 2]]
        values = np.frombuffer(log, dtype, 1, at)[0].item()[1:]
        if name in {"FMT", "IMU", "MAG", "ATT", "GPS", "SIM", "XKF1"}:
            cells = [v.decode() if isinstance(v, bytes) else str(v) for v in values]
            lines.append(", ".join([name, *cells]))
        at += dtype.itemsize
    return "\n".join(lines).encode() + b"\n"


def mutated(reader, number):
    """Return the file of a case."""
    rng = random.Random(f"{reader} {number}")  # noqa: S311
    known = seeds(reader)
    whole = rng.choice(known)
    data = bytearray(whole)
    choices = mutations.COMMON + EXTRA.get(reader, ())
    for _ in range(rng.choice((1, 1, 2, 3))):
        if rng.random() < 0.1:
            _splice(data, rng.choice(known), rng)
        elif data:
            rng.choice(choices)(data, rng)
    if rng.random() < 0.9:
        data[:HEAD] = whole[:HEAD]
    return bytes(data)


def _splice(data, other, rng):
    """Put a part of another log over, or between, what is there."""
    size = rng.choice((16, 100, 1000, 5000))
    at, start = rng.randrange(len(data) + 1), rng.randrange(len(other))
    part = other[start : start + size]
    data[at : at + rng.choice((0, len(part)))] = part


def attempt(path, reader):
    """Describe and run, and take as a reference; a broken file may be refused, in one line."""
    _outcome(reference_file.join, _flight(), str(path), ReadOptions())
    return _outcome(_described_and_run, path, reader)


def _outcome(what, *given):
    try:
        what(*given)
    except AttestError as error:
        if len(str(error).splitlines()) != 1:
            raise Excess(f"message of several lines: {error!r}") from error
        return "refused"
    return "read"


def _described_and_run(path, reader):
    names = ("fts", "docking") if reader in {"csv", "ros"} else ("fts",)
    recording, described = preview.describe(path, _configuration("fts"))
    result = pipeline.run(path, _configuration(names["gyro" not in recording.signals]))
    told = [report.text_of_info(described), report.text_of_run(result.summary, ())]
    if not all(line.isprintable() for text in told for line in text.splitlines()):
        raise Excess("characters that do something to a terminal")
    for document in (described, result.summary):
        to_json(document)
    if not np.isfinite(result.samples.body[result.samples.valid]).all():
        raise Excess("vectors that are no numbers")
    if not np.isfinite(result.estimates.q).all():
        raise Excess("an attitude that is no number")


@cache
def _flight():
    return readers.read(LOGS / "quadcopter.ulg")


@cache
def _configuration(name):
    return pipeline.configure(name)


@contextmanager
def bounds(size):
    """Bound time and address space."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + TIMES * size + ROOM
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGPROF, _late)
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    signal.setitimer(signal.ITIMER_PROF, TIMEOUT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.signal(signal.SIGPROF, handler)


def _late(*_):
    raise Excess(f"over {TIMEOUT} s")


def check(reader, number, path):
    """Return what became of a case: ``read``, ``refused``, or a traceback."""
    data = mutated(reader, number)
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            with bounds(len(data)):
                return attempt(path, reader)
        except Exception:  # noqa: BLE001  (whatever it is, it is the finding)
            return traceback.format_exc()


def warm(reader, folder):
    """Read the whole logs: what compiles or loads then is no cost of a case."""
    path = folder / "log"
    for data in seeds(reader):
        path.write_bytes(data)
        attempt(path, reader)


def work(reader, numbers, pipe):
    """Run cases in a process of its own, and send what becomes of each."""
    with tempfile.TemporaryDirectory() as folder:
        warm(reader, Path(folder))
        pipe.send(None)
        for number in numbers:
            pipe.send(check(reader, number, Path(folder) / "log"))


def supervise(reader, numbers, report):
    """Run cases, with a new process after one that hangs or dies."""
    context, left = multiprocessing.get_context("spawn"), list(numbers)
    while left:
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(reader, left, theirs))
        process.start()
        theirs.close()
        ours.poll(None)
        try:
            ours.recv()
            while left and ours.poll(WAIT):
                report(reader, left[0], ours.recv())
                del left[0]
            if left:
                report(reader, left.pop(0), f"hangs: {WAIT} s, and no signal ends it")
        except EOFError:
            process.join()
            report(reader, left.pop(0), f"the process died: exit code {process.exitcode}")
        process.kill()
        process.join()


class Report:
    """Counts outcomes, and tells each kind of finding once in full."""

    def __init__(self, out):
        self.out, self.counts, self.kinds = out, Counter(), Counter()
        self.lock = threading.Lock()

    def __call__(self, reader, number, outcome):
        with self.lock:
            bad = outcome not in {"read", "refused"}
            self.counts[reader, "BAD" if bad else outcome] += 1
            if bad:
                last = [line for line in outcome.splitlines() if line.strip()][-1]
                place = [line.strip() for line in outcome.splitlines() if "attest/" in line]
                kind = (reader, last[:80], place[-1] if place else "")
                self.kinds[kind] += 1
                if self.kinds[kind] == 1:
                    self._tell(f"\n--reader {reader} --case {number}\n{outcome}\n")
            done = sum(n for (name, _), n in self.counts.items() if name == reader)
            if done % 1000 == 0:
                self._tell(f"{reader} {done}: {self.of(reader)}\n")

    def of(self, reader):
        return {what: n for (name, what), n in self.counts.items() if name == reader}

    def _tell(self, text):
        self.out.write(text)
        self.out.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reader", choices=SUFFIXES, action="append")
    parser.add_argument("--count", type=int, default=COUNT, help="files for each reader")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--case", type=int, help="one file alone, in this process")
    parser.add_argument("--keep", type=Path, help="where to leave it")
    given = parser.parse_args()
    chosen, report = given.reader or list(SUFFIXES), Report(sys.stdout)
    if given.case is not None:
        with tempfile.TemporaryDirectory() as folder:
            warm(chosen[0], Path(folder))
            path = given.keep or Path(folder) / "log"
            sys.stdout.write(check(chosen[0], given.case, path) + "\n")
        return 0
    for reader in chosen:
        numbers = range(given.first, given.first + given.count)
        shares = [numbers[i :: given.workers] for i in range(given.workers)]
        threads = [threading.Thread(target=supervise, args=(reader, s, report)) for s in shares]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        sys.stdout.write(f"{reader}: {report.of(reader)}\n")
    for (reader, last, place), count in report.kinds.most_common():
        sys.stdout.write(f"{count:6d}  {reader}: {last}  {place}\n")
    return 1 if report.kinds else 0


if __name__ == "__main__":
    sys.exit(main())
