"""One MCAP file, hostile or not: where its chunks lie, and the records in a chunk.

The file is scanned record by record from its start (headers only, 1 µs each), so that nothing
depends on the summary at its end: a recording that was cut off is read up to the cut.  Every
length is checked against the bytes that are there before anything of that length is allocated.
Record layouts: https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import struct
import zlib
from array import array
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Schema, Statistics

from frac_accel.errors import BagError
from frac_accel.io.regular_file import open_regular

MAGIC = b"\x89MCAP0\r\n"
MAX_CHUNK_BYTES = 256 * 2**20
"""Largest chunk (uncompressed) that is read; rosbag2 and mcap write about 1 MiB."""

# A small file must not fill the memory: more than this only of what is a hundredth of it on disk.
_UNSUSPECTED_BYTES = 32 * 2**20
_LARGEST_RATIO = 100
_MAX_DESCRIPTION_BYTES = 16 * 2**20  # schema, channel, header, statistics
_MAX_DESCRIPTIONS_BYTES = 8 * 2**20  # schemas and channels that are kept, together
_UNSUSPECTED_TOTAL = 256 * 2**20
_MOST_DAMAGE = 100  # records in a chunk that do not belong there or are damaged; warnings
_LOOSE_BYTES = 2**20
# Messages of one length in a row after which more of them are looked for at once, and how many at
# first.
_STREAK, _AHEAD = 8, 64
_MAX_TIME = 2**63 - 1
_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_FOREIGN_MAGIC = {
    b"#ROSBAG": "is a ROS 1 bag; convert it first (rosbags-convert)",
    b"\x28\xb5\x2f\xfd": "is compressed as a file; decompress it first (zstd -d)",
}
_RECORD_HEADER = np.dtype([("opcode", "u1"), ("length", "<u8")])
_MESSAGE_HEADER = np.dtype(
    {
        "names": ["channel_id", "sequence", "log_time", "publish_time"],
        "formats": ["<u2", "<u4", "<u8", "<u8"],
        "offsets": [0, 2, 6, 14],
        "itemsize": 22,
    }
)


def allowed_bytes(size: int, most: int, unsuspected: int = _UNSUSPECTED_BYTES) -> int:
    """Bytes that ``size`` ones on disk may unpack to; never more than ``most``."""
    return min(most, max(unsuspected, _LARGEST_RATIO * size))


class Segment(NamedTuple):
    """A chunk, or a run of records outside chunks (``compression`` is then None)."""

    start_ns: int
    order: tuple[int, int]  # (number of the file, offset): the order on disk
    size: int  # on disk
    body_size: int
    crc: int
    compression: str | None

    @property
    def offset(self) -> int:
        return self.order[1]


class Messages(NamedTuple):
    """Messages of one segment in log order; they lie in ``body``."""

    body: bytes
    channel_ids: np.ndarray
    log_times_ns: np.ndarray
    publish_times_ns: np.ndarray
    offsets: np.ndarray
    lengths: np.ndarray

    def select(self, which) -> Messages:
        """The messages of a mask, slice or array of indices."""
        return Messages(self.body, *(column[which] for column in self[1:]))


class McapFile:
    """What a scan of the file found.

    Attributes
    ----------
    schemas, channels : by id
    segments : list of Segment, in the order on disk
    counts : messages by channel id, as the file's statistics state them; None without them
    warnings : list of str; what is damaged and what was done about it
    damaged : bool
    """

    def __init__(self, path: Path, number: int = 0) -> None:
        self.path = path
        self.number = number
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.segments: list[Segment] = []
        self.counts: dict[int, int] | None = None
        self.warnings: list[str] = []
        self.damaged = False
        self.size = 0
        self._description_bytes = 0
        try:
            with open_regular(path) as stream:
                self.size = os.fstat(stream.fileno()).st_size
                self._scan(stream.fileno())
            if self.counts is None or (not self.channels and self.segments):
                self._count_by_reading()
        except OSError as error:
            raise BagError(f"{path}: cannot be read: {error.strerror}") from None

    def read(self, segment: Segment) -> Messages:
        """Messages of a segment in log order; `BagError` if it is damaged as a whole."""
        with open_regular(self.path) as stream:
            data = os.pread(stream.fileno(), segment.size, segment.offset)
        if len(data) != segment.size:
            raise BagError("file became shorter while it was read")
        body = _decompressed(data, segment)
        return self._parse(body, segment)

    def damage(self, message: str) -> None:
        """Note damage once; of very much damage, the beginning."""
        self.damaged = True
        warning = f"{self.path}: {message}"
        if warning not in self.warnings and len(self.warnings) < _MOST_DAMAGE:
            self.warnings.append(warning)

    def _scan(self, descriptor: int) -> None:
        self._require_magic(os.pread(descriptor, 16, 0))
        loose = _LooseRun(self)
        in_summary, has_header = False, False
        for opcode, start, length, content in self._records(descriptor):
            begin, end = start - _RECORD.size, start + length
            if not has_header:
                has_header = True
                if opcode == Opcode.HEADER:
                    self._check_profile(self._description(descriptor, Header, start, length))
                    continue
                self.damage("has no header record")
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                kind = Schema if opcode == Opcode.SCHEMA else Channel
                self._register(self._description(descriptor, kind, start, length), length)
                if not in_summary:
                    loose.add(begin, end, None)
            elif opcode == Opcode.DATA_END:
                in_summary = True
            elif opcode == Opcode.STATISTICS:
                statistics = self._description(descriptor, Statistics, start, length)
                self.counts = statistics.channel_message_counts if statistics else None
            elif opcode == Opcode.CHUNK and not in_summary:
                loose.close()
                self._add_chunk(content, start, length)
            elif opcode == Opcode.MESSAGE and not in_summary and length >= 22:
                loose.add(begin, end, struct.unpack_from("<Q", content, 6)[0])
        loose.close()
        total = sum(segment.body_size for segment in self.segments)
        if total > allowed_bytes(self.size, _MAX_TIME, _UNSUSPECTED_TOTAL):
            raise BagError(
                f"{self.path}: declares {total} bytes, more than {_LARGEST_RATIO} times its "
                f"{self.size} bytes on disk: not a recording, or one of nothing"
            )
        if self.damaged:
            self.counts = None

    def _require_magic(self, head: bytes) -> None:
        if self.size == 0:
            raise BagError(f"{self.path}: file is empty")
        if head.startswith(MAGIC):
            return
        for magic, meaning in _FOREIGN_MAGIC.items():
            if head.startswith(magic):
                raise BagError(f"{self.path}: {meaning}")
        raise BagError(f"{self.path}: not an MCAP file (wrong magic), nor of a format that "
                       "frac_accel convert reads (db3, csv, parquet, mf4, npz)")

    def _records(self, descriptor: int) -> Iterator[tuple[int, int, int, bytes]]:
        """Opcode, start and length of the content, and its first bytes, of each record up to the
        footer, or to where the file is damaged."""
        position = len(MAGIC)
        while True:
            start = position + _RECORD.size
            head = os.pread(descriptor, _RECORD.size + 48, position)
            if len(head) < _RECORD.size:
                self.damage(f"is cut off at byte {self.size} (no footer); read up to there")
                return
            opcode, length = _RECORD.unpack_from(head)
            if opcode == 0 or length > self.size - start:
                self.damage(
                    f"record at byte {position} is cut off or damaged; "
                    f"read up to there, {self.size - position} bytes are lost"
                )
                return
            if opcode == Opcode.FOOTER:
                return
            yield opcode, start, length, head[_RECORD.size : _RECORD.size + length]
            position = start + length

    def _check_profile(self, header: Header | None) -> None:
        profile = header.profile if header else ""
        if profile not in ("ros2", ""):
            raise BagError(f"{self.path}: has profile '{profile[:40]}', expected 'ros2'")

    def _description(self, descriptor: int, kind: type, start: int, length: int):
        """A small record parsed by the mcap library, or None if that is not possible."""
        if length > _MAX_DESCRIPTION_BYTES:
            self.damage(f"{kind.__name__} record of {length} bytes at byte {start} is ignored")
            return None
        return self._parsed(kind, os.pread(descriptor, length, start), start)

    def _parsed(self, kind: type, content: bytes, where: int):
        try:
            return kind.read(ReadDataStream(BytesIO(content)))
        except (McapError, struct.error, UnicodeDecodeError, MemoryError, OverflowError):
            self.damage(f"{kind.__name__} record at byte {where} is damaged and ignored")
            return None

    def _register(self, record: Schema | Channel | None, size: int) -> None:
        """Keep the first definition of an id; the specification forbids to change it."""
        if record is None:
            return
        known = self.schemas if isinstance(record, Schema) else self.channels
        if record.id not in known:
            self._description_bytes += size
            if self._description_bytes > _MAX_DESCRIPTIONS_BYTES:
                self.damage(f"more than {_MAX_DESCRIPTIONS_BYTES} bytes of schemas and channels")
                return
        if known.setdefault(record.id, record) != record:
            self.damage(f"{type(record).__name__} {record.id} is defined twice; kept the first")

    def _add_chunk(self, content: bytes, start: int, length: int) -> None:
        if length >= _CHUNK.size + 8:
            first_ns, _last_ns, body_size, crc, name_length = _CHUNK.unpack_from(content)
            data_offset = _CHUNK.size + name_length + 8
            if name_length <= 8 and data_offset <= length:
                name = content[_CHUNK.size : _CHUNK.size + name_length]
                data_size = struct.unpack_from("<Q", content, _CHUNK.size + name_length)[0]
                if data_size <= length - data_offset:
                    self.segments.append(
                        Segment(
                            min(first_ns, _MAX_TIME),
                            (self.number, start + data_offset),
                            data_size,
                            body_size,
                            crc,
                            name.decode("latin-1"),
                        )
                    )
                    return
        self.damage(f"chunk at byte {start} has a damaged header and is skipped")

    def _parse(self, body: bytes, segment: Segment) -> Messages:
        unpack, header_size = _RECORD.unpack_from, _RECORD.size
        # not lists: a chunk may be nothing but the smallest of messages
        offsets, lengths = array("q"), array("q")
        position, end, bad, last, streak = 0, len(body), 0, 0, 0
        while position + header_size <= end:
            opcode, length = unpack(body, position)
            position += header_size
            if length > end - position:
                break
            if opcode == 5:  # Opcode.MESSAGE, without the cost of the enumeration
                if length >= 22:
                    offsets.append(position)
                    lengths.append(length)
                    streak = streak + 1 if length == last else 0
                    last = length
                    if streak == _STREAK:
                        step, alike = header_size + length, _alike(body, position + length, length)
                        offsets.frombytes((position + step * np.arange(1, alike + 1)).tobytes())
                        lengths.extend(array("q", [length]) * alike)
                        position += step * alike
                        streak = 0
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                kind = Schema if opcode == Opcode.SCHEMA else Channel
                content = body[position : position + min(length, _MAX_DESCRIPTION_BYTES)]
                record = self._parsed(kind, content, segment.offset)
                self._register(record, length)
                bad += record is None
            else:
                bad += 1  # nothing else belongs in a chunk
            if bad > _MOST_DAMAGE:
                break
            position += length
        if position != end:
            self.damage(f"records in the chunk at byte {segment.offset} are damaged at their end")
        offsets, lengths = (np.array(column, dtype=np.int64) for column in (offsets, lengths))
        headers = np.ndarray(max(end - 21, 0), _MESSAGE_HEADER, body, 0, (1,))[offsets]
        log_times = np.minimum(headers["log_time"], _MAX_TIME).astype(np.int64)
        messages = Messages(
            body,
            headers["channel_id"],
            log_times,
            np.minimum(headers["publish_time"], _MAX_TIME).astype(np.int64),
            offsets + 22,
            lengths - 22,
        )
        if (np.diff(log_times) < 0).any():
            messages = messages.select(np.argsort(log_times, kind="stable"))
        return messages

    def _count_by_reading(self) -> None:
        """Find channels and count messages where the summary does not tell."""
        counts: dict[int, int] = {}
        for segment in self.segments:
            try:
                messages = self.read(segment)
            except BagError as error:
                self.damage(f"chunk at byte {segment.offset} is skipped: {error}")
                continue
            ids, numbers = np.unique(messages.channel_ids, return_counts=True)
            for channel_id, number in zip(ids.tolist(), numbers.tolist()):
                counts[channel_id] = counts.get(channel_id, 0) + number
        self.counts = counts


class _LooseRun:
    """Gathers consecutive records outside chunks into segments of about a chunk's size."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._start = self._end = 0
        self._first_ns: int | None = None

    def add(self, start: int, end: int, log_time_ns: int | None) -> None:
        if start != self._end or end - self._start > _LOOSE_BYTES:
            self.close()
            self._start = start
        self._end = end
        if log_time_ns is not None:
            known = _MAX_TIME if self._first_ns is None else self._first_ns
            self._first_ns = min(known, log_time_ns)

    def close(self) -> None:
        if self._first_ns is not None:
            size = self._end - self._start
            order = (self._file.number, self._start)
            self._file.segments.append(Segment(self._first_ns, order, size, size, 0, None))
        self._first_ns = None
        self._start = self._end


