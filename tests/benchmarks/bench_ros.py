"""How quickly ROS logs are read, against rosbags' AnyReader, in one run.

    python tests/benchmarks/bench_ros.py [--messages 200000] [--rounds 3]

Writes `sensor_msgs/Imu` messages as a ROS 1 bag, a ROS 2 database and an MCAP; reads each whole
here, up to the recording, and with AnyReader and its deserializer; prints messages per second,
their ratio and the highest memory use.
"""

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

from rosbags.highlevel import AnyReader

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from ros_logs import Log, flight

KINDS = ("bag", "db3", "mcap")


def own_rate(log: Path) -> float:
    """Messages per second of the whole reader."""
    from attest import readers

    start = time.perf_counter()
    recording = readers.read(log)
    return len(recording.signals["gyro"].t) / (time.perf_counter() - start)


def rosbags_rate(log: Path) -> float:
    """Messages per second of AnyReader and its deserializer."""
    start, count = time.perf_counter(), 0
    with AnyReader([log]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count / (time.perf_counter() - start)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=200_000)
    parser.add_argument("--rounds", type=int, default=3, help="of which the quickest counts")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            log = flight(Log(kind), count=args.messages, rate=1000).write(Path(folder))
            _report(kind, log, args.rounds)


def _report(kind: str, log: Path, rounds: int) -> None:
    own_rate(log)  # imports what is needed
    own = max(own_rate(log) for _ in range(rounds))
    theirs = max(rosbags_rate(log) for _ in range(2))
    # again, so that a machine that grew slower or quicker meanwhile favours neither
    own = max(own, *(own_rate(log) for _ in range(rounds)))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    sys.stdout.write(
        f"{kind:5s} attest {own:9,.0f}/s  rosbags {theirs:9,.0f}/s  ratio {own / theirs:4.1f}  "
        f"peak memory {peak:.0f} MB\n"
    )


if __name__ == "__main__":
    main()
