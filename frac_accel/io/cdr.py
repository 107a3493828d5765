"""Reading, writing and patching the CDR bytes of the few message types that carry acceleration.

A serialised message is a 4-byte encapsulation header (bytes 0 and 1: 0x0000 big-endian,
0x0001 little-endian CDR) and a payload in which a number of k bytes starts at a multiple of k
(OMG DDSI-RTPS 2.5, 10.2; XCDR1).  All types here start with a ``std_msgs/Header``: int32 sec,
uint32 nanosec, uint32 n, n bytes of ``frame_id`` with its NUL.  What follows are float64 only,
from byte 4 + align8(12 + n) on, so that one offset places every field:

==============  ===========================================================================
Imu             orientation 0, its covariance 32, angular velocity 104, its covariance 128,
                linear acceleration 200, its covariance 224, end 296
AccelStamped    linear acceleration 0, angular acceleration 24, end 48
Temperature     temperature 0, variance 8, end 16
==============  ===========================================================================

Whole blocks of messages of one layout are read and patched as one numpy array; anything else is
taken message by message with the same result.  No function here needs ROS.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frac_accel.errors import BagError
from frac_accel.io.samples import Correlated, Samples

IMU = "sensor_msgs/msg/Imu"
ACCEL_STAMPED = "geometry_msgs/msg/AccelStamped"
POINT_CLOUD2 = "sensor_msgs/msg/PointCloud2"
TEMPERATURE = "sensor_msgs/msg/Temperature"

SAMPLE_TYPES = (IMU, ACCEL_STAMPED)
"""Types with one acceleration sample per message."""

ACCELERATION_TYPES = (*SAMPLE_TYPES, POINT_CLOUD2)
"""Types that can be read as `Samples`."""


class _Field(NamedTuple):
    offset: int
    count: int


# Offsets after the header, in bytes; see the table above.
_FIELDS: dict[str, dict[str, _Field]] = {
    IMU: {"acceleration": _Field(200, 3), "covariance": _Field(224, 9)},
    ACCEL_STAMPED: {"acceleration": _Field(0, 3)},
    TEMPERATURE: {"temperature": _Field(0, 1), "variance": _Field(8, 1)},
}
_BODY_SIZE = {IMU: 296, ACCEL_STAMPED: 48, TEMPERATURE: 16}
_DIAGONAL = slice(0, 9, 4)
# So few messages are taken apart one by one.
_FEW = 4
_LITTLE_ENDIAN_HEADER = b"\x00\x01\x00\x00"
_FLOAT64 = 8  # sensor_msgs/PointField datatype
_MAX_RELATIVE_TIME_S = 1e9


class Header(NamedTuple):
    """The ``std_msgs/Header`` of a message, and where what follows it begins."""

    stamp_ns: int
    frame_id: str
    byte_order: str  # "<" or ">", as in struct and numpy
    body_offset: int  # of the next 8-byte aligned field, from the start of the message


def read_header(message: bytes) -> Header:
    """Header of one serialised message; `BagError` where the bytes cannot be one."""
    if len(message) < 16:
        raise BagError(f"message of {len(message)} bytes is too short for a header")
    encapsulation = bytes(message[:2])
    if encapsulation not in (b"\x00\x01", b"\x00\x00"):
        raise BagError(f"message has encapsulation 0x{encapsulation.hex()}, expected plain CDR")
    order = "<" if encapsulation[1] else ">"
    sec, nanosec, length = struct.unpack_from(order + "iII", message, 4)
    if length > len(message) - 16:
        raise BagError(
            f"message of {len(message)} bytes declares a frame_id of {length} bytes: truncated"
        )
    frame_id = bytes(message[16 : 16 + length]).rstrip(b"\0").decode("utf-8", "replace")
    body_offset = 4 + (12 + length + 7) // 8 * 8
    return Header(sec * 1_000_000_000 + nanosec, frame_id, order, body_offset)


def split_stamps(stamps_ns) -> tuple[np.ndarray, np.ndarray]:
    """Seconds and nanoseconds of stamps; `BagError` outside the range of a ROS time."""
    sec, nanosec = np.divmod(np.asarray(stamps_ns, dtype=np.int64), 1_000_000_000)
    if sec.size and (sec.min() < -(2**31) or sec.max() >= 2**31):
        raise BagError("a time stamp is outside the range of builtin_interfaces/Time (int32 s)")
    return sec, nanosec


def read_samples(type_name: str, messages: Sequence[bytes]) -> Samples:
    """Samples of serialised messages of one of `ACCELERATION_TYPES`; `BagError` if malformed."""
    if messages and type_name in SAMPLE_TYPES:
        if len(messages) <= _FEW and (places := _places_of(type_name, messages)):
            return _few_samples(places, messages)
        alike = _alike(type_name, messages)
    else:
        alike = None
    if alike:
        return _samples_of(*alike)
    return read_samples_at(type_name, *_joined(messages))


def read_samples_at(
    type_name: str, buffer: bytes, offsets: np.ndarray, lengths: np.ndarray
) -> Samples:
    """Like `read_samples`, of messages that lie in ``buffer`` at ``offsets`` (in bytes)."""
    if type_name == POINT_CLOUD2:
        blocks = [
            read_point_cloud(buffer[offset : offset + length])
            for offset, length in zip(offsets.tolist(), lengths.tolist())
        ]
        return Samples.concatenate(blocks) if blocks else _no_samples()
    if type_name not in SAMPLE_TYPES:
        raise BagError(f"type {type_name} carries no acceleration: {', '.join(ACCELERATION_TYPES)}")
    if len(offsets) == 0:
        return _no_samples()
    parts, frame_id = _records(type_name, buffer, offsets, lengths)
    return Samples.concatenate([_samples_of(records, frame_id) for records in parts])


def read_covariances(messages: Sequence[bytes]) -> np.ndarray:
    """Whole ``linear_acceleration_covariance`` (n, 9) of serialised Imu messages."""
    if not messages:
        return np.empty((0, 9))
    parts, _ = _records(IMU, *_joined(messages))
    return np.concatenate([records["covariance"].astype(np.float64) for records in parts])


def _samples_of(records: np.ndarray, frame_id: str) -> Samples:
    values = records["acceleration"].astype(np.float64)
    if "covariance" in records.dtype.names:
        covariance = records["covariance"]
        variance = covariance[:, _DIAGONAL].astype(np.float64)
        if not variance.min() > 0.0:
            unknown = (covariance[:, 0] == -1.0) | ~covariance.any(axis=1)
            variance[unknown] = np.nan
    else:
        variance = np.full(values.shape, np.nan)
    return Samples(_stamps(records), values, variance, frame_id)


class Temperatures(NamedTuple):
    """Samples of a ``sensor_msgs/Temperature`` topic."""

    stamps_ns: np.ndarray  # int64 (n,)
    celsius: np.ndarray  # float64 (n,)
    variance: np.ndarray  # float64 (n,); NaN where unknown (published as 0)
    frame_id: str


def read_temperatures_at(buffer: bytes, offsets: np.ndarray, lengths: np.ndarray) -> Temperatures:
    """Temperatures of messages that lie in ``buffer`` at ``offsets``; `BagError` if malformed."""
    if len(offsets) == 0:
        return Temperatures(np.empty(0, np.int64), np.empty(0), np.empty(0), "")
    parts, frame_id = _records(TEMPERATURE, buffer, offsets, lengths)
    celsius, variance = (
        np.concatenate([records[name][:, 0].astype(np.float64) for records in parts])
        for name in ("temperature", "variance")
    )
    variance[variance == 0.0] = np.nan
    return Temperatures(np.concatenate(list(map(_stamps, parts))), celsius, variance, frame_id)


def encode_samples(type_name: str, samples: Samples) -> list[bytes]:
    """One serialised message per sample, of a type of `SAMPLE_TYPES`.

    An Imu says that it has neither orientation nor angular velocity (REP-145: first covariance
    element -1); an unknown variance is written as 0. Of `Correlated` samples the whole covariance
    is written.
    """
    if type_name not in SAMPLE_TYPES:
        raise BagError(f"samples cannot be written one by one as {type_name}")
    template = _encode_header(0, samples.frame_id) + bytes(_BODY_SIZE[type_name])
    if type_name == IMU:
        body = len(template) - _BODY_SIZE[IMU]
        orientation = (0.0, 0.0, 0.0, 1.0, -1.0)
        template = bytearray(template)
        struct.pack_into("<5d", template, body, *orientation)
        struct.pack_into("<d", template, body + 128, -1.0)
    templates = [bytes(template)] * len(samples.stamps_ns)
    if type_name == IMU and isinstance(samples, Correlated):
        rows = np.asarray(samples.covariance, "<f8")
        whole = body + _FIELDS[IMU]["covariance"].offset
        templates = [bytes(template[:whole]) + row.tobytes() for row in rows]
    return patch_samples(
        type_name, templates, samples.stamps_ns, samples.values, samples.variance
    )


def encode_temperature(stamp_ns: int, celsius: float, variance: float, frame_id: str) -> bytes:
    """One serialised ``sensor_msgs/Temperature``; an unknown (NaN) variance is written as 0."""
    variance = 0.0 if np.isnan(variance) else variance
    return _encode_header(stamp_ns, frame_id) + struct.pack("<2d", celsius, variance)


def encode_temperatures(temperatures: Temperatures) -> list[bytes]:
    """One serialised ``sensor_msgs/Temperature`` per sample."""
    stamps, celsius, variance, frame_id = temperatures
    return [
        encode_temperature(stamp, value, uncertainty, frame_id)
        for stamp, value, uncertainty in zip(
            np.asarray(stamps).tolist(), np.asarray(celsius).tolist(), np.asarray(variance).tolist()
        )
    ]


def encode_float64(value: float) -> bytes:
    """A serialised ``std_msgs/Float64``."""
    return _LITTLE_ENDIAN_HEADER + struct.pack("<d", value)


def patch_samples(
    type_name: str,
    messages: Sequence[bytes],
    stamps_ns,
    values,
    variance=None,
) -> list[bytes]:
    """Copies of messages with another stamp, acceleration and (Imu) covariance diagonal.

    Every other byte stays.  Where the variance is NaN the covariance element stays too.

    Parameters
    ----------
    messages : n serialised messages of one of `SAMPLE_TYPES`
    stamps_ns : int (n,)
    values, variance : float (n, 3)
    """
    return _patched(type_name, messages, stamps_ns, values, variance, is_whole=False)


def replace_samples(
    type_name: str, messages: Sequence[bytes], stamps_ns, values, variance
) -> list[bytes]:
    """Like `patch_samples`, with the whole covariance replaced.

    It becomes diagonal, or all zeros (unknown) where the variance of an axis is NaN.
    """
    if 0 < len(messages) <= _FEW and (places := _places_of(type_name, messages)):
        return _few_replaced(places, messages, stamps_ns, values, variance)
    variance = np.asarray(variance, dtype=np.float64)
    if variance.size and np.isnan(variance.min()):
        known = ~np.isnan(variance).any(axis=1, keepdims=True)
        variance = np.where(known, variance, 0.0)
    return _patched(type_name, messages, stamps_ns, values, variance, is_whole=True)


def _patched(type_name, messages, stamps_ns, values, variance, is_whole) -> list[bytes]:
    if not messages:
        return []
    stamps_ns = np.asarray(stamps_ns, dtype=np.int64)
    values = np.asarray(values, dtype=np.float64)
    alike = _alike(type_name, messages)
    if alike is None:
        if len(messages) == 1:
            _checked_layout(type_name, messages[0])  # says what is wrong
        ones = (slice(i, i + 1) for i in range(len(messages)))
        return [
            _patched(type_name, messages[one], stamps_ns[one], values[one],
                     None if variance is None else np.asarray(variance)[one], is_whole)[0]
            for one in ones
        ]
    records = alike[0]
    records["sec"], records["nanosec"] = split_stamps(stamps_ns)
    records["acceleration"] = values
    if variance is not None and "covariance" in records.dtype.names:
        covariance = records["covariance"]
        if is_whole:
            covariance[:] = 0.0
        else:
            variance = np.where(np.isnan(variance), covariance[:, _DIAGONAL], variance)
        covariance[:, _DIAGONAL] = variance
    size, patched = len(messages[0]), bytes(records.base)
    return [patched[start : start + size] for start in range(0, len(patched), size)]


def restamped(message: bytes, stamp_ns: int) -> bytes:
    """A message of any type that starts with a header, with another stamp."""
    order = read_header(message).byte_order
    sec, nanosec = split_stamps(stamp_ns)
    return message[:4] + struct.pack(order + "iI", int(sec), int(nanosec)) + message[12:]


def with_frame(message: bytes, frame_id: str) -> bytes:
    """A message of one of `SAMPLE_TYPES` with another frame."""
    header = read_header(message)
    frame = frame_id.encode() + b"\0"
    start = message[:12] + struct.pack(f"{header.byte_order}I", len(frame)) + frame
    return start + bytes(-(len(start) - 4) % 8) + message[header.body_offset:]


def read_point_cloud(message: bytes) -> Samples:
    """A block of samples: FLOAT64 fields ``t`` (s after the header's stamp), ``x, y, z``."""
    header = read_header(message)
    cursor = _Cursor(message, header)
    height, width = cursor.uint32(), cursor.uint32()
    fields: dict[str, tuple[int, int]] = {}
    for _ in range(cursor.uint32()):
        name = cursor.string()
        offset, datatype, _count = cursor.uint32(), cursor.uint8(), cursor.uint32()
        fields[name] = (offset, datatype)
    point_order = ">" if cursor.uint8() else "<"
    point_step, _row_step = cursor.uint32(), cursor.uint32()
    data = cursor.octets(cursor.uint32())
    if height != 1:
        raise BagError(f"PointCloud2 has height {height}; a block of samples has height 1")
    for name in "txyz":
        offset, datatype = fields.get(name, (None, None))
        if offset is None:
            raise BagError(f"PointCloud2 has no field '{name}', only: {', '.join(fields) or '-'}")
        if datatype != _FLOAT64 or offset + 8 > point_step:
            raise BagError(f"PointCloud2 field '{name}' is not a FLOAT64 within the point")
    if point_step * width > len(data):
        raise BagError(
            f"PointCloud2 declares {width} points of {point_step} bytes but holds {len(data)} bytes"
        )
    layout = np.dtype(
        {
            "names": list("txyz"),
            "formats": [point_order + "f8"] * 4,
            "offsets": [fields[name][0] for name in "txyz"],
            "itemsize": point_step,
        }
    )
    points = np.frombuffer(data, layout, count=width)
    relative_s = points["t"].astype(np.float64)
    if not (np.abs(relative_s) < _MAX_RELATIVE_TIME_S).all():
        raise BagError("PointCloud2 field 't' is not finite or not relative to the header's stamp")
    stamps_ns = header.stamp_ns + np.rint(relative_s * 1e9).astype(np.int64)
    values = np.stack([points[name] for name in "xyz"], axis=1).astype(np.float64)
    return Samples(stamps_ns, values, np.full(values.shape, np.nan), header.frame_id)


def encode_point_cloud(samples: Samples) -> bytes:
    """One serialised PointCloud2 that holds all samples (at least one), as `read_point_cloud`."""
    count = len(samples.stamps_ns)
    if count == 0:
        raise BagError("a block of samples holds at least one sample")
    start_ns = int(samples.stamps_ns[0])
    points = np.empty((count, 4), "<f8")
    points[:, 0] = (samples.stamps_ns - start_ns) / 1e9
    points[:, 1:] = samples.values
    head = _encode_header(start_ns, samples.frame_id, alignment=4)
    out = bytearray(head + struct.pack("<III", 1, count, 4))
    for index, name in enumerate(b"txyz"):
        # A one-character name and its NUL, padded to 4; uint8 datatype, padded; count.
        out += struct.pack("<I2s2xIB3xI", 2, bytes((name, 0)), 8 * index, _FLOAT64, 1)
    out += struct.pack("<B3xIII", 0, 32, 32 * count, 32 * count)
    return bytes(out + points.tobytes() + b"\x01")


class _Cursor:
    """Bounds-checked reading of CDR values after the header."""

    def __init__(self, message: bytes, header: Header) -> None:
        self._message = message
        self._order = header.byte_order
        length = struct.unpack_from(self._order + "I", message, 12)[0]
        self._at = 16 + length

    def octets(self, count: int) -> bytes:
        end = self._at + count
        if end > len(self._message):
            raise BagError(f"message of {len(self._message)} bytes is truncated")
        octets = self._message[self._at : end]
        self._at = end
        return octets

    def uint8(self) -> int:
        return self.octets(1)[0]

    def uint32(self) -> int:
        self._at += -(self._at - 4) % 4
        return struct.unpack(self._order + "I", self.octets(4))[0]

    def string(self) -> str:
        return bytes(self.octets(self.uint32())).rstrip(b"\0").decode("utf-8", "replace")


def _encode_header(stamp_ns: int, frame_id: str, alignment: int = 8) -> bytes:
    sec, nanosec = split_stamps(stamp_ns)
    frame = frame_id.encode() + b"\0"
    payload = struct.pack("<iII", int(sec), int(nanosec), len(frame)) + frame
    return _LITTLE_ENDIAN_HEADER + payload + bytes(-len(payload) % alignment)


def _joined(messages: Sequence[bytes]) -> tuple[bytes, np.ndarray, np.ndarray]:
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    return b"".join(messages), np.cumsum(lengths) - lengths, lengths


def _checked_layout(type_name: str, message: bytes) -> tuple[Header, dict[str, _Field]]:
    if type_name not in _FIELDS:
        raise BagError(f"type {type_name} is not one of {', '.join(_FIELDS)}")
    header = read_header(message)
    expected = header.body_offset + _BODY_SIZE[type_name]
    if len(message) < expected:
        raise BagError(
            f"{type_name} message of {len(message)} bytes is truncated, expected {expected}"
        )
    return header, _FIELDS[type_name]


def _alike(type_name: str, messages: Sequence[bytes]) -> tuple[np.ndarray, str] | None:
    """A writable copy of messages as a structured array, and the first one's frame_id.

    None where they do not all have the first one's layout.
    """
    first = messages[0]
    size = len(first)
    if size < 16 or set(map(len, messages)) != {size}:
        return None
    order = "<" if first[1] else ">"
    frame_size = struct.unpack_from(order + "I", first, 12)[0]
    frame = bytes(first[12 : 16 + frame_size])
    try:
        layout, frame_id = _known_layout(type_name, bytes(first[:2]), frame, size)
    except BagError:
        return None
    buffer = bytearray().join(messages)
    records = np.ndarray(len(messages), layout, buffer)
    if len(messages) > 1 and not (
        (records["encapsulation"] == first[1]).all()
        and (records["frame"] == np.frombuffer(frame, np.uint8)).all()
    ):
        return None
    return records, frame_id


class _Places(NamedTuple):
    """Where the parts of a message are, for `struct`."""

    stamp: struct.Struct
    acceleration: int
    covariance: int | None
    three: struct.Struct
    nine: struct.Struct
    frame_id: str


@functools.lru_cache
def _known_places(type_name: str, encapsulation: bytes, frame: bytes, size: int) -> _Places | None:
    start = encapsulation + bytes(10) + frame
    try:
        header, fields = _checked_layout(type_name, start + bytes(size - len(start)))
    except BagError:
        return None
    order, body = header.byte_order, header.body_offset
    covariance = fields.get("covariance")
    return _Places(struct.Struct(f"{order}iI"), body + fields["acceleration"].offset,
                   body + covariance.offset if covariance else None,
                   struct.Struct(f"{order}3d"), struct.Struct(f"{order}9d"), header.frame_id)


def _places_of(type_name: str, messages: Sequence[bytes]) -> _Places | None:
    """Places in messages of one layout; None where they have several, or none."""
    first = messages[0]
    size = len(first)
    if size < 16:
        return None
    frame = bytes(first[12 : 16 + struct.unpack_from("<I" if first[1] else ">I", first, 12)[0]])
    for message in messages:
        if len(message) != size or message[1] != first[1] or not message.startswith(frame, 12):
            return None
    return _known_places(type_name, bytes(first[:2]), frame, size)


def _few_samples(places: _Places, messages: Sequence[bytes]) -> Samples:
    """What `_samples_of` does, at less cost than setting up arrays for a few messages."""
    stamps, values, variances = [], [], []
    for message in messages:
        sec, nanosec = places.stamp.unpack_from(message, 4)
        stamps.append(sec * 1_000_000_000 + nanosec)
        values.append(places.three.unpack_from(message, places.acceleration))
        variance = (np.nan,) * 3
        if places.covariance is not None:
            covariance = places.nine.unpack_from(message, places.covariance)
            if covariance[0] != -1.0 and any(covariance):
                variance = covariance[_DIAGONAL]
        variances.append(variance)
    return Samples(np.array(stamps, np.int64), np.array(values), np.array(variances),
                   places.frame_id)


def _few_replaced(places, messages, stamps_ns, values, variance) -> list[bytes]:
    """What `_patched` does with the whole covariance, for a few messages."""
    result = []
    for message, stamp_ns, value, of_value in zip(messages, np.asarray(stamps_ns).tolist(),
                                                  np.asarray(values).tolist(),
                                                  np.asarray(variance).tolist()):
        patched = bytearray(message)
        sec, nanosec = divmod(stamp_ns, 1_000_000_000)
        if not -(2**31) <= sec < 2**31:
            split_stamps(stamp_ns)  # says what is wrong
        places.stamp.pack_into(patched, 4, sec, nanosec)
        places.three.pack_into(patched, places.acceleration, *value)
        if places.covariance is not None:
            x, y, z = of_value
            if x != x or y != y or z != z:  # NaN
                x = y = z = 0.0
            places.nine.pack_into(patched, places.covariance,
                                  x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
        result.append(bytes(patched))
    return result


@functools.lru_cache
def _known_layout(type_name: str, encapsulation: bytes, frame: bytes, size: int):
    """Layout of messages that begin so, and their frame_id; `BagError` where they cannot."""
    start = encapsulation + bytes(10) + frame
    header, _ = _checked_layout(type_name, start + bytes(size - len(start)))
    return (
        _layout(type_name, header.byte_order, len(frame) - 4, header.body_offset, size),
        header.frame_id,
    )


def _records(
    type_name: str, buffer: bytes, offsets: np.ndarray, lengths: np.ndarray
) -> tuple[list[np.ndarray], str]:
    """Messages as a structured array, or as one each where their layouts differ; first frame_id.

    Messages that follow each other at a constant distance are a view of the buffer.
    """
    records, frame_id = _like_first(type_name, buffer, offsets, lengths)
    if records is not None:
        return [records], frame_id
    ones = (slice(i, i + 1) for i in range(len(offsets)))
    return [_like_first(type_name, buffer, offsets[one], lengths[one])[0] for one in ones], frame_id


def _like_first(
    type_name: str, buffer: bytes, offsets: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray | None, str]:
    """Messages as a structured array, if all have the first one's layout; and its frame_id."""
    start, size = int(offsets[0]), int(lengths[0])
    first = bytes(buffer[start : start + size])
    header, _ = _checked_layout(type_name, first)
    if (lengths != size).any():
        return None, header.frame_id
    frame_size = struct.unpack_from(header.byte_order + "I", first, 12)[0]
    layout = _layout(type_name, header.byte_order, frame_size, header.body_offset, size)
    step = int(offsets[1]) - start if len(offsets) > 1 else size
    if step > 0 and (np.diff(offsets) == step).all():
        records = np.ndarray(len(offsets), layout, buffer, start, (step,))
    else:
        everywhere = np.ndarray(len(buffer) - size + 1, layout, buffer, 0, (1,))
        records = everywhere[offsets]
    same = (records["encapsulation"] == first[1]).all() and (
        records["frame"] == np.frombuffer(first, np.uint8, 4 + frame_size, 12)
    ).all()
    return (records if same else None), header.frame_id


@functools.lru_cache
def _layout(type_name: str, order: str, frame_size: int, body: int, size: int) -> np.dtype:
    """Structure of a message of this size."""
    fields = _FIELDS[type_name]
    # The encapsulation's options (bytes 2, 3) may differ: they do not move anything.
    return np.dtype(
        {
            "names": ["encapsulation", "sec", "nanosec", "frame", *fields],
            "formats": ["u1", order + "i4", order + "u4", ("u1", (4 + frame_size,))]
            + [(order + "f8", (field.count,)) for field in fields.values()],
            "offsets": [1, 4, 8, 12] + [body + field.offset for field in fields.values()],
            "itemsize": size,
        }
    )


def _stamps(records: np.ndarray) -> np.ndarray:
    return records["sec"].astype(np.int64) * 1_000_000_000 + records["nanosec"]


def _no_samples() -> Samples:
    return Samples(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), "")