def _alike(body: bytes, position: int, length: int) -> int:
    """Number of messages of this length that follow each other from a position on."""
    most = (len(body) - position) // (_RECORD.size + length)
    heads = np.ndarray(most, _RECORD_HEADER, body, position, (_RECORD.size + length,))
    found, look = 0, _AHEAD
    while found < most:
        part = heads[found : found + look]
        other = np.flatnonzero((part["opcode"] != Opcode.MESSAGE) | (part["length"] != length))
        if len(other):
            return found + int(other[0])
        found, look = found + len(part), 4 * look
    return found


def _decompressed(data: bytes, segment: Segment) -> bytes:
    most = allowed_bytes(len(data), MAX_CHUNK_BYTES)
    if segment.body_size > most:
        raise BagError(
            f"it declares {segment.body_size} bytes, expected at most {most} of {len(data)} on disk"
        )
    if not segment.compression:
        body = data
    elif segment.compression == "zstd":
        body = _zstd(data, segment.body_size)
    elif segment.compression == "lz4":
        try:
            decompressor = lz4.frame.LZ4FrameDecompressor()
            body = decompressor.decompress(data, max_length=segment.body_size + 1)
        except (RuntimeError, EOFError, ValueError, MemoryError) as error:
            raise BagError(f"lz4 data is damaged ({error})") from None
    else:
        raise BagError(f"compression '{segment.compression}' is not zstd, lz4 or none")
    if len(body) != segment.body_size:
        raise BagError(f"it holds {len(body)} bytes but declares {segment.body_size}")
    if segment.crc and zlib.crc32(body) != segment.crc:
        raise BagError("its checksum is wrong")
    return body


def _zstd(data: bytes, body_size: int) -> bytes:
    """Decompress without trusting the content size in the frame, which would be allocated."""
    try:
        declared = zstandard.get_frame_parameters(data).content_size
        if declared == body_size:
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=body_size)
        with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as reader:
            return reader.read(body_size + 1)
    except (zstandard.ZstdError, MemoryError) as error:
        raise BagError(f"zstd data is damaged ({error})") from None
