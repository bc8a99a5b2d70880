"""An on-board log of ArduPilot: DataFlash messages that describe themselves first.

What the link lost is lost here too: the card was busy then.
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from attest.geometry import gps, quaternion
from attest.recording import Signal
from attest.simulation.flight import Array, Flight, Times, believed, following

_NEEDED = ("gyro", "accel", "mag", "position", "velocity")
_TYPES = {
    "B": "u1", "b": "i1", "H": "<u2", "h": "<i2", "I": "<u4", "i": "<i4", "f": "<f4", "d": "<f8",
    "Q": "<u8", "c": "<i2", "C": "<u2", "e": "<i4", "L": "<i4", "n": "S4", "N": "S16", "Z": "S64",
}  # fmt: skip
_SCALES = {"c": 1e2, "C": 1e2, "e": 1e2, "L": 1e7}
_UNITS = {"-": "", "s": "s", "#": "instance", "E": "rad/s", "o": "m/s/s", "G": "Gauss", "d": "deg",
          "h": "degheading", "n": "m/s", "m": "m", "D": "deglatitude", "U": "deglongitude",
          "O": "degC", "z": "Hz", "S": "satellites"}  # fmt: skip
_MULTIPLIERS = {"-": 0.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}


class _Kind(NamedTuple):
    """One message type, as ArduPilot 4 has it."""

    number: int
    chars: str
    columns: str
    units: str
    multipliers: str


_KINDS = {
    "FMT": _Kind(128, "BBnNZ", "Type,Length,Name,Format,Columns", "-b---", "-----"),
    "UNIT": _Kind(177, "QbZ", "TimeUS,Id,Label", "s--", "F--"),
    "FMTU": _Kind(178, "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---", "F---"),
    "MULT": _Kind(179, "Qbd", "TimeUS,Id,Mult", "s--", "F--"),
    "MSG": _Kind(91, "QZ", "TimeUS,Message", "s-", "F-"),
    "IMU": _Kind(158, "QBffffffIIfBBHH",
                 "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
                 "s#EEEooo--O--zz", "F-000000-----00"),
    "MAG": _Kind(119, "QBhhhhhhhhhBI",
                 "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S",
                 "s#GGGGGGGGG-s", "F-CCCCCCCCC-F"),
    "ATT": _Kind(30, "QccccCCCCB",
                 "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF",
                 "sddddhhdh-", "FBBBBBBBB-"),
    "XKF1": _Kind(95, "QBccCfffffffccce",
                  "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH",
                  "s#ddhnnnnmmm---m", "F-BBB0000000---B"),
    "XKQ": _Kind(108, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4", "s#----", "F-0000"),
    "GPS": _Kind(62, "QBBIHBcLLeffffB",
                 "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
                 "s#---SmDUmnhnh-", "F----0BGGB000--"),
    "POS": _Kind(40, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt", "sDUmmm", "FGG000"),
    "SIM": _Kind(187, "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4",
                 "sddhmDU----", "FBBB0GG0000"),
}  # fmt: skip


class _Logged(NamedTuple):
    """One message."""

    t: int
    rank: int
    """Order among messages of one moment."""
    data: bytes


def encode(flight: Flight) -> bytes:
    """Serialise a flight, the same bytes for the same flight.

    Raises
    ------
    ConfigError
        The flight lacks what the messages carry.
    """
    autopilot = believed(flight, _NEEDED, "a .BIN")
    logged = [*_sensors(flight), *_attitudes(flight, autopilot), *_navigation(flight, autopilot)]
    heard = flight.received(np.array([message.t for message in logged]))
    kept = [message for message, there in zip(logged, heard, strict=True) if there]
    kept.sort(key=lambda message: message[:2])
    start = np.array([kept[0].t])
    banner = _messages("MSG", start, Message=b"ArduCopter V4.6.0 (simulated)")
    return b"".join([*_definitions(start), *(message.data for message in [*banner, *kept])])


def _definitions(t: Times) -> Iterator[bytes]:
    """All that the log says about itself."""
    for name, kind in _KINDS.items():
        body = struct.pack("<BB4s16s64s", kind.number, _dtype(kind).itemsize, name.encode(),
                           kind.chars.encode(), kind.columns.encode())  # fmt: skip
        yield b"\xa3\x95\x80" + body
    for unit, label in _UNITS.items():
        yield _messages("UNIT", t, Id=ord(unit), Label=label.encode())[0].data
    for letter, factor in _MULTIPLIERS.items():
        yield _messages("MULT", t, Id=ord(letter), Mult=factor)[0].data
    for kind in _KINDS.values():
        ids = {"UnitIds": kind.units.encode(), "MultIds": kind.multipliers.encode()}
        yield _messages("FMTU", t, FmtType=kind.number, **ids)[0].data


def _sensors(flight: Flight) -> Iterator[_Logged]:
    """IMU with gyroscope and accelerometer, MAG in whole milligauss."""
    gyro, accel, mag = (flight.signals[name] for name in ("gyro", "accel", "mag"))
    force = following(accel, gyro.t)
    health = {"T": 31.5, "GH": 1, "AH": 1, "GHz": 1000, "AHz": 1000}
    yield from _messages("IMU", gyro.t, **_axes("Gyr", gyro.y), **_axes("Acc", force), **health)
    stamp = mag.t // 1000 % 2**32
    yield from _messages("MAG", mag.t, **_axes("Mag", mag.y * 1e7), Health=1, S=stamp)


def _attitudes(flight: Flight, autopilot: Array) -> Iterator[_Logged]:
    """ATT and the filter's quaternion, a little wrong, and SIM, true."""
    yield from _messages("ATT", flight.t, **_angles(autopilot))
    yield from _messages("XKQ", flight.t, **_four(autopilot))
    yield from _messages("SIM", flight.t, **_angles(flight.q), **_four(flight.q))


