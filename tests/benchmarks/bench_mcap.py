"""How quickly an MCAP is written, against the library's writer of one message at a time.

    python tests/benchmarks/bench_mcap.py [--estimates 20000] [--messages 100000]

Prints microseconds and bytes per message of a whole write, disk included, and of
``mcap.writer.Writer.add_message`` with messages that are encoded already.
"""

import argparse
import sys
import tempfile
import time
from itertools import islice
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

sys.path.insert(0, str(Path(__file__).parents[1]))

from results import result

from attest.writers.mcap import write_mcap


def per_message(seconds: float, path: Path) -> tuple[int, str]:
    """Count the messages of a file, and say what one of them took."""
    with path.open("rb") as file:
        count = make_reader(file).get_summary().statistics.message_count
    size = path.stat().st_size / count
    return count, f"{seconds / count * 1e6:6.2f} µs and {size:5.1f} bytes per message"


def by_library(source: Path, out: Path, most: int) -> float:
    """Write the first messages of a file by ``add_message``, and time that alone."""
    with source.open("rb") as file:
        messages = islice(make_reader(file).iter_messages(), most)
        every = [(channel, message) for _, channel, message in messages]
    with out.open("wb") as file:
        began = time.perf_counter()
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start("ros2")
        ids = {}
        for channel, message in every:
            if channel.id not in ids:
                ids[channel.id] = writer.register_channel(channel.topic, "cdr", 0)
            writer.add_message(
                ids[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()
        return time.perf_counter() - began


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--estimates", type=int, default=20_000, help="ten messages each")
    parser.add_argument("--messages", type=int, default=100_000, help="for the library's writer")
    given = parser.parse_args()
    made = result(given.estimates, rate=200.0)
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = Path(folder, "ours.mcap"), Path(folder, "theirs.mcap")
        taken = []
        for _ in range(3):
            began = time.perf_counter()
            write_mcap(ours, [made])
            taken.append(time.perf_counter() - began)
        count, figures = per_message(min(taken), ours)
        sys.stdout.write(f"attest        {count:8d} messages: {figures}\n")
        count, figures = per_message(by_library(ours, theirs, given.messages), theirs)
        sys.stdout.write(f"mcap.Writer   {count:8d} messages: {figures}\n")


if __name__ == "__main__":
    main()
