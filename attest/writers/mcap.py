"""MCAP, the lossless output, for Foxglove, Lichtblick, PlotJuggler, Rerun, rosbags and evo.

Message time (log, publish and header stamp alike) is UTC where the log allows it, else the log's
clock. ROS stamps neither before 1970 nor after 2038: times that do not fit are counted from the
first message, and the metadata ``attest/clock`` says so.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml
from mcap.opcode import Opcode
from numpy.typing import NDArray

from attest import __version__
from attest.files import replacing
from attest.recording import Clock
from attest.result import Result
from attest.writers import mcap_file
from attest.writers.cdr import Field, repeat, row
from attest.writers.json import clean, plain, to_json
from attest.writers.mcap_file import Rows
from attest.writers.ros2_messages import definition
from attest.writers.topics import Stream, streams

CHUNK_SIZE = 1 << 20
"""Bytes before compression."""
SECOND = 1_000_000_000
LAST_STAMP = (2**31 - 1) * SECOND
"""The seconds of a ROS stamp are an int32."""

RECORD = (
    Field("opcode", "u1", value=Opcode.MESSAGE),
    Field("length", "<u8"),
    Field("channel", "<u2"),
    Field("sequence", "<u4"),
    Field("log_time", "<u8"),
    Field("publish_time", "<u8"),
)
"""What stands before the content of a message in MCAP."""
UNCOUNTED = 9
"""Bytes of a record before those that its length counts."""


def write_mcap(path: Path, results: Sequence[Result]) -> None:
    """Write everything about the runs over one log, as ROS 2 messages.

    Raises
    ------
    WriteError
        The system refuses to write.
    """
    every = streams(results)
    first = min((int(stream.t[0]) for stream in every), default=0)
    last = max((int(stream.t[-1]) for stream in every), default=0)
    offset, clock = _message_clock(results[0].recording.clock, first, last)
    with replacing(path) as part, part.open("wb") as stream:
        file = mcap_file.start(stream, f"attest {__version__}")
        topics = {stream.topic: stream.schema for stream in every}
        mcap_file.add_channels(file, topics, {name: definition(name) for name in topics.values()})
        for parts in _chunks(every, list(topics), offset):
            mcap_file.add_chunk(file, parts)
        for result in results:
            content = yaml.safe_dump(
                plain(result.configuration), sort_keys=False, allow_unicode=True
            )
            name = (
                f"{clean(result.estimates.observer)}.yaml"
                if len(results) > 1
                else "configuration.yaml"
            )
            mcap_file.add_attachment(
                file, name, "application/yaml", content.encode(), first + offset
            )
        for name, entries in {**_metadata(results), "attest/clock": clock}.items():
            mcap_file.add_metadata(file, name, entries)
        mcap_file.finish(file)


def _message_clock(clock: Clock, first: int, last: int) -> tuple[int, dict[str, str]]:
    """Choose what to add to the recording's clock, and say in words what that gives."""
    offset = clock.utc_offset or 0
    words = "log's clock" if clock.utc_offset is None else "UTC since 1970"
    if first + offset < 0 or last + offset > LAST_STAMP:
        offset, words = -first, "since the first message, because a ROS stamp cannot hold the time"
    return offset, {
        "message_time": words,
        "message_time_minus_log_clock_ns": str(offset),
        "log_clock": clean(clock.name),
        "utc_minus_log_clock_ns": "unknown" if clock.utc_offset is None else str(clock.utc_offset),
    }


def _chunks(every: Sequence[Stream], topics: list[str], offset: int) -> Iterator[list[Rows]]:
    """Lay out chunk by chunk; all streams are cut at the same times."""
    templates = [_template(stream, topics.index(stream.topic) + 1) for stream in every]
    cuts = _cuts(every, [template.itemsize for template in templates])
    for i in range(len(cuts[0]) - 1 if cuts else 0):
        yield [
            _rows(stream, template, slice(cut[i], cut[i + 1]), offset)
            for stream, template, cut in zip(every, templates, cuts, strict=True)
            if cut[i] < cut[i + 1]
        ]


def _cuts(every: Sequence[Stream], sizes: Sequence[int]) -> list[NDArray[np.intp]]:
    """Tell for each stream where its chunks begin, and its end."""
    if not every:
        return []
    longest = max((stream.t for stream in every), key=len)
    total = sum(len(stream.t) * size for stream, size in zip(every, sizes, strict=True))
    count = min(-(-total // CHUNK_SIZE), len(longest))
    edges = longest[np.arange(1, count) * len(longest) // count]
    inner = [np.searchsorted(stream.t, edges) for stream in every]
    return [np.array([0, *cut, len(s.t)], np.intp) for s, cut in zip(every, inner, strict=True)]


def _template(stream: Stream, channel: int) -> NDArray[np.void]:
    one = row(stream.fields, before=RECORD)
    one["length"] = one.itemsize - UNCOUNTED
    one["channel"] = channel
    return one


def _rows(stream: Stream, template: NDArray[np.void], part: slice, offset: int) -> Rows:
    """Lay out some messages of a stream; their sequence counts within it."""
    t = stream.t[part] + offset
    records = repeat(template, len(t))
    records["log_time"] = records["publish_time"] = t
    records["sec"], records["nanosec"] = np.divmod(t, SECOND)
    records["sequence"] = np.arange(part.start, part.stop)
    for name, values in stream.columns.items():
        records[name] = values[part]
    return Rows(int(template["channel"][0]), t, records)


def _metadata(results: Sequence[Result]) -> dict[str, dict[str, str]]:
    """Spell summaries and configurations; of several runs, each under its observer's name."""
    found = {"attest/versions": dict(_flat(results[0].summary.get("versions", {})))}
    for result in results:
        # less the timing, so that equal runs give equal bytes
        summary = {key: value for key, value in result.summary.items() if key != "timing"}
        whose = f"/{clean(result.estimates.observer)}" if len(results) > 1 else ""
        found[f"attest/summary{whose}"] = dict(_flat(summary))
        found[f"attest/configuration{whose}"] = dict(_flat(result.configuration))
    return found


def _flat(value: object, path: str = "") -> Iterator[tuple[str, str]]:
    """Spell nested mappings as pairs of text, keys joined by dots, all but text as JSON."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{path}.{key}" if path else str(key))
    else:
        yield clean(path), clean(value if isinstance(value, str) else to_json(value))
