"""Frames and fields against pymavlink, the definition, on sound and on damaged bytes."""

import math
import os
import struct
from contextlib import closing

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.mavutil import x25crc

from attest.readers import mavlink, mavlink_frames, mavlink_scan, tlog

os.environ["MAVLINK20"] = "1"
mavutil.set_dialect("ardupilotmega")  # another test may have imported it as of MAVLink 1

LOGS = ["bluerov2", "bluerov2_bad_crc", "attitude_only", "quadplane_sitl", "one_message"]


def pymavlink_messages(path):
    """What pymavlink's own log reader gives, in its order."""
    found = []
    with closing(mavutil.mavlogfile(str(path))) as log:
        while (message := log.recv_match()) is not None:
            if message.get_type() in tlog.WANTED:
                found.append(key_of_pymavlink(message))
    return found


def parser_messages(path):
    """What pymavlink's parser gives that knows of no stamps, and so recovers more."""
    parser = ardupilotmega.MAVLink(None)
    parser.robust_parsing = True
    found = parser.parse_buffer(path.read_bytes()) or []
    return [key_of_pymavlink(m) for m in found if m.get_type() in tlog.WANTED]


def key_of_pymavlink(message):
    sender = message.get_srcSystem() << 8 | message.get_srcComponent()
    fields = (getattr(message, name) for name in type(message).ordered_fieldnames)
    return message.get_type(), sender, tuple(comparable(value) for value in fields)


def comparable(value):
    """A field's bits as something that equals itself, also where it is not a number."""
    if isinstance(value, list):
        return tuple(comparable(item) for item in value)
    if isinstance(value, bytes):
        return value.partition(b"\0")[0].decode("latin-1")  # as pymavlink gives it
    return "nan" if isinstance(value, float) and math.isnan(value) else value


def own_messages(scan):
    """The same from our tables, by place in the file."""
    found = []
    for name, table in scan.tables.items():
        columns = [table.rows[field].tolist() for field in table.rows.dtype.names]
        for at, sender, *values in zip(table.at, table.sender, *columns, strict=True):
            key = (name, int(sender), tuple(comparable(value) for value in values))
            found.append((int(at), key))
    return sorted(found)


def is_frame(data, at):
    """Whether a frame with a right checksum begins here, byte by byte."""
    second = data[at] == 0xFD
    number = int.from_bytes(data[at + 7 : at + 10], "little") if second else data[at + 5]
    end = at + data[at + 1] + (10 if second else 6)
    crc = x25crc(data[at + 1 : end] + bytes([ardupilotmega.mavlink_map[number].crc_extra]))
    return crc.crc == int.from_bytes(data[end : end + 2], "little")


def check_against_pymavlink(path):
    """Everything pymavlink finds is found, in order; whatever else is found is sound."""
    data, scan = path.read_bytes(), mavlink_scan.scan(path, tlog.WANTED)
    own = own_messages(scan)
    found = [pymavlink_messages(path), parser_messages(path)]
    for theirs in found:
        position = 0
        for _, key in own:
            position += position < len(theirs) and key == theirs[position]
        assert position == len(theirs), f"missed {theirs[position]} of {path}"
    assert all(is_frame(data, at) for at, _ in own)
    return len(own), max(map(len, found))


def damaged(data, kind, seed, count=60):
    """Hurt a log in some places."""
    rng, out = np.random.default_rng(seed), bytearray(data)
    for _ in range(count):
        at, size = int(rng.integers(len(out))), int(rng.integers(1, 40))
        if kind == "flip":
            out[at] ^= 1 << int(rng.integers(8))
        elif kind == "delete":
            del out[at : at + size]
        elif kind == "insert":
            out[at:at] = rng.bytes(size)
        else:
            out[at : at + size] = bytes(len(out[at : at + size]))
    return bytes(out)


@pytest.mark.shared
@pytest.mark.parametrize("name", LOGS)
def test_every_field_equals_pymavlink(shared, name):
    own, theirs = check_against_pymavlink(shared / "tlog" / f"{name}.tlog")
    assert own == theirs


@pytest.mark.shared
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["flip", "delete", "insert", "zero"])
@pytest.mark.parametrize("name", ["quadplane_sitl", "bluerov2_bad_crc", "bluerov2"])
def test_nothing_that_pymavlink_finds_in_a_damaged_log_is_missed(
    shared, tmp_path, name, kind, seed
):
    data = (shared / "tlog" / f"{name}.tlog").read_bytes()[:300_000]
    hurt = tmp_path / "hurt.tlog"
    hurt.write_bytes(damaged(data, kind, seed))
    own, theirs = check_against_pymavlink(hurt)
    assert own >= theirs


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "frames", "size"),
    [("bluerov2", 4, 315), ("bluerov2_bad_crc", 1967, 82_615), ("quadplane_sitl", 0, 0)],
)
def test_bad_frames_are_counted(shared, name, frames, size):
    damage = mavlink_scan.scan(shared / "tlog" / f"{name}.tlog", tlog.WANTED).damage
    assert damage == mavlink_scan.Damage(frames, 0, size)


@pytest.mark.shared
def test_small_blocks_give_the_same(shared, monkeypatch):
    path = shared / "tlog" / "bluerov2_bad_crc.tlog"
    whole = mavlink_scan.scan(path, tlog.WANTED)
    monkeypatch.setattr(mavlink_scan, "BLOCK", 30_000)
    parts = mavlink_scan.scan(path, tlog.WANTED)
    assert own_messages(parts) == own_messages(whole)
    assert parts.counts == whole.counts
    assert parts.damage == whole.damage


