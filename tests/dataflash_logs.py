"""DataFlash logs in the making, message by message, binary and as text."""

import struct

TYPES = {
    "a": "64s", "b": "b", "B": "B", "g": "e", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f",
    "d": "d", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i",
    "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
SCALES = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10**7}
KINDS = {
    "IMU": ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "GYR": ("QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"),
    "ACC": ("QBQfff", "TimeUS,I,SampleUS,AccX,AccY,AccZ"),
    "MAG": ("QBhhhhhhBI", "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,Health,S"),
    "ATT": ("QccC", "TimeUS,Roll,Pitch,Yaw"),
    "AHR2": ("QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4"),
    "XKF1": ("QBccCfff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD"),
    "XKQ": ("QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "SIM": ("QccCfLL", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng"),
    "GPS": ("QBBIHLLefff", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ"),
    "POS": ("QLLf", "TimeUS,Lat,Lng,Alt"),
    "PARM": ("QNff", "TimeUS,Name,Value,Default"),
    "MSG": ("QZ", "TimeUS,Message"),
    "UNIT": ("QbZ", "TimeUS,Id,Label"),
    "MULT": ("Qbd", "TimeUS,Id,Mult"),
    "FMTU": ("QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
}
"""Formats and columns of what a test adds without having defined it."""
FMT = ("BBnNZ", "Type,Length,Name,Format,Columns")


def size(chars):
    return 3 + struct.calcsize("<" + "".join(TYPES[char] for char in chars))


class Log:
    """A log in the making."""

    def __init__(self):
        self.data, self.lines, self.kinds = bytearray(), [], {"FMT": (128, *FMT)}
        self.define("FMT", *FMT)

    def define(self, name, chars, columns, *, number=None, length=None):
        """Append an FMT."""
        given = self.kinds.get(name)
        number = number or (given[0] if given else 128 + len(self.kinds))
        self.kinds[name] = (number, chars, columns)
        return self.add("FMT", number, length or size(chars), name, chars, columns)

    def add(self, name, *values):
        """Append a message, of which values that are not given are zero."""
        if name not in self.kinds:
            self.define(name, *KINDS[name])
        number, chars, _ = self.kinds[name]
        values = [*values, *["" if c in "nNZ" else 0 for c in chars[len(values) :]]]
        packed = [value.encode() if isinstance(value, str)
                  else round(value * SCALES[char]) if char in SCALES else value
                  for value, char in zip(values, chars, strict=True)]  # fmt: skip
        layout = "<" + "".join(TYPES[char] for char in chars)
        self.data += bytes([0xA3, 0x95, number]) + struct.pack(layout, *packed)
        self.lines.append(", ".join([name, *map(str, values)]))
        return self

    def text(self):
        """Return the same messages as text."""
        return "\n".join([*self.lines, ""]).encode()


def flight(seconds, log=None, **more):
    """IMU, MAG and ATT at these times; more messages by name, as functions of the seconds."""
    log = log or Log()
    for t in seconds:
        micros = round(t * 1e6)
        log.add("IMU", micros, 0, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8)
        log.add("MAG", micros, 0, 200, 0, 400, 0, 0, 0, 1)
        log.add("ATT", micros, 5.73, 0.0, 11.46)
        for name, values in more.items():
            log.add(name, micros, *values)
    return log
