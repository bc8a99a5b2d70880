"""Cut, broken and hostile ROS logs: a part of them, or one line, and never more memory than due."""

import bz2
import random
import sqlite3
import struct
import time
import tracemalloc
from contextlib import suppress

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from ros_logs import IMU, KINDS, START, Log, compass, flight, xyz

from attest import readers
from attest.errors import ReadError
from attest.readers import ros_db3, ros_topics

MEGABYTE = 1 << 20


def doubts(recording):
    return {note.text: note.count for note in recording.notes if note.doubt}


def file_of(path):
    """Return the file of messages of a log."""
    if path.is_file():
        return path
    return next(inside for inside in path.iterdir() if inside.name != "metadata.yaml")


def record(fields, data=b""):
    """Return a record of a bag."""
    pairs = [name.encode() + b"=" + value for name, value in fields.items()]
    header = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


@pytest.mark.parametrize("kind", KINDS)
def test_a_cut_log_gives_what_is_in_it(tmp_path, kind):
    log = flight(Log(kind), count=2000, rate=200)
    path = file_of(log.write(tmp_path))
    whole = readers.read(path).signals["gyro"]
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    recording = readers.read(path)
    part = recording.signals["gyro"]
    assert 0.3 * len(whole.t) < len(part.t) < len(whole.t)
    np.testing.assert_array_equal(part.y, whole.y[: len(part.t)])
    assert doubts(recording)


def test_a_bag_that_was_not_closed(tmp_path):
    path = flight(Log("bag")).write(tmp_path)
    data = path.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    index = struct.unpack("<Q", data[at : at + 8])[0]
    path.write_bytes((data[:at] + bytes(8) + data[at + 8 :])[:index])
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 50
    assert doubts(recording) == {
        "bag without an index, as it was not closed: read from front to back": 1
    }


def test_an_mcap_without_a_footer_and_without_chunks(tmp_path):
    log = flight(Log("mcap-ros1"))
    path = log._mcap(tmp_path / "log.mcap", use_chunking=False)
    data = path.read_bytes()
    path.write_bytes(data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")])  # before the end of data
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 50
    assert doubts(recording) == {
        "MCAP that is cut, broken or was not closed: read as far as it goes": 1
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"#ROSBAG V2.0\n", "no message can be read. Record or copy the log again."),
        (b"\x89MCAP0\r\n", "no message can be read. Record or copy the log again."),
        (b"SQLite format 3\0" + bytes(2000), "no message can be read. Record or copy the log "
         "again."),
        (b"#ROSBAG V1.2\n", "not a log that attest knows (ros, ulog, dataflash, tlog, "
         "sensor_logger, csv). Check that it is the file you meant."),
    ],
)  # fmt: skip
def test_empty_containers(tmp_path, content, message):
    path = tmp_path / "log"
    path.write_bytes(content)
    with pytest.raises(ReadError) as caught:
        readers.read(path)
    assert str(caught.value) == f"{path}: {message}"


def test_a_log_without_a_gyroscope_says_what_it_holds(tmp_path):
    path = compass(Log()).write(tmp_path)
    with pytest.raises(ReadError) as caught:
        readers.read(path)
    assert str(caught.value) == (
        f"{path}: no gyroscope (sensor_msgs/Imu or px4_msgs/SensorCombined). The log holds: "
        "sensor_msgs/msg/MagneticField."
    )


def bomb_of_bz2(path, size):
    chunk = bz2.compress(bytes(size))
    data = b"#ROSBAG V2.0\n" + record(
        {"op": b"\x03", "index_pos": bytes(8), "conn_count": bytes(4), "chunk_count": bytes(4)}
    )
    head = {"op": b"\x05", "compression": b"bz2", "size": struct.pack("<I", size)}
    path.write_bytes(data + record(head, chunk))


def bomb_of_zstd(path, size):
    chunk = zstandard.ZstdCompressor().compress(bytes(size))
    body = struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(chunk)) + chunk
    header = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0)
    path.write_bytes(
        b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, len(header)) + header
        + struct.pack("<BQ", 6, len(body)) + body
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("bomb", [bomb_of_bz2, bomb_of_zstd])
def test_a_bomb_does_not_go_off(tmp_path, bomb):
    path = tmp_path / "bomb"
    bomb(path, 400 * MEGABYTE)
    tracemalloc.start()
    try:
        with pytest.raises(ReadError, match="no message can be read"):
            readers.read(path)
        assert tracemalloc.get_traced_memory()[1] < 300 * MEGABYTE
    finally:
        tracemalloc.stop()


