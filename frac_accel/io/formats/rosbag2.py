"""Bags of rosbag2 that are no plain MCAP (sqlite3, or compressed by rosbag2), by rosbags."""

import sqlite3
import tempfile
from pathlib import Path

from ...errors import BagError
from ..bag.qos import parse_qos
from ..regular_file import open_regular

_NO_HASH = "RIHS01_" + 64 * "0"


def read_messages(path, name):
    """Topics and messages of such a bag, whose name in messages may be another one.

    Returns
    -------
    topics : list of (name, type, QoS profiles, type hash)
    messages : generator of (name, bytes, log time)

    Raises
    ------
    BagError
        If it cannot be read; the generator too.
    """
    from rosbags.rosbag2 import Reader
    try:
        reader = Reader(path)
        reader.open()
    except Exception as error:  # what sqlite, yaml and zstd raise, too
        raise BagError(f"{name}: is no sqlite3 or compressed bag that rosbags can read: "
                       f"{_words(error)}") from None
    topics = {connection.topic: (connection.topic, connection.msgtype, _qos(connection),
                                 connection.digest)
              for connection in reader.connections}
    return list(topics.values()), _messages(name, reader)


def _qos(connection):
    return parse_qos([{name: getattr(profile, name).name.lower() for name in
                       ("reliability", "durability", "history")} | {"depth": profile.depth}
                      for profile in connection.ext.offered_qos_profiles])


def _messages(name, reader):
    try:
        for connection, time_ns, data in reader.messages(reader.connections):
            yield connection.topic, bytes(data), time_ns
    except Exception as error:  # as above
        raise BagError(f"{name}: cannot be read: {_words(error)}") from None
    finally:
        reader.close()


def write_sqlite(path, topics, messages):
    """Write a bare ``.db3`` from `TopicInfo`s and `Message`s."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.rosbag2.metadata import parse_qos as profiles_of
    with tempfile.TemporaryDirectory(dir=Path(path).parent) as folder:
        target = Path(folder) / Path(path).stem
        with Writer(target, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
            connections = {info.name: writer.add_connection(
                info.name, info.type_name, msgdef=info.schema_text.decode("utf-8", "replace"),
                rihs01=info.metadata.get("topic_type_hash") or _NO_HASH,
                offered_qos_profiles=profiles_of(info.metadata.get("offered_qos_profiles", "")))
                for info in topics}
            for message in messages:
                writer.write(connections[message.topic], message.log_time_ns, message.data)
        file, = target.glob("*.db3")
        file.replace(path)


def is_sqlite(path):
    """Whether a file is a database of sqlite3."""
    try:
        with open_regular(path) as file:
            return file.read(16) == b"SQLite format 3\0"
    except OSError:
        return False


def _words(error):
    if isinstance(error, sqlite3.Error):
        return f"sqlite says {error}"
    return " ".join(str(error).split()) or type(error).__name__