def _navigation(flight: Flight, autopilot: Array) -> Iterator[_Logged]:
    """XKF1 and POS as often as the filter gives them, GPS at half that rate."""
    velocity, position = flight.signals["velocity"], flight.signals["position"]
    moving = dict(zip(("VN", "VE", "VD"), velocity.y.T, strict=True))
    held = following(Signal(flight.t, autopilot), velocity.t)
    yield from _messages("XKF1", velocity.t, **_angles(held), **moving)
    place = dict(zip(("Lat", "Lng", "Alt"), position.y.T, strict=True))
    yield from _messages("POS", position.t, **place)
    t = position.t[::2]
    north, east, down = following(velocity, t).T
    course = np.degrees(np.arctan2(east, north)) % 360.0
    week, within = gps.from_unix(t + (flight.utc_offset or 0))
    known = flight.utc_offset is not None
    fix = {"Status": 3 if known else 2, "GMS": within // 10**6, "GWk": week if known else 0 * week}
    ground = {"Spd": np.hypot(north, east), "GCrs": course, "VZ": down}
    every = {name: values[::2] for name, values in place.items()}
    yield from _messages("GPS", t, **fix, **every, **ground, NSats=14, HDop=0.8, U=1)


def _messages(name: str, t: Times, **fields: object) -> list[_Logged]:
    """Pack the messages of one type; fields that are not named are zero."""
    kind = _KINDS[name]
    dtype = _dtype(kind)
    rows = np.zeros(len(t), dtype)
    rows["head"] = np.frombuffer(bytes([0xA3, 0x95, kind.number]), "V3")
    for column, char in zip(kind.columns.split(","), kind.chars, strict=True):
        rows[column] = t // 1000 if column == "TimeUS" else _cells(fields.get(column, b""), char)
    data, size, rank = rows.tobytes(), dtype.itemsize, list(_KINDS).index(name)
    return [_Logged(at, rank, data[i * size : (i + 1) * size]) for i, at in enumerate(t.tolist())]


def _dtype(kind: _Kind) -> np.dtype[np.void]:
    columns = zip(kind.columns.split(","), kind.chars, strict=True)
    return np.dtype([("head", "V3"), *((name, _TYPES[char]) for name, char in columns)])


def _cells(values: object, char: str) -> object:
    """Values as the format holds them."""
    if char in "nNZ":
        return values
    if isinstance(values, bytes):
        return 0
    # rounded so far that another machine's last bit does not show in a float32
    numbers = np.round(np.asarray(values, np.float64), 7) + 0.0
    if char in "fd":
        return numbers
    limits = np.iinfo(_TYPES[char])
    return np.clip(np.rint(numbers * _SCALES.get(char, 1.0)), limits.min, limits.max)


def _axes(stem: str, y: Array) -> dict[str, object]:
    return {f"{stem}{axis}": values for axis, values in zip("XYZ", y.T, strict=True)}


def _angles(q: Array) -> dict[str, object]:
    """Roll, pitch and heading from 0 to 360, degrees."""
    roll, pitch, yaw = np.degrees(quaternion.to_euler(q)).T
    return {"Roll": roll, "Pitch": pitch, "Yaw": yaw % 360.0}


def _four(q: Array) -> dict[str, object]:
    return {f"Q{i + 1}": values for i, values in enumerate(q.T)}
