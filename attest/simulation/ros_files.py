"""The files that hold ROS messages: a bag of ROS 1; of ROS 2 a folder, an MCAP or a database.

The same flight gives the same bytes with the same versions of the libraries: zstd (MCAP) and SQLite
may lay out the same content otherwise in another version.
"""

import tempfile
from pathlib import Path

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from attest.simulation import ros
from attest.simulation.flight import Flight


def encode_bag(flight: Flight) -> bytes:
    """Serialise a flight as ROS 1 records it, compressed with bz2.

    Raises
    ------
    ConfigError
        ROS has no message for what the flight holds.
    """
    store = get_typestore(Stores.ROS1_NOETIC)
    messages = ros.publish(flight, store)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.bag"
        writer = rosbag1.Writer(path)
        writer.set_compression(rosbag1.Writer.CompressionFormat.BZ2)
        with writer:
            kinds = {one.topic: one.type for one in messages}
            made = {
                topic: writer.add_connection(topic, kind, typestore=store)
                for topic, kind in sorted(kinds.items())
            }
            for t, topic, kind, message in messages:
                writer.write(made[topic], t, store.serialize_ros1(message, kind))
        return path.read_bytes()


def encode_folder(flight: Flight) -> dict[str, bytes]:
    """Serialise a flight as the files of a ROS 2 folder: an MCAP and its metadata."""
    return _ros2(flight, rosbag2.StoragePlugin.MCAP)


def encode_mcap(flight: Flight) -> bytes:
    """Serialise a flight as the MCAP of a ROS 2 folder, compressed with zstd."""
    return encode_folder(flight)[f"{flight.scenario}.mcap"]


def encode_db3(flight: Flight) -> bytes:
    """Serialise a flight as the database of a ROS 2 folder."""
    return _ros2(flight, rosbag2.StoragePlugin.SQLITE3)[f"{flight.scenario}.db3"]


def _ros2(flight: Flight, storage: rosbag2.StoragePlugin) -> dict[str, bytes]:
    """Return the files of a ROS 2 folder by name.

    Raises
    ------
    ConfigError
        ROS has no message for what the flight holds.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    messages = ros.publish(flight, store)
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / flight.scenario
        writer = rosbag2.Writer(folder, version=9, storage_plugin=storage)
        if storage is rosbag2.StoragePlugin.MCAP:
            writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        with writer:
            kinds = {one.topic: one.type for one in messages}
            made = {
                topic: writer.add_connection(topic, kind, typestore=store)
                for topic, kind in sorted(kinds.items())
            }
            for t, topic, kind, message in messages:
                writer.write(made[topic], t, store.serialize_cdr(message, kind))
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