def packed(message, first=False, sign=False, sender=(1, 1)):
    """One frame as pymavlink writes it."""
    writer = ardupilotmega.MAVLink(None, *sender)
    if sign:
        writer.signing.secret_key = b"k" * 32
        writer.signing.sign_outgoing = True
    return bytes(message.pack(writer, force_mavlink1=first))


def stamped(*frames, start=1_700_000_000_000_000):
    return b"".join(struct.pack(">Q", start + 1000 * i) + f for i, f in enumerate(frames))


def scanned(tmp_path, data):
    path = tmp_path / "log"
    path.write_bytes(data)
    return mavlink_scan.scan(path, tlog.WANTED)


ATTITUDE = ardupilotmega.MAVLink_attitude_message(1234, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0)
RAW = ardupilotmega.MAVLink_raw_imu_message(2**40, 1, -2, 3, 4, 5, 6, 7, 8, 9, id=3, temperature=-5)


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("prefix", [b"", struct.pack(">Q", 1_700_000_000_000_000)])
def test_both_versions_with_and_without_stamps(tmp_path, first, prefix):
    data = b"".join(prefix + packed(message, first) for message in (ATTITUDE, RAW) * 5)
    scan = scanned(tmp_path, data)
    assert scan.stamped == bool(prefix)
    assert len(scan.tables["ATTITUDE"]) == len(scan.tables["RAW_IMU"]) == 5
    row = scan.tables["RAW_IMU"].rows[-1]
    assert row["time_usec"] == 2**40
    assert row["zmag"] == 9
    assert (row["id"], row["temperature"]) == (3, -5)
    assert scan.damage == mavlink_scan.Damage()


def test_payloads_shorter_and_longer_than_the_message(tmp_path):
    payload = packed(RAW, first=True)[6:-2]
    frames = []
    for cut in (payload[:26], payload[:5], payload + b"tail"):  # without extensions, torn, longer
        body = bytes([len(cut), 0, 1, 1, type(RAW).id]) + cut
        frames.append(b"\xfe" + body + struct.pack("<H", x25crc(body + bytes([RAW.crc_extra])).crc))
    path = tmp_path / "log"
    path.write_bytes(stamped(*frames))
    assert check_against_pymavlink(path) == (3, 3)
    rows = mavlink_scan.scan(path, tlog.WANTED).tables["RAW_IMU"].rows
    assert rows["temperature"].tolist() == [0, 0, -5]
    assert rows["zmag"].tolist() == [9, 0, 9]


def test_signed_frames_and_zeros_left_out(tmp_path):
    frame = packed(ATTITUDE, sign=True)
    assert frame[2] == 1
    assert frame[1] < 28
    table = scanned(tmp_path, stamped(frame, packed(RAW), frame)).tables["ATTITUDE"]
    assert table.rows["yaw"].tolist() == [np.float32(0.3)] * 2
    assert table.rows["yawspeed"].tolist() == [0.0, 0.0]
    assert table.arrival.tolist() == [1_700_000_000_000_000, 1_700_000_000_002_000]


def test_unknown_flag_is_no_frame(tmp_path):
    frame = bytearray(packed(ATTITUDE))
    frame[2] = 2
    crc = x25crc(frame[1:-2] + bytes([ATTITUDE.crc_extra])).crc
    frame[-2:] = struct.pack("<H", crc)
    scan = scanned(tmp_path, stamped(packed(RAW), bytes(frame), packed(RAW)))
    assert "ATTITUDE" not in scan.tables
    assert scan.damage.bad_frames == 1


def unknown_frame(payload, number=9_999):
    return (
        bytes([0xFD, len(payload), 0, 0, 7, 1, 1, *number.to_bytes(3, "little")]) + payload + b"??"
    )


def test_unknown_messages_are_skipped_by_their_length_and_counted(tmp_path):
    inner = packed(ATTITUDE)
    frames = [packed(RAW), unknown_frame(inner), unknown_frame(b"x"), packed(RAW)]
    scan = scanned(tmp_path, stamped(*frames))
    assert scan.damage == mavlink_scan.Damage(unknown_frames=2)
    assert "ATTITUDE" not in scan.tables, "a frame inside another one's payload is not one"


def test_frame_inside_a_sound_frame_is_not_one(tmp_path):
    tunnel = ardupilotmega.MAVLink_tunnel_message(
        1, 1, 0, len(packed(ATTITUDE)), list(packed(ATTITUDE).ljust(128, b"\0"))
    )
    scan = scanned(tmp_path, stamped(packed(RAW), packed(tunnel), packed(RAW)))
    assert set(scan.tables) == {"RAW_IMU"}
    assert scan.damage == mavlink_scan.Damage()


def test_truncated_log(tmp_path):
    scan = scanned(tmp_path, stamped(packed(RAW), packed(RAW))[:-3])
    assert len(scan.tables["RAW_IMU"]) == 1
    assert scan.damage.bad_frames == 1


def test_every_dtype_has_the_size_of_the_message():
    dialect = mavlink.dialect()
    for number, message in ardupilotmega.mavlink_map.items():
        assert dialect.dtypes[number].itemsize == message.unpacker.size, message.msgname


@given(st.binary(max_size=300))
def test_checksum_is_that_of_pymavlink(payload):
    frame = unknown_frame(payload[:255], number=ATTITUDE.id)
    crc = struct.pack("<H", x25crc(frame[1:-2] + bytes([ATTITUDE.crc_extra])).crc)
    found = mavlink_frames.checked_frames(np.frombuffer(frame[:-2] + crc, np.uint8))
    assert 0 in found.at.tolist()


def test_dense_marks_are_looked_at_in_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(mavlink_frames, "MARKS", 1000)
    data = b"\xfe" * 20_000 + stamped(*[packed(RAW)] * 3) + b"\xfd" * 20_000
    assert len(scanned(tmp_path, data).tables["RAW_IMU"]) == 3
