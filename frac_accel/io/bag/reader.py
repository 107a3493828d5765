"""Streaming reader: a bag's messages in log order, in memory bounded by its chunks.

Policy for damaged bags (cut off, bad checksums): chunks that are whole are read, damaged ones are
skipped, what follows a cut in the record structure is lost.  `BagReader.warnings` says what was
skipped and `BagReader.recovered` that something was; both may grow while the bag is read.
`BagError` is raised where nothing at all is readable, or where the fault is the caller's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from pathlib import Path
from typing import NamedTuple

import numpy as np

from frac_accel.errors import BagError
from frac_accel.io import cdr
from frac_accel.io.bag.files import bag_files
from frac_accel.io.bag.mcap_file import McapFile, Messages, Segment, allowed_bytes
from frac_accel.io.bag.qos import Qos, parse_qos
from frac_accel.io.samples import Samples

MAX_OPEN_BYTES = 512 * 2**20
"""Most bytes of chunks that overlap in time and so have to be held together."""

_END_OF_BAG = (2**63 - 1, (2**63, 0))


class TopicInfo(NamedTuple):
    """What a bag tells of a topic.

    ``count`` is the number of messages, ``qos`` what its publishers offered (() if unknown),
    ``metadata`` the channel's own, as stored.
    """

    name: str
    type_name: str
    count: int
    qos: tuple[Qos, ...]
    message_encoding: str
    schema_encoding: str
    schema_text: bytes
    metadata: dict[str, str]


class Message(NamedTuple):
    """One serialised message."""

    topic: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


class Block(NamedTuple):
    """Consecutive messages of one topic in log order, not yet taken apart."""

    topic: TopicInfo
    log_times_ns: np.ndarray
    publish_times_ns: np.ndarray
    buffer: bytes
    offsets: np.ndarray
    lengths: np.ndarray

    @property
    def messages(self) -> list[bytes]:
        """The serialised messages."""
        return [
            self.buffer[offset : offset + length]
            for offset, length in zip(self.offsets.tolist(), self.lengths.tolist())
        ]

    def samples(self) -> Samples:
        """Acceleration samples; `BagError` on a malformed message or another type."""
        return self._read(cdr.read_samples_at, self.topic.type_name)

    def temperatures(self) -> cdr.Temperatures:
        """Temperatures; `BagError` on a malformed message."""
        return self._read(cdr.read_temperatures_at)

    def _read(self, function, *arguments):
        try:
            return function(*arguments, self.buffer, self.offsets, self.lengths)
        except BagError as error:
            raise BagError(f"topic {self.topic.name}: {error}") from None


class BagReader:
    """A bare .mcap file or a rosbag2 folder of such files; a context manager.

    Parameters
    ----------
    path : path of the bag

    Attributes
    ----------
    path : Path
    topics : dict of `TopicInfo` by topic name
    warnings : list of str
        What is damaged and what was done about it.
    recovered : bool
        True if something in the bag was damaged, so that messages may be missing.

    Raises
    ------
    BagError
        If there is no such bag, it is of another format, or nothing in it is readable.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            paths, self._folder_warnings = bag_files(self.path)
        except OSError as error:
            raise BagError(f"{path}: cannot be read: {error.strerror}") from None
        self._files: list[McapFile] = []
        for number, file in enumerate(paths):
            try:
                self._files.append(McapFile(file, number))
            except BagError as error:
                if len(paths) == 1:
                    raise
                self._folder_warnings.append(f"{error}; the file is skipped")
                self._files.append(_Unreadable())
        if self.recovered and not any(file.segments and file.channels for file in self._files):
            words = "; ".join(warning.removeprefix(f"{self.path}: ") for warning in self.warnings)
            raise BagError(f"{self.path}: nothing is readable: {words}")
        self.topics = self._topic_infos()

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held open between two chunks."""

    @property
    def warnings(self) -> list[str]:
        return self._folder_warnings + [w for file in self._files for w in file.warnings]

    @property
    def recovered(self) -> bool:
        return bool(self._folder_warnings) or any(file.damaged for file in self._files)

    @property
    def message_count(self) -> int:
        return sum(info.count for info in self.topics.values())

    def topic(self, name: str, types: Sequence[str] = ()) -> TopicInfo:
        """A topic that must be there and, if types are given, have one of them.

        Raises
        ------
        BagError
            Otherwise; names the topics that there are.
        """
        info = self.topics.get(name)
        if info is None:
            there = ", ".join(f"{i.name} ({i.type_name})" for i in self.topics.values())
            raise BagError(f"{self.path}: has no topic {name}; it has {there or 'no topics'}")
        if not types:
            return info
        if info.message_encoding != "cdr" or info.schema_encoding not in ("ros2msg", "ros2idl", ""):
            raise BagError(
                f"{self.path}: topic {name} is encoded as {info.message_encoding} with schema "
                f"'{info.schema_encoding}', expected cdr with ros2msg"
            )
        if info.type_name not in types:
            raise BagError(
                f"{self.path}: topic {name} has type {info.type_name}, "
                f"expected {' or '.join(types)}"
            )
        return info

    def messages(self, topics: Sequence[str] | None = None) -> Iterator[Message]:
        """Messages of the topics (default: all) in log order, those of equal time as on disk."""
        names = self._names(topics)
        for messages, channels in self._merged(names):
            columns = zip(
                messages.channel_ids.tolist(),
                messages.log_times_ns.tolist(),
                messages.publish_times_ns.tolist(),
                messages.offsets.tolist(),
                messages.lengths.tolist(),
            )
            body = messages.body
            for channel, log_time_ns, publish_time_ns, offset, length in columns:
                data = body[offset : offset + length]
                yield Message(channels[channel], data, log_time_ns, publish_time_ns)

    def blocks(self, topics: Sequence[str] | None = None) -> Iterator[Block]:
        """The same messages in blocks of one topic, each about a chunk long.

        In log order within a topic; blocks of different topics alternate about every chunk.
        """
        names = self._names(topics)
        for messages, channels in self._merged(names):
            for name in names:
                ids = [channel for channel, topic in channels.items() if topic == name]
                of_topic = messages.select(np.isin(messages.channel_ids, ids))
                if len(of_topic.offsets):
                    yield Block(
                        self.topics[name],
                        of_topic.log_times_ns,
                        of_topic.publish_times_ns,
                        of_topic.body,
                        of_topic.offsets,
                        of_topic.lengths,
                    )

    def samples(self, topics: Sequence[str]) -> Iterator[tuple[str, Samples]]:
        """Blocks of acceleration samples with their topic, as `blocks`."""
        for name in topics:
            self.topic(name, cdr.ACCELERATION_TYPES)
        for block in self.blocks(topics):
            yield block.topic.name, self._located(block.samples)

    def temperatures(self, topic: str) -> Iterator[cdr.Temperatures]:
        """Blocks of a ``sensor_msgs/Temperature`` topic."""
        self.topic(topic, [cdr.TEMPERATURE])
        for block in self.blocks([topic]):
            yield self._located(block.temperatures)

    def _located(self, read):
        try:
            return read()
        except BagError as error:
            raise BagError(f"{self.path}: {error}") from None

    def _names(self, topics: Sequence[str] | None) -> list[str]:
        if topics is None:
            return list(self.topics)
        return [self.topic(name).name for name in dict.fromkeys(topics)]

    def _topic_infos(self) -> dict[str, TopicInfo]:
        infos: dict[str, TopicInfo] = {}
        for file in self._files:
            for channel in file.channels.values():
                schema = file.schemas.get(channel.schema_id)
                info = TopicInfo(
                    channel.topic,
                    schema.name if schema else "",
                    file.counts.get(channel.id, 0),
                    parse_qos(channel.metadata.get("offered_qos_profiles", "")),
                    channel.message_encoding,
                    schema.encoding if schema else "",
                    schema.data if schema else b"",
                    channel.metadata,
                )
                known = infos.get(info.name)
                if known is not None:
                    if known.type_name != info.type_name:
                        raise BagError(
                            f"{self.path}: topic {info.name} has two types, "
                            f"{known.type_name} and {info.type_name}"
                        )
                    info = known._replace(
                        count=known.count + info.count,
                        qos=known.qos + tuple(qos for qos in info.qos if qos not in known.qos),
                    )
                infos[info.name] = info
        return infos

    def _merged(self, names: list[str]) -> Iterator[tuple[Messages, dict[int, str]]]:
        """Merge segments by log time; yields messages and the topics of their channel numbers.

        A segment is opened when everything before its start has gone out, so that only
        segments that overlap in time are held together.
        """
        wanted = _WantedChannels(names)
        waiting = sorted(segment for file in self._files for segment in file.segments)
        horizons = [(segment.start_ns, segment.order) for segment in waiting[1:]]
        opened: list[tuple[int, tuple[int, int], Messages]] = []  # heap by next log time
        open_bytes, found = 0, False
        most_bytes = allowed_bytes(sum(file.size for file in self._files), MAX_OPEN_BYTES)
        for segment, (horizon_ns, horizon) in zip(waiting, [*horizons, _END_OF_BAG]):
            messages = self._open(segment, wanted)
            if messages is not None and len(messages.offsets):
                heappush(opened, (int(messages.log_times_ns[0]), segment.order, messages))
                open_bytes += len(messages.body)
            if open_bytes > most_bytes:
                raise BagError(
                    f"{self.path}: more than {most_bytes >> 20} MiB of chunks overlap in "
                    "time; sort the bag first (mcap sort)"
                )
            ready, rest = [], []
            while opened and opened[0][0] <= horizon_ns:
                _, order, messages = heappop(opened)
                # At equal times the order on disk decides.
                side = "right" if order < horizon else "left"
                count = int(np.searchsorted(messages.log_times_ns, horizon_ns, side))
                if count:
                    ready.append((order, messages.select(slice(0, count))))
                if count < len(messages.offsets):
                    messages = messages.select(slice(count, None))
                    rest.append((int(messages.log_times_ns[0]), order, messages))
                else:
                    open_bytes -= len(messages.body)
            for one in rest:
                heappush(opened, one)
            if ready:
                found = True
                yield _interleaved([messages for _, messages in sorted(ready)]), wanted.topics
        if not found and any(file.damaged and file.segments for file in self._files):
            raise BagError(
                f"{self.path}: nothing of {', '.join(names)} is readable: "
                f"{'; '.join(self.warnings)}"
            )

    def _open(self, segment: Segment, wanted: _WantedChannels) -> Messages | None:
        """Messages of wanted topics; their channel numbers are unique over all files."""
        file = self._files[segment.order[0]]
        try:
            messages = file.read(segment)
        except BagError as error:
            file.damage(f"chunk at byte {segment.offset} is skipped: {error}")
            return None
        except OSError as error:
            raise BagError(f"{file.path}: cannot be read: {error.strerror}") from None
        numbers, known = wanted.numbers(file, messages.channel_ids)
        if not known:
            file.damage(f"chunk at byte {segment.offset} has messages of unknown channels")
        messages = messages._replace(channel_ids=numbers)
        return messages if (numbers >= 0).all() else messages.select(numbers >= 0)


class _WantedChannels:
    """Numbers the channels of wanted topics over all files of a bag; -1 for any other."""

    def __init__(self, names: list[str]) -> None:
        self._names = {name: number for number, name in enumerate(names)}
        self.topics = dict(enumerate(names))

    def numbers(self, file: McapFile, channel_ids: np.ndarray) -> tuple[np.ndarray, bool]:
        """Number of the topic of each message, and whether all channels are known."""
        ids, inverse = np.unique(channel_ids, return_inverse=True)
        channels = [file.channels.get(one) for one in ids.tolist()]
        numbers = [self._names.get(one.topic, -1) if one else -1 for one in channels]
        return np.array(numbers, dtype=np.int64)[inverse.reshape(-1)], None not in channels


class _Unreadable:
    """Stands for a file of a split bag that could not be opened."""

    segments: list[Segment] = []
    channels: dict = {}
    warnings: list[str] = []
    damaged = True
    size = 0


def _interleaved(parts: list[Messages]) -> Messages:
    """One run in log order; parts that come first on disk go first at equal times."""
    if len(parts) == 1:
        return parts[0]
    pieces, starts, start = [], [], 0
    for part in parts:
        low = int(part.offsets.min())
        high = int((part.offsets + part.lengths).max())
        pieces.append(part.body[low:high])
        starts.append(start - low)
        start += high - low
    order = np.argsort(np.concatenate([part.log_times_ns for part in parts]), kind="stable")
    columns = [np.concatenate([part[i] for part in parts])[order] for i in (1, 2, 3)]
    offsets = np.concatenate([part.offsets + shift for part, shift in zip(parts, starts)])[order]
    lengths = np.concatenate([part.lengths for part in parts])[order]
    return Messages(b"".join(pieces), *columns, offsets, lengths)
