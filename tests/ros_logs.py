"""ROS logs in the making, written by rosbags and by mcap's own writer."""

from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("bag", "db3", "mcap", "mcap-ros1")
START = 1_700_000_000 * 10**9
IMU, MAG = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"


class Log:
    """Messages by topic, of one kind of log."""

    def __init__(self, kind="mcap", **definitions):
        self.kind, self.ros1 = kind, kind in {"bag", "mcap-ros1"}
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        for name, text in definitions.items():
            package, message = name.split("__")
            self.store.register(get_types_from_msg(text, f"{package}/msg/{message}"))
        self.messages = []

    def add(self, topic, kind, t, late=0, frame="imu", **fields):
        """Add a message that was measured ``t`` ns after the start, recorded ``late`` ns later."""
        names = [name for name, _ in self.store.get_msgdef(kind).fields]
        if "header" in names and "header" not in fields:
            fields["header"] = header(t, frame)
        message = self.fill(kind, fields)
        packed = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.messages.append((topic, kind, START + t + late, bytes(packed(message, kind))))
        return self

    def fill(self, kind, fields):
        """Make a message of nested dictionaries, with zero for what they leave out."""
        unknown = fields.keys() - {name for name, _ in self.store.get_msgdef(kind).fields}
        assert not unknown, unknown
        values = {
            name: self._value(what, fields.get(name))
            for name, what in self.store.get_msgdef(kind).fields
        }
        return self.store.types[kind](**values)

    def _value(self, what, given):
        form, inner = what
        if form == Nodetype.NAME:
            return self.fill(inner, given or {})
        if form == Nodetype.BASE:
            return given if given is not None else "" if inner[0] == "string" else 0
        (item, name), count = inner
        if item == Nodetype.BASE and name[0] != "string":
            numbers = np.zeros(count if form == Nodetype.ARRAY else 0) if given is None else given
            form = {"byte": "uint8", "char": "uint8"}.get(name[0], name[0])
            return np.asarray(numbers, form)
        return [self._value((item, name), one) for one in given or []]

    def write(self, folder: Path, **options) -> Path:
        """Write the log, and return its path."""
        if self.kind == "bag":
            return self._bag(folder / "log.bag", **options)
        if self.kind == "mcap-ros1":
            return self._mcap(folder / "log.mcap", **options)
        return self._folder(folder / f"log_{self.kind}", **options)

    def _bag(self, path, compression=None):
        writer = BagWriter(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            self._into(writer)
        return path

    def _folder(self, path, **options):
        plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
        writer = FolderWriter(path, version=9, storage_plugin=plugin)
        if options:
            writer.set_compression(options["mode"], options["format"])
        with writer:
            self._into(writer)
        return path

    def _into(self, writer):
        made = {}
        for topic, kind, t, data in self.messages:
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=self.store)
            writer.write(made[topic], t, data)

    def _mcap(self, path, compression=CompressionType.ZSTD, **options):
        buffer, made = BytesIO(), {}
        writer = McapWriter(buffer, compression=compression, chunk_size=4096, **options)
        writer.start("ros1" if self.ros1 else "ros2")
        for topic, kind, t, data in self.messages:
            if topic not in made:
                text, _ = self.store.generate_msgdef(kind)
                name = kind.replace("/msg/", "/") if self.ros1 else kind
                form, encoding = ("ros1msg", "ros1") if self.ros1 else ("ros2msg", "cdr")
                schema = writer.register_schema(name, form, text.encode())
                made[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(made[topic], t, data, t)
        writer.finish()
        path.write_bytes(buffer.getvalue())
        return path


def header(t, frame="imu"):
    """Return a header at ``t`` ns after the start, and with a stamp of zero for None."""
    at = 0 if t is None else START + t
    return {"stamp": {"sec": at // 10**9, "nanosec": at % 10**9}, "frame_id": frame}


def xyz(*values):
    """Return a vector's fields."""
    return dict(zip("xyz", map(float, values), strict=True))


def xyzw(q):
    """Return the fields of a quaternion (w, x, y, z)."""
    return dict(zip("wxyz", map(float, q), strict=True))


def times(count=50, rate=100):
    """Return stamps at a rate, ns after the start."""
    return [round(i * 1e9 / rate) for i in range(count)]


def flight(log, topic="/imu", rate=100, count=50, frame="imu", orientation=None, **more):
    """Add an inertial unit and a magnetometer to a log."""
    for i, t in enumerate(times(count, rate)):
        fields = dict(more)
        if orientation is not None:
            fields["orientation"] = xyzw(orientation(i))
        log.add(topic, IMU, t, 1000, frame, angular_velocity=xyz(0.1 * i, 0.02, 0.03),
                linear_acceleration=xyz(0.1, 0.2, 9.8 + 0.01 * i), **fields)  # fmt: skip
    return log


def compass(log, topic="/mag", rate=50, count=25, frame="imu", field=(2e-5, 1e-6, -4e-5)):
    """Add a magnetometer."""
    for t in times(count, rate):
        log.add(topic, MAG, t, 1000, frame, magnetic_field=xyz(*field))
    return log