def test_a_length_is_not_believed(tmp_path):
    path = tmp_path / "log.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + b"\xff\xff\xff\xff" + bytes(100))
    with pytest.raises(ReadError, match="no message can be read"):
        readers.read(path)
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 5, 1 << 62) + bytes(100))
    with pytest.raises(ReadError, match="no message can be read"):
        readers.read(path)
    log = flight(Log("mcap"))
    topic, kind, t, data = log.messages[7]
    log.messages[7] = (topic, kind, t, data[:12] + b"\xff\xff\xff\xff" + data[16:])
    recording = readers.read(log.write(tmp_path))
    assert len(recording.signals["gyro"].t) == 49
    assert {n.text: n.count for n in recording.notes} == {
        "/imu message that is not as defined, dropped": 1
    }


@pytest.mark.parametrize(
    "statement",
    [
        "DROP TABLE messages",
        "ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS WITH RECURSIVE "
        "r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) "
        "SELECT 1 AS topic_id, i AS timestamp, zeroblob(1000000) AS data FROM r",
        "ALTER TABLE messages ADD COLUMN more BLOB GENERATED ALWAYS AS (zeroblob(500000000))",
        "CREATE TABLE m AS SELECT * FROM messages; DROP TABLE messages; CREATE TABLE messages"
        "(id, topic_id, timestamp, data AS (zeroblob(400000000))); "
        "INSERT INTO messages SELECT id, topic_id, timestamp FROM m",
        "DROP TABLE messages; CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)",
        "UPDATE messages SET data = NULL, timestamp = 'soon'",
        "UPDATE topics SET type = x'00ff', name = 17",
    ],
)
def test_a_database_that_is_none_of_ros(tmp_path, statement):
    path = file_of(flight(Log("db3")).write(tmp_path))
    with sqlite3.connect(path) as connection:
        connection.executescript("PRAGMA ignore_check_constraints=1")
        try:
            connection.executescript(statement)
        except sqlite3.IntegrityError:
            connection.executescript("UPDATE messages SET data = 7, timestamp = 'soon'")
    connection.close()
    with pytest.raises(ReadError, match=f"{path}: no "):
        readers.read(path)


def test_a_definition_runs_nothing_and_may_be_anything(tmp_path):
    texts = [
        "my_msgs/Imu header\n" + "=" * 80 + "\nMSG: my_msgs/Imu\nmy_msgs/Imu again\n",  # endless
        "float64[4000000000] x\n",
        "string header\nstring angular_velocity\n",
        "std_msgs/Header header\nfloat64 angular_velocity\n",
        "string x='__import__(\"os\").abort()'\n",
    ]
    log = Log("mcap-ros1")
    path = flight(log).write(tmp_path)
    text, _ = log.store.generate_msgdef(IMU)
    for other in texts:
        log.store.generate_msgdef = lambda _, other=other: (other, "")
        log._mcap(path, CompressionType.NONE)
        with pytest.raises(ReadError, match="no gyroscope"):
            readers.read(path)
    assert "angular_velocity" in text


@pytest.mark.parametrize("kind", KINDS)
def test_any_change_gives_a_recording_or_one_line(tmp_path, kind):
    log = compass(flight(Log(kind), count=30), count=10)
    for t in range(3):
        log.add("/poses", "geometry_msgs/msg/PoseArray", t, poses=[{"position": xyz(1, 2, 3)}])
    path = file_of(log.write(tmp_path))
    whole, chance = path.read_bytes(), random.Random(7)  # noqa: S311
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(chance.choice([1, 3, 20])):
            at = chance.randrange(13, len(data))
            data[at] = chance.choice([0, 1, 0x7F, 0xFF, chance.randrange(256)])
        if chance.random() < 0.3:
            at, size = chance.randrange(len(data)), chance.randrange(1, 60)
            data[at : at + size] = chance.choice([b"", bytes(size), b"\xff" * size])
        path.write_bytes(data)
        with suppress(ReadError):
            # points that stand alone are a recording too
            assert all(len(one.t) <= 30 for one in readers.read(path).signals.values())


def test_a_folder_that_lacks_a_file_says_so(tmp_path):
    path = flight(Log("db3")).write(tmp_path)
    text = (
        (path / "metadata.yaml")
        .read_text()
        .replace("- log_db3.db3", "- log_db3.db3\n  - gone_1.db3")
    )
    (path / "metadata.yaml").write_text(text)
    recording = readers.read(path)
    assert doubts(recording) == {"gone_1.db3, which metadata.yaml names, is not in the folder": 1}
    (path / "metadata.yaml").write_text(":\n- [")
    assert recording.signals["gyro"].t[0] == readers.read(path).signals["gyro"].t[0] == START


@pytest.mark.parametrize("kind", KINDS)
def test_a_long_log_is_decoded_in_blocks_to_the_same(tmp_path, monkeypatch, kind):
    log = compass(flight(Log(kind), count=300), count=150)
    for t in range(3):
        log.add("/poses", "geometry_msgs/msg/PoseArray", t, poses=[{"position": xyz(1, 2, 3)}])
    path = log.write(tmp_path)
    whole = readers.read(path)
    monkeypatch.setattr(ros_topics, "BLOCK", 5000)
    monkeypatch.setattr(ros_db3, "_ROWS", 20)
    parts = readers.read(path)
    assert parts.notes == whole.notes
    for name, signal in whole.signals.items():
        np.testing.assert_array_equal(parts.signals[name].t, signal.t)
        np.testing.assert_array_equal(parts.signals[name].y, signal.y)


