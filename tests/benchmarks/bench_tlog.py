"""How quickly a telemetry log is read, against pymavlink, in one run.

    python tests/benchmarks/bench_tlog.py LOG [--megabytes 100] [--pymavlink-megabytes 10]

Repeats the log's frames, with stamps and boot times that go on, until the file is as long as
wanted; reads it whole here and its beginning with pymavlink's ``recv_match``, both for the same
message types; prints rates, their ratio and the highest memory use.
"""

import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from against_pymavlink import arguments, pymavlink_rate, report
from pymavlink.dialects.v20 import ardupilotmega

TIMES = {"time_boot_ms": 1_000, "time_usec": 1}
"""Microseconds per count of the fields that must go on."""


def frames(log: Path) -> Iterator[tuple[int, ardupilotmega.MAVLink_message]]:
    """Stamp and message of each frame of a sound log."""
    data, parser, at = log.read_bytes(), ardupilotmega.MAVLink(None), 0
    parser.robust_parsing = True
    while at + 16 < len(data):
        size = data[at + 9] + (12 if data[at + 8] == 0xFD else 8)
        message = parser.parse_char(data[at + 8 : at + 8 + size])
        if message is not None and message.get_type() != "BAD_DATA":
            yield struct.unpack(">Q", data[at : at + 8])[0], message
        at += 8 + size


def lengthened(log: Path, size: int, out: Path) -> None:
    """Write the log over and over, each time later than before."""
    flight = list(frames(log))
    boots = [message.time_boot_ms for _, message in flight if hasattr(message, "time_boot_ms")]
    span = max(flight[-1][0] - flight[0][0], 1_000 * (max(boots) - min(boots))) + 250_000
    writers = {True: ardupilotmega.MAVLink(None), False: ardupilotmega.MAVLink(None)}
    with out.open("wb") as file:
        turn = 0
        while file.tell() < size:
            for stamp, message in flight:
                old = message.get_msgbuf()[0] == 0xFE
                writer = writers[old]
                writer.srcSystem, writer.srcComponent = (
                    message.get_srcSystem(),
                    message.get_srcComponent(),
                )
                later = type(message)(*(_later(message, name, turn * span)
                                        for name in message.fieldnames))  # fmt: skip
                file.write(struct.pack(">Q", stamp + turn * span))
                file.write(later.pack(writer, force_mavlink1=old))
            turn += 1


def _later(message: ardupilotmega.MAVLink_message, name: str, micros: int) -> object:
    value = getattr(message, name)
    if name in TIMES and message.fieldtypes[message.fieldnames.index(name)] != "uint32_t":
        return value + micros
    if name in TIMES:
        return (value + micros // TIMES[name]) % 2**32
    return value.encode() if isinstance(value, str) else value


def opened(log: str) -> closing:
    """Open a log with the library."""
    from pymavlink import mavutil

    # never mavlink_connection: it opens ports and runs programs for some paths
    return closing(mavutil.mavlogfile(log))


def main() -> None:
    """Measure and print."""
    from attest.readers.tlog import WANTED

    args = arguments(__doc__, "a tlog to make a long one from").parse_args()
    with tempfile.TemporaryDirectory() as folder:
        long, part = Path(folder) / "long.tlog", Path(folder) / "part.tlog"
        lengthened(args.log, int(args.megabytes * 1e6), long)
        with long.open("rb") as file:
            part.write_bytes(file.read(int(args.pymavlink_megabytes * 1e6)))
        report(long, args.rounds, lambda: pymavlink_rate(part, opened, set(WANTED)))


if __name__ == "__main__":
    main()
