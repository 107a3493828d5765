"""Streaming writer of what rosbag2 (Jazzy) writes: MCAP, profile ros2, zstd chunks."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

from frac_accel.errors import BagError
from frac_accel.io import message_definitions
from frac_accel.io.bag.files import METADATA_NAME
from frac_accel.io.bag.mcap_writer import McapWriter
from frac_accel.io.bag.qos import Qos, parse_qos, qos_entries, qos_text
from frac_accel.io.bag.reader import TopicInfo
from frac_accel.io.outputs import stage

_MAX_TIME = 2**63 - 1
_METADATA_VERSION = 9
_ROS_DISTRO = "jazzy"
# Names of what `frac_accel convert` makes, of which a folder of MCAP files is none.
_BY_CONVERT = (".db3", ".csv", ".parquet", ".npz", ".mf4")


class _Topic(NamedTuple):
    channel_id: int
    type_name: str
    message_encoding: str
    qos: tuple[Qos, ...]
    type_hash: str


class BagWriter:
    """Writes serialised messages; a context manager.

    Left by an exception, or never closed, an ordinary writer leaves nothing behind: it makes an
    `frac_accel.io.outputs.Output`.  With ``in_place`` (a recorder) it writes to the target itself,
    and all that was written before the last `flush` is readable from then on, whatever happens
    to the process.

    Parameters
    ----------
    path : target
        A bare file if the name ends in .mcap, else a rosbag2 folder; a name of another format is
        refused.  So are existing folders, and existing files with ``in_place``.
    in_place : see above

    Raises
    ------
    BagError
        If the target cannot be written, here and in all methods.
    """

    def __init__(self, path: str | Path, *, in_place: bool = False) -> None:
        self.path = Path(path)
        self.counts: dict[str, int] = {}
        self._in_place = in_place
        suffix = self.path.suffix.lower()
        if suffix in _BY_CONVERT:
            raise BagError(f"{path}: bags are written as MCAP, expected a name that ends in .mcap, "
                           f"or a new folder; frac_accel convert makes a {suffix} of one")
        self._is_folder = suffix != ".mcap"
        if self.path.exists() and (self._is_folder or in_place or self.path.is_dir()):
            raise BagError(f"{path}: exists already")
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._start_ns, self._end_ns = _MAX_TIME, 0
        self._closed = False
        self._output = self._stream = None
        self._target = self.path
        try:
            if not in_place:
                self._output = stage(self.path)
                self._target = self._output.path
            if self._is_folder:
                self._target.mkdir()
                file = self._target / f"{self.path.name}_0.mcap"
            else:
                file = self._target
            self._file_name = file.name if self._is_folder else self.path.name
            self._stream = open(file, "xb")
        except OSError as error:
            self.abort()
            raise BagError(f"{path}: cannot be written: {error.strerror}") from None
        self._writer = self._checked(McapWriter, self._stream, "ros2", "frac_accel")

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None or self._in_place:
            self.close()
        else:
            self.abort()

    def add_topic(
        self, topic: str, type_name: str, qos: tuple[Qos, ...] = (Qos(),), type_hash: str = ""
    ) -> bool:
        """Announce a topic before its messages.

        Returns
        -------
        bool
            False if no definition of the type was found: the bag then has none either, which
            ``ros2 bag play`` accepts and Foxglove does not.
        """
        definition = message_definitions.find_definition(type_name)
        text = definition.text.encode()
        metadata = {
            "offered_qos_profiles": qos_text(qos),
            "topic_type_hash": type_hash or definition.type_hash,
        }
        encoding = "ros2msg" if text else ""
        self._register(topic, type_name, encoding, text, "cdr", metadata, qos)
        return bool(text)

    def copy_topic(self, info: TopicInfo, name: str | None = None) -> None:
        """Announce a topic as another bag describes it, under its name or another."""
        self._register(
            name or info.name,
            info.type_name,
            info.schema_encoding,
            info.schema_text,
            info.message_encoding,
            info.metadata,
            parse_qos(info.metadata.get("offered_qos_profiles", "")),
        )

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Append one serialised message of an announced topic; times in ns since the epoch."""
        self.write_many(topic, [(data, log_time_ns, publish_time_ns)])

    def write_many(self, topic: str, messages: Sequence[tuple[bytes, int, int | None]]) -> None:
        """Append messages of a topic: data, log time and publish time of each, as `write`."""
        if not messages:
            return
        messages = [
            (data, log, log if publish is None else publish) for data, log, publish in messages
        ]
        times = [time for _, *pair in messages for time in pair]
        if not 0 <= min(times) <= max(times) <= _MAX_TIME:
            wrong = min(times) if min(times) < 0 else max(times)
            raise BagError(f"{self.path}: time {wrong} ns on {topic} is out of range")
        logs = times[::2]
        self._checked(self._writer.add_messages, self._topics[topic].channel_id, messages)
        self.counts[topic] += len(messages)
        self._start_ns, self._end_ns = min(self._start_ns, min(logs)), max(self._end_ns, max(logs))

    def flush(self) -> None:
        """End the chunk and have the disk confirm it: from now on these messages are safe."""
        self._checked(self._writer.flush)
        self._checked(os.fsync, self._stream.fileno())

    def close(self) -> None:
        """Write what belongs at the end, and put the bag in its place."""
        if self._closed:
            return
        self._closed = True
        information = self._information()
        self._checked(
            self._writer.add_metadata,
            "rosbag2",
            {"serialized_metadata": yaml.safe_dump(information, sort_keys=False)},
        )
        self._checked(self._writer.finish)
        self._checked(self._stream.flush)
        self._checked(os.fsync, self._stream.fileno())
        self._checked(self._stream.close)
        if self._is_folder:
            text = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
            self._checked((self._target / METADATA_NAME).write_text, text, "utf-8")
        if self._output:
            self._checked(self._output.done)

    def abort(self) -> None:
        """Give up: nothing is left of a bag that was not written in place."""
        self._closed = True
        try:
            if self._stream:
                self._stream.close()
        except OSError:
            pass  # a full disk is why we are here
        if self._output:
            self._output.drop()

    def _register(
        self,
        topic: str,
        type_name: str,
        schema_encoding: str,
        schema_text: bytes,
        message_encoding: str,
        metadata: dict[str, str],
        qos: tuple[Qos, ...],
    ) -> None:
        if topic in self._topics:
            raise BagError(f"{self.path}: topic {topic} is announced twice")
        key = (type_name, schema_encoding, schema_text)
        if key not in self._schemas:
            self._schemas[key] = self._checked(self._writer.register_schema, *key)
        channel_id = self._checked(
            self._writer.register_channel, topic, message_encoding, self._schemas[key], metadata
        )
        type_hash = metadata.get("topic_type_hash", "")
        self._topics[topic] = _Topic(channel_id, type_name, message_encoding, qos, type_hash)
        self.counts[topic] = 0

    def _information(self) -> dict:
        """The content of metadata.yaml, as rosbag2_storage writes version 9."""
        count = sum(self.counts.values())
        duration = {"nanoseconds": max(self._end_ns - self._start_ns, 0)}
        start = {"nanoseconds_since_epoch": self._start_ns}
        return {
            "version": _METADATA_VERSION,
            "storage_identifier": "mcap",
            "duration": dict(duration),
            "starting_time": dict(start),
            "message_count": count,
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": name,
                        "type": topic.type_name,
                        "serialization_format": topic.message_encoding,
                        "offered_qos_profiles": qos_entries(topic.qos),
                        "type_description_hash": topic.type_hash,
                    },
                    "message_count": self.counts[name],
                }
                for name, topic in self._topics.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._file_name],
            "files": [
                {
                    "path": self._file_name,
                    "starting_time": dict(start),
                    "duration": dict(duration),
                    "message_count": count,
                }
            ],
            "custom_data": None,
            "ros_distro": _ROS_DISTRO,
        }

    def _checked(self, function, *arguments):
        try:
            return function(*arguments)
        except OSError as error:
            self.abort()
            raise BagError(f"{self.path}: cannot be written: {error.strerror}") from None
        except BaseException:
            self.abort()
            raise
