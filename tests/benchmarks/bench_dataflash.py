"""How quickly an on-board log of ArduPilot is read, against pymavlink, in one run.

    python tests/benchmarks/bench_dataflash.py LOG [--megabytes 100] [--pymavlink-megabytes 10]

Repeats the log's messages, but for parameters, of which a flight has one set, with times that go
on, until the file is as long as wanted; reads it whole here and its beginning with pymavlink's
``recv_match``, both for the same message types; prints rates, their ratio and the highest memory
use. With ``--text`` it does so for text.
"""

import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
from against_pymavlink import arguments, pymavlink_rate, report
from pymavlink import DFReader


def lengthened(log: Path, size: int, out: Path) -> None:
    """Write the log's messages over and over, each time later than before."""
    from attest.readers import dataflash_scan as scan

    data = np.frombuffer(log.read_bytes(), np.uint8)
    places = scan.marks(data)
    defined = scan.definitions(data, places)
    frames = scan._sound(data, scan._candidates(data, places, defined), defined)
    micros, timed = scan._micros(data, frames, defined)
    told = [given[-1][1].name in ("FMT", "FMTU", "UNIT", "MULT", "PARM") for given in
            (defined[kind] for kind in frames.kind.tolist())]  # fmt: skip
    span = int(np.ptp(micros[timed])) + 20_000
    turning = timed & ~np.array(told)
    body, head = (
        np.concatenate([data[a:b] for a, b in zip(frames.at[of], frames.end[of], strict=True)])
        for of in (turning, ~turning)
    )
    lengths = (frames.end - frames.at)[turning]
    cells = (np.cumsum(lengths) - lengths + scan.HEADER)[:, np.newaxis] + np.arange(8)
    stamps = body[cells].copy().view("<u8")
    with out.open("wb") as file:
        file.write(head)
        for turn in range(max(1, (size - len(head)) // len(body))):
            body[cells] = (stamps + np.uint64(turn * span)).view(np.uint8)
            file.write(body)


def as_text(log: Path, out: Path) -> None:
    """Write a binary log as text."""
    with closing(DFReader.DFReader_binary(str(log))) as reader, out.open("w") as file:
        while (message := reader.recv_msg()) is not None:
            values = [str(getattr(message, name)) for name in message.get_fieldnames()]
            file.write(", ".join([message.get_type(), *values]) + "\n")


def main() -> None:
    """Measure and print."""
    from attest.readers.dataflash_signals import WANTED

    parser = arguments(__doc__, "a binary log to make a long one from")
    parser.add_argument("--text", action="store_true", help="measure the text format")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        long, part = Path(folder) / "long.BIN", Path(folder) / "part.BIN"
        lengthened(args.log, int(args.megabytes * 1e6), long)
        lengthened(args.log, int(args.pymavlink_megabytes * 1e6), part)
        if args.text:
            for path in (long, part):
                as_text(path, path.with_suffix(".log"))
            long, part = long.with_suffix(".log"), part.with_suffix(".log")
        report(long, args.rounds, lambda: pymavlink_rate(part, opened, set(WANTED)))


def opened(log: str) -> closing:
    """Open a binary or text log with the library."""
    text = log.endswith(".log")
    return closing(DFReader.DFReader_text(log) if text else DFReader.DFReader_binary(log))


if __name__ == "__main__":
    main()
