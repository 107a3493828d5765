"""Damaged and foreign bags: what is whole is read, everything else is one clear `BagError`."""

import os
import re
import resource
import struct
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
import zstandard
from bag_fixtures import random_samples, write_foreign_bag
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Schema
from mcap.writer import CompressionType

from frac_accel.io import cdr
from frac_accel.io.bag import BagError, BagReader, BagWriter, read_bag, write_bag
from frac_accel.io.bag.mcap_file import MAGIC
from frac_accel.io.bag.qos import parse_qos

TOPICS = {"/imu/reference": random_samples(1, 200), "/imu/data_raw": random_samples(2, 200)}
EVERY_MESSAGE = {
    name: list(cdr.encode_samples(cdr.IMU, samples)) for name, samples in TOPICS.items()
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "bag.mcap"
    write_foreign_bag(path, TOPICS)
    return path.read_bytes()


def records(data: bytes):
    """Opcode, start and end of each top-level record."""
    at = len(MAGIC)
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield opcode, at, at + 9 + length
        at += 9 + length


def read_all(path):
    """All that can be read, which must be true messages in order."""
    reader = BagReader(path)
    data = {}
    for message in reader.messages():
        data.setdefault(message.topic, []).append(message.data)
    return reader, data


def is_subsequence(part, everything):
    rest = iter(everything)
    return all(one in rest for one in part)


def test_a_cut_bag_is_read_up_to_the_cut(whole, tmp_path):
    path = tmp_path / "cut.mcap"
    chunk_ends = [end for opcode, _, end in records(whole) if opcode == Opcode.CHUNK]
    readable = 0
    for size in [*range(0, len(whole), 97), *chunk_ends, *(end - 1 for end in chunk_ends)]:
        path.write_bytes(whole[:size])
        try:
            reader, data = read_all(path)
        except BagError as error:
            assert size < chunk_ends[0], error
            assert str(path) in str(error)
            continue
        readable += 1
        assert reader.recovered or size > len(whole) - 8
        count = sum(len(messages) for messages in data.values())
        assert count == reader.message_count
        assert count >= 400 * sum(end <= size for end in chunk_ends) // len(chunk_ends) - 25
        for topic, messages in data.items():
            assert messages == EVERY_MESSAGE[topic][: len(messages)]
    assert readable > 50


def test_a_chunk_with_a_wrong_checksum_is_skipped(whole, tmp_path):
    path = tmp_path / "crc.mcap"
    chunks = [start for opcode, start, _ in records(whole) if opcode == Opcode.CHUNK]
    damaged = bytearray(whole)
    damaged[chunks[2] + 9 + 24] ^= 1  # uncompressed_crc
    path.write_bytes(damaged)
    reader, data = read_all(path)
    assert reader.recovered and "checksum" in reader.warnings[0]
    assert 300 < sum(len(messages) for messages in data.values()) < 400
    for topic, messages in data.items():
        assert is_subsequence(messages, EVERY_MESSAGE[topic])
    for chunk in chunks:
        damaged[chunk + 9 + 24] = whole[chunk + 9 + 24] ^ 1
    path.write_bytes(damaged)
    with pytest.raises(BagError, match="readable"):
        read_all(path)


def test_random_damage_raises_bag_errors_only(whole, tmp_path):
    rng = np.random.default_rng(20260601)
    path = tmp_path / "fuzz.mcap"
    outcomes = {"read": 0, "refused": 0}
    for _ in range(400):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(whole), size=rng.integers(1, 6)):
            damaged[at] = rng.integers(0, 256)
        # Half of the damage goes where the lengths are.
        starts = [start for _, start, _ in records(whole)]
        for start in rng.choice(starts, size=rng.integers(0, 3)):
            damaged[int(start) + int(rng.integers(0, 60)) % (len(whole) - int(start))] = int(
                rng.integers(0, 256)
            )
        if rng.random() < 0.3:
            del damaged[int(rng.integers(0, len(damaged))) :]
        path.write_bytes(damaged)
        try:
            read_all(path)
            read_bag(path)
            outcomes["read"] += 1
        except BagError as error:
            assert "\n" not in str(error)
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 20, outcomes


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_absurd_lengths_are_not_allocated(tmp_path, compression):
    """Chunks that claim terabytes are skipped; the process may grow by 300 MB at most."""
    bomb = zstandard.ZstdCompressor().compress(bytes(2**26))
    claims_much = zstandard.ZstdCompressor(write_content_size=True).compress(b"x" * 100)
    limit = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss + 300 * 1024
    for data in (bomb, claims_much, b"", os.urandom(100)):
        for declared in (0, 100, 2**28 - 1, 2**40, 2**63):
            builder = RecordBuilder()
            Header("ros2", "").write(builder)
            Chunk(compression, data, 0, 0, 0, declared).write(builder)
            path = tmp_path / "bomb.mcap"
            path.write_bytes(MAGIC + builder.end())
            with pytest.raises(BagError):
                read_all(path)
    for length in (2**31, 2**62, 2**64 - 1):
        for opcode in range(1, 16):
            path.write_bytes(MAGIC + struct.pack("<BQ", opcode, length) + bytes(100))
            with pytest.raises(BagError):
                read_all(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < limit


def bomb(chunks, body, start_ns=0):
    """An MCAP of chunks that are all the same body, with true sizes and checksums."""
    builder = RecordBuilder()
    Header("ros2", "").write(builder)
    Schema(1, b"", "ros2msg", cdr.IMU).write(builder)
    Channel(1, "/imu/data_raw", "cdr", {}, 1).write(builder)
    data = zstandard.ZstdCompressor(level=9).compress(body)
    chunk = Chunk("zstd", data, 0, 0, zlib.crc32(body), len(body))
    for number in range(chunks):
        chunk.message_start_time = number * start_ns
        chunk.write(builder)
    return MAGIC + builder.end()


IMU = EVERY_MESSAGE["/imu/data_raw"][0]
SMALLEST = struct.pack("<BQHIQQ", 5, 22, 1, 0, 0, 0)
WHOLE = struct.pack("<BQHIQQ", 5, 22 + len(IMU), 1, 0, 10**6, 0) + IMU
BOMBS = {
    "one chunk": (lambda: bomb(1, bytes(256 * 2**20 - 1)), "declares|nothing"),
    "overlapping chunks": (lambda: bomb(30, WHOLE * (8 * 2**20 // len(WHOLE))), "overlap"),
    "smallest messages": (lambda: bomb(7, SMALLEST * (2**20 // 31)), "too short"),
    "many chunks": (lambda: bomb(100, WHOLE * (8 * 2**20 // len(WHOLE)), 1), "more than 100 times"),
    "not records": (lambda: bomb(7, bytes(31 * 2**20), 1), "no messages|nothing"),
    "damaged schemas": (lambda: bomb(7, struct.pack("<BQ", 3, 0) * 10**6, 1), "nothing"),
    "large schemas": (lambda: bomb(1, b"".join(
        struct.pack("<BQ", 3, 4 * 2**20 + 14) + struct.pack("<HIII", number, 0, 0, 4 * 2**20)
        + bytes(4 * 2**20) for number in range(7))), "no messages|nothing"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_does_not_fill_the_memory(tmp_path, name):
    """Files of at most 200 KB; refused with at most 100 MB, in a process of its own."""
    make, words = BOMBS[name]
    path = tmp_path / "bomb.mcap"
    path.write_bytes(make())
    assert path.stat().st_size < 200_000
    code = (
        "import resource, sys\n"
        "from frac_accel.io.bag import BagError, read_bag\n"
        "def used():\n"
        "    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "before = used()\n"
        "try:\n"
        "    read_bag(sys.argv[1], ['/imu/data_raw'])\n"
        "except BagError as error:\n"
        "    print(used() - before, error)\n"
    )
    start = time.monotonic()
    result = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, timeout=60
    )
    assert re.search(words, result.stdout), result
    assert int(result.stdout.split()[0]) < 100 * 1024
    assert time.monotonic() - start < 20


def test_a_large_chunk_of_real_samples_is_read(tmp_path):
    """Messages that differ do not unpack to a hundredfold, however large their chunk."""
    path = tmp_path / "large.mcap"
    samples = random_samples(5, 120_000)
    write_foreign_bag(path, {"/imu/data_raw": samples}, chunk_size=2**28)
    read = read_bag(path, ["/imu/data_raw"])["/imu/data_raw"]
    np.testing.assert_array_equal(read.values, samples.values)


def test_a_frame_that_claims_another_size_than_its_chunk(tmp_path):
    frame = bytearray(zstandard.ZstdCompressor().compress(bytes(2**20)))
    assert zstandard.get_frame_parameters(bytes(frame)).content_size == 2**20
    frame[5:9] = struct.pack("<I", 2**32 - 1)
    builder = RecordBuilder()
    Header("ros2", "").write(builder)
    Chunk("zstd", bytes(frame), 0, 0, 0, 2**20).write(builder)
    (tmp_path / "bag.mcap").write_bytes(MAGIC + builder.end())
    with pytest.raises(BagError, match="nothing is readable"):
        BagReader(tmp_path / "bag.mcap")


def content(data):
    return lambda path: path.write_bytes(data)


def foreign(**options):
    return lambda path: write_foreign_bag(path, TOPICS, **options)


def folder(metadata=None, **files):
    def write(path):
        path.mkdir()
        if metadata is not None:
            (path / "metadata.yaml").write_text(metadata)
        for name, data in files.items():
            (path / f"{name}.mcap").write_bytes(data)

    return write


def empty_bag(path):
    BagWriter(path.with_suffix(".mcap")).close()
    path.with_suffix(".mcap").rename(path)


def without_messages(path):
    with BagWriter(path.with_suffix(".mcap")) as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
    path.with_suffix(".mcap").rename(path)


def malformed_message(path):
    with BagWriter(path.with_suffix(".mcap")) as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
        writer.write("/imu/data_raw", EVERY_MESSAGE["/imu/data_raw"][0][:-3], 1)
    path.with_suffix(".mcap").rename(path)


INFORMATION = "rosbag2_bagfile_information:\n  relative_file_paths: [a.mcap]\n"


@pytest.mark.parametrize(
    "write, says",
    [
        (lambda path: None, "no such bag"),
        (content(b""), "is empty"),
        (content(b"hello world, this is no bag"), "not an MCAP file"),
        (content(b"#ROSBAG V2.0\n" + bytes(100)), "ROS 1"),
        (content(b"SQLite format 3\0" + bytes(100)), "sqlite3|library rosbags"),
        (content(MAGIC), "nothing is readable"),
        (content(MAGIC + MAGIC), "nothing is readable"),
        (foreign(profile="ros1"), "profile 'ros1', expected 'ros2'"),
        (foreign(message_encoding="json", schema_encoding="jsonschema"), "encoded as json"),
        (foreign(message_encoding="protobuf", schema_encoding="protobuf"), "as protobuf"),
        (foreign(message_encoding="ros1", schema_encoding="ros1msg"), "encoded as ros1"),
        (
            foreign(type_name="std_msgs/msg/String"),
            "has type std_msgs/msg/String, expected sensor_msgs/msg/Imu or",
        ),
        (empty_bag, "has no topic /imu/data_raw; it has no topics"),
        (without_messages, "topic /imu/data_raw has no messages"),
        (malformed_message, "topic /imu/data_raw: sensor_msgs/msg/Imu message of 321 bytes"),
        (
            lambda path: write_foreign_bag(path, {"/other": TOPICS["/imu/data_raw"]}),
            r"has no topic /imu/data_raw; it has /other \(sensor_msgs/msg/Imu\)",
        ),
        (folder(), "neither metadata.yaml nor"),
        (folder("[" * 5000), "not the metadata"),
        (folder("a: 1"), "not the metadata"),
        (folder(INFORMATION + "  storage_identifier: sqlite3"), "storage is 'sqlite3'"),
        (folder(INFORMATION + "  storage_identifier: mcap"), "none of the files"),
        (folder(None, a=b""), "file is empty"),
        (
            folder(INFORMATION + "  storage_identifier: mcap\n  compression_mode: file", a=b"x"),
            "compressed by rosbag2",
        ),
    ],
)
def test_the_error_says_what_is_wrong_and_where(tmp_path, write, says):
    path = tmp_path / "input"
    write(path)
    with pytest.raises(BagError, match=says) as caught:
        read_bag(path, ["/imu/data_raw"])
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def laughs(levels, fill):
    """Nested aliases: each level holds the one before it nine times."""
    lines = ["a0: &a0 {x: 1}"] if fill == "map" else ["a0: &a0 [x]"]
    for level in range(1, levels):
        inner = ", ".join([f"*a{level - 1}"] * 9)
        lines.append(f"a{level}: &a{level} " + (f"{{<<: [{inner}]}}" if fill == "map" else
                                                f"[{inner}]"))
    return "\n".join(lines) + "\n" + INFORMATION


@pytest.mark.parametrize("text", [laughs(9, "map"), laughs(9, "list"), "[" * 10**5,
                                  "a: " + "1:" * 500_000 + "1\n" + INFORMATION,
                                  "x" * (2**21 + 1), "a: !!timestamp x\n" + INFORMATION])
def test_metadata_that_unfolds_is_refused_in_little_time_and_memory(tmp_path, text):
    bag = tmp_path / "bag"
    folder(text)(bag)
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BagError, match="not the metadata"):
        BagReader(bag)
    write_bag(bag / "bag_0.mcap", TOPICS)
    assert "is damaged; files are read by name" in BagReader(bag).warnings[0]
    assert time.process_time() - start < 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < before + 100 * 1024


def test_a_channels_qos_does_not_unfold(tmp_path):
    assert parse_qos(laughs(9, "map")) == parse_qos("[" * 10**5) == ()


@pytest.mark.parametrize("name", ["pipe.mcap", "bag/bag_0.mcap", "bag/metadata.yaml"])
def test_a_pipe_is_refused_instead_of_waited_for(tmp_path, name):
    write_bag(tmp_path / "bag", TOPICS)
    (tmp_path / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / name)
    with pytest.raises(BagError, match="not a regular file|is missing|none of the files"):
        BagReader((tmp_path / name) if name == "pipe.mcap" else tmp_path / "bag")


def test_a_device_is_no_bag():
    with pytest.raises(BagError, match="/dev/zero: cannot be read: it is not a regular file"):
        BagReader("/dev/zero")


def test_metadata_cannot_name_files_outside_the_folder(tmp_path):
    write_bag(tmp_path / "secret.mcap", TOPICS)
    bag = tmp_path / "bag"
    folder(INFORMATION.replace("a.mcap", "../secret.mcap") + "  storage_identifier: mcap")(bag)
    with pytest.raises(BagError, match="none of the files"):
        BagReader(bag)


def test_a_topic_of_two_types_is_refused(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    write_bag(bag / "bag_0.mcap", TOPICS)
    write_foreign_bag(bag / "bag_1.mcap", TOPICS, type_name="std_msgs/msg/String")
    with pytest.raises(BagError, match="two types"):
        BagReader(bag)


def test_chunks_that_all_overlap_do_not_eat_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("frac_accel.io.bag.reader.MAX_OPEN_BYTES", 30_000)
    path = tmp_path / "overlap.mcap"
    write_foreign_bag(path, TOPICS, compression=CompressionType.LZ4)
    assert len(read_all(path)[1]) == 2
    topics = {f"/topic{i}": random_samples(i, 200) for i in range(10)}
    write_foreign_bag(path, topics, one_topic_after_the_other=True)
    with pytest.raises(BagError, match="overlap"):
        read_all(path)
