"""ULogs in the making, message by message."""

import struct

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35\x01"
TYPES = {"int8_t": "b", "uint8_t": "B", "bool": "?", "int16_t": "h", "uint16_t": "H",
         "int32_t": "i", "uint32_t": "I", "int64_t": "q", "uint64_t": "Q", "float": "f",
         "double": "d"}  # fmt: skip
TOPICS = {
    "sensor_combined": "gyro_rad:float[3] accelerometer_timestamp_relative:int32_t "
    "accelerometer_m_s2:float[3]",
    "vehicle_magnetometer": "timestamp_sample:uint64_t magnetometer_ga:float[3]",
    "sensor_mag": "timestamp_sample:uint64_t device_id:uint32_t x:float y:float z:float",
    "sensor_gyro": "timestamp_sample:uint64_t device_id:uint32_t x:float y:float z:float",
    "sensor_accel": "timestamp_sample:uint64_t device_id:uint32_t x:float y:float z:float",
    "sensor_gyro_fifo": "timestamp_sample:uint64_t dt:float scale:float samples:uint8_t "
    "x:int16_t[4] y:int16_t[4] z:int16_t[4]",
    "sensor_accel_fifo": "timestamp_sample:uint64_t dt:float scale:float samples:uint8_t "
    "x:int16_t[4] y:int16_t[4] z:int16_t[4]",
    "vehicle_imu": "timestamp_sample:uint64_t delta_angle:float[3] delta_velocity:float[3] "
    "delta_angle_dt:uint16_t delta_velocity_dt:uint16_t",
    "vehicle_attitude": "q:float[4]",
    "estimator_attitude": "timestamp_sample:uint64_t q:float[4]",
    "vehicle_attitude_groundtruth": "q:float[4]",
    "vehicle_visual_odometry": "local_frame:uint8_t q:float[4]",
    "vehicle_mocap_odometry": "pose_frame:uint8_t q:float[4]",
    "vehicle_local_position": "vx:float vy:float vz:float v_xy_valid:bool v_z_valid:bool",
    "vehicle_global_position": "lat:double lon:double alt:float",
    "vehicle_gps_position": "time_utc_usec:uint64_t lat:int32_t lon:int32_t alt:int32_t "
    "vel_n_m_s:float vel_e_m_s:float vel_d_m_s:float timestamp_time_relative:int32_t "
    "fix_type:uint8_t vel_ned_valid:bool",
    "cpuload": "load:float",
}
"""Fields behind the timestamp."""


def message(kind, payload):
    """Return one message, framed."""
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def fields(listed):
    """Return pairs of name and type."""
    return [part.split(":") for part in listed.split()]


class Log:
    """A log in the making."""

    def __init__(self, start=0, version="v1"):
        self.data = bytearray(MAGIC + struct.pack("<Q", start))
        self.topics, self.ids = dict(TOPICS), {}
        self.version = version

    def raw(self, kind, payload):
        """Append any message."""
        self.data += message(kind, payload)
        return self

    def info(self, key, value):
        """Append a text about the log."""
        typed = f"char[{len(value)}] {key}".encode()
        return self.raw("I", bytes([len(typed)]) + typed + value.encode())

    def flags(self, incompatible=0, offsets=(0, 0, 0)):
        """Append the flags, which come first."""
        return self.raw(
            "B", bytes(8) + bytes([incompatible]) + bytes(7) + struct.pack("<3Q", *offsets)
        )

    def subscribe(self, name, instance=0):
        """Append format and subscription."""
        if not any(known == name for known, _ in self.ids):
            listed = "".join(f"{kind} {field};" for field, kind in fields(self.topics[name]))
            self.raw("F", f"{name}:uint64_t timestamp;{listed}".encode())
        number = self.ids[name, instance] = len(self.ids)
        return self.raw("A", struct.pack("<BH", instance, number) + name.encode())

    def datum(self, name, t, *values, instance=0):
        """Return one row; values that are not given are zero."""
        layout = "<HQ"
        for _, kind in fields(self.topics[name]):
            plain, _, count = kind.rstrip("]").partition("[")
            layout += TYPES[plain] * int(count or 1)
        count = len(layout) - 3
        given = [*values, *[0] * (count - len(values))]
        return struct.pack(layout, self.ids[name, instance], round(t * 1e6), *given)

    def add(self, name, t, *values, instance=0):
        """Append one row at a time in seconds."""
        if (name, instance) not in self.ids:
            self.subscribe(name, instance)
        return self.raw("D", self.datum(name, t, *values, instance=instance))


def flight(seconds, log=None, **more):
    """Sensors and attitude at these times; more topics by name."""
    log = log or Log()
    for t in seconds:
        log.add("sensor_combined", t, 0.1, 0.2, 0.3, 0, 0.0, 0.0, -9.8)
        log.add("vehicle_magnetometer", t, 0, 0.2, 0.0, 0.4)
        log.add("vehicle_attitude", t, 1.0, 0.0, 0.0, 0.0)
        for name, values in more.items():
            log.add(name, t, *values)
    return log