def test_a_log_that_unpacks_to_far_more_than_its_size_is_read_in_part(tmp_path, monkeypatch):
    path = flight(Log("mcap-ros1"), count=3000).write(tmp_path)
    monkeypatch.setattr(ros_topics, "BLOCK", 5000)
    assert len(readers.read(path).signals["gyro"].t) == 3000
    monkeypatch.setattr(ros_topics, "ROOM", (1, 0))
    recording = readers.read(path)
    assert 100 < len(recording.signals["gyro"].t) < 3000
    assert doubts(recording) == {"log that unpacks to far more than its size, read in part": 1}


def test_definitions_that_never_end_are_not_asked_for(tmp_path):
    path = file_of(flight(Log("db3")).write(tmp_path))
    with sqlite3.connect(path) as connection:
        connection.executescript(
            "DROP TABLE message_definitions; CREATE VIEW message_definitions AS WITH RECURSIVE "
            "r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) SELECT 'a' AS topic_type, "
            "'ros2msg' AS encoding, i AS encoded_message_definition FROM r"
        )
    connection.close()
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 50


def test_numbers_that_no_sensor_measures_are_dropped_and_counted(tmp_path):
    log = flight(Log("bag"))
    for i in range(50):
        x = (1e300, float("inf"))[i] if i < 2 else 1.0
        log.add("/velocity", "geometry_msgs/msg/TwistStamped", i * 10**7, 1000, "map",
                twist={"linear": xyz(x, 2.0, 3.0)})  # fmt: skip
    recording = readers.read(log.write(tmp_path))
    assert len(recording.signals["velocity"].t) == 48
    counts = {note.text: note.count for note in recording.notes}
    assert counts["/velocity velocity beyond 1e+09 dropped"] == 1
    assert counts["/velocity velocity not finite dropped"] == 1


def test_a_chunk_of_zeros_is_not_walked_as_records(tmp_path):
    path = flight(Log("mcap-ros1")).write(tmp_path)
    data = path.read_bytes()
    zeros = bytes(MEGABYTE)
    packed = zstandard.compress(zeros)
    body = struct.pack("<QQQI", 0, 0, len(zeros), 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(packed)) + packed
    at = 8 + 9 + struct.unpack_from("<Q", data, 9)[0]
    path.write_bytes(data[:at] + b"\x06" + struct.pack("<Q", len(body)) + body + data[at:])
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 50
    assert doubts(recording) == {"chunk broken within, its rest left out": 1}
    path.write_bytes(data[:at] + zeros)  # as a recorder leaves a file that it made room for
    with pytest.raises(ReadError):
        readers.read(path)


def test_metadata_made_to_be_slow_costs_nothing(tmp_path):
    path = flight(Log("mcap")).write(tmp_path)
    (path / "metadata.yaml").write_text("a: b\n" * 200_000)
    before = time.process_time()
    assert len(readers.read(path).signals["gyro"].t) == 50
    assert time.process_time() - before < 5.0  # a parser of YAML takes over 20


def test_rows_of_a_database_that_share_their_pages_do_not_fill_the_memory():
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE messages(topic_id, timestamp, data)")
    long = [1, 2, bytes(MEGABYTE)]
    connection.executemany("INSERT INTO messages VALUES (?, ?, ?)", [[1, 1, b"short"], long] * 50)
    batches = [*ros_db3._batches(connection, [1])]
    assert max(sum(map(len, data)) for _, _, data in batches) < 10 * MEGABYTE
    rows = [row for columns in batches for row in zip(*columns, strict=True)]
    assert rows == [(1, 1, b"short"), (1, 2, bytes(MEGABYTE))] * 50


def test_a_long_row_that_is_broken_costs_none_before_it():
    rows = [(1, 1, b"short"), (1, 2, 7)]  # the second is longer: its place stands for it

    class Broken:
        def execute(self, *_):
            raise MemoryError

    batches = ros_db3._with_long(Broken(), rows)
    assert next(batches) == ((1,), (1,), (b"short",))
    with pytest.raises(MemoryError):
        next(batches)


def test_a_row_for_which_sqlite_finds_no_memory_is_damage(tmp_path, monkeypatch):
    path = file_of(flight(Log("db3")).write(tmp_path))

    def fetch(cursor, rows):
        rows.extend(cursor.fetchmany(20))
        raise MemoryError

    monkeypatch.setattr(ros_db3, "_fetch", fetch)
    recording = readers.read(path)
    assert len(recording.signals["gyro"].t) == 20
    text = "database broken (a row that does not fit into it), read as far as it goes"
    assert doubts(recording) == {text: 1}
