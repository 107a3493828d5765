"""What is written to a bag is what is read from it, in order, in bounded memory."""

import tracemalloc

import numpy as np
import pytest
from bag_fixtures import START_NS, assert_equal, random_samples, write_foreign_bag
from mcap.writer import CompressionType

from frac_accel.io import cdr
from frac_accel.io.bag import (
    BagError,
    BagReader,
    BagWriter,
    Qos,
    Samples,
    Temperatures,
    read_bag,
    read_temperature,
    write_bag,
)

TOPICS = {
    "/imu/reference": random_samples(1, 3000, "table"),
    "/imu/data_raw": random_samples(2, 2500),
}


@pytest.mark.parametrize("name", ["bag.mcap", "folder"])
def test_write_then_read(tmp_path, name):
    write_bag(tmp_path / name, TOPICS)
    read = read_bag(tmp_path / name)
    assert list(read) == list(TOPICS)
    for topic, samples in TOPICS.items():
        assert_equal(read[topic], samples)
    reader = BagReader(tmp_path / name)
    assert (reader.warnings, reader.recovered, reader.message_count) == ([], False, 5500)
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_messages_come_in_log_order_whatever_the_order_on_disk(tmp_path):
    write_foreign_bag(tmp_path / "bag.mcap", TOPICS, one_topic_after_the_other=True)
    reader = BagReader(tmp_path / "bag.mcap")
    messages = list(reader.messages())
    times = [message.log_time_ns for message in messages]
    assert times == sorted(times) and len(times) == 5500
    for topic, samples in read_bag(tmp_path / "bag.mcap").items():
        assert_equal(samples, TOPICS[topic])
    of_blocks = {topic: [] for topic in TOPICS}
    for block in reader.blocks():
        of_blocks[block.topic.name] += block.messages
    for topic in TOPICS:
        assert of_blocks[topic] == [m.data for m in messages if m.topic == topic]


def test_equal_log_times_keep_the_order_on_disk(tmp_path):
    samples = random_samples(3, 3000)
    with BagWriter(tmp_path / "bag.mcap") as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
        for i, message in enumerate(cdr.encode_samples(cdr.IMU, samples)):
            writer.write("/imu/data_raw", message, START_NS + i // 1000)
            if i % 100 == 99:
                writer.flush()
    assert_equal(read_bag(tmp_path / "bag.mcap")["/imu/data_raw"], samples)


def test_stamps_that_go_back_keep_their_place(tmp_path):
    samples = random_samples(4, 500)
    stamps = samples.stamps_ns.copy()
    stamps[200:220] -= 10**9
    samples = samples._replace(stamps_ns=stamps)
    write_bag(tmp_path / "bag.mcap", {"/imu/data_raw": samples})
    assert_equal(read_bag(tmp_path / "bag.mcap")["/imu/data_raw"], samples)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("use_chunking", [True, False])
def test_every_compression_and_none(tmp_path, compression, use_chunking):
    path = tmp_path / "bag.mcap"
    write_foreign_bag(path, TOPICS, compression=compression, use_chunking=use_chunking)
    reader = BagReader(path)
    assert [info.count for info in reader.topics.values()] == [3000, 2500]
    assert not reader.recovered
    for topic, samples in read_bag(path).items():
        assert_equal(samples, TOPICS[topic])


def test_a_bag_without_summary_records_is_whole(tmp_path):
    path = tmp_path / "bag.mcap"
    write_foreign_bag(
        path, TOPICS, repeat_channels=False, repeat_schemas=False, use_statistics=False
    )
    reader = BagReader(path)
    assert [info.count for info in reader.topics.values()] == [3000, 2500]
    assert not reader.recovered


def test_split_bags_are_read_in_order(tmp_path):
    samples = random_samples(5, 3000)
    folder = tmp_path / "split"
    folder.mkdir()
    names = []
    for part in range(12):
        cut = Samples(*(column[part * 250 : (part + 1) * 250] for column in samples[:3]), "a")
        names.append(f"split_{part}.mcap")
        write_bag(folder / names[-1], {"/imu/data_raw": cut})
    # rosbag2 wrote paths relative to the folder or to its parent, depending on the version.
    metadata = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n"
    metadata += "  relative_file_paths: [" + ", ".join(f"split/{name}" for name in names) + "]\n"
    (folder / "metadata.yaml").write_text(metadata)
    reader = BagReader(folder)
    assert reader.topics["/imu/data_raw"].count == 3000 and not reader.recovered
    assert_equal(read_bag(folder)["/imu/data_raw"], samples._replace(frame_id="a"))
    (folder / "metadata.yaml").unlink()
    reader = BagReader(folder)
    assert reader.recovered and "metadata.yaml" in reader.warnings[0]
    assert_equal(read_bag(folder)["/imu/data_raw"], samples._replace(frame_id="a"))
    (folder / "split_3.mcap").write_bytes(b"")
    assert len(read_bag(folder)["/imu/data_raw"].stamps_ns) == 2750


def test_point_cloud_accel_stamped_and_temperature_topics(tmp_path):
    samples = random_samples(6, 1000)
    with BagWriter(tmp_path / "bag.mcap") as writer:
        for topic, type_name in (
            ("/blocks", cdr.POINT_CLOUD2),
            ("/accel", cdr.ACCEL_STAMPED),
            ("/imu/temperature", cdr.TEMPERATURE),
        ):
            assert writer.add_topic(topic, type_name)
        accel = cdr.encode_samples(cdr.ACCEL_STAMPED, samples)
        for i, stamp in enumerate(samples.stamps_ns.tolist()):
            writer.write("/accel", accel[i], stamp)
            if i % 100 == 0:
                block = Samples(*(column[i : i + 100] for column in samples[:3]), "accel_link")
                writer.write("/blocks", cdr.encode_point_cloud(block), stamp)
                temperature = cdr.encode_temperature(stamp, 25.0 + i, 0.5, "t")
                writer.write("/imu/temperature", temperature, stamp)
    unknown = samples._replace(variance=np.full((1000, 3), np.nan))
    for read in read_bag(tmp_path / "bag.mcap").values():
        assert_equal(read, unknown)
    temperature = read_temperature(tmp_path / "bag.mcap")
    assert temperature.celsius.tolist() == [25.0 + i for i in range(0, 1000, 100)]
    assert temperature.stamps_ns.tolist() == samples.stamps_ns[::100].tolist()


def test_temperatures_beside_samples(tmp_path):
    samples = TOPICS["/imu/data_raw"]
    variance = np.full(25, np.nan)
    variance[3] = 0.5
    written = Temperatures(samples.stamps_ns[::100], np.linspace(-10, 60, 25), variance, "housing")
    write_bag(tmp_path / "bag.mcap", {"/imu/data_raw": samples, "/imu/temperature": written})
    assert_equal(read_bag(tmp_path / "bag.mcap")["/imu/data_raw"], samples)
    read = read_temperature(tmp_path / "bag.mcap")
    assert read.frame_id == "housing"
    for one, other in zip(read[:3], written[:3]):
        np.testing.assert_array_equal(one, other)
    stamps = [message.log_time_ns for message in BagReader(tmp_path / "bag.mcap").messages()]
    assert stamps == sorted(stamps) and len(stamps) == 2525


def test_topics_are_copied_as_they_are(tmp_path):
    qos = (Qos("best_effort", "transient_local", "keep_all", 7), Qos())
    with BagWriter(tmp_path / "one.mcap") as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU, qos)
        assert not writer.add_topic("/unknown", "no_such_pkg/msg/Thing", type_hash="RIHS01_x")
        writer.write("/unknown", b"\x00\x01\x00\x00\x07", 5, 3)
        writer.write("/imu/data_raw", b"\x00\x01\x00\x00", 5, 4)
    one = BagReader(tmp_path / "one.mcap")
    assert one.topics["/imu/data_raw"].qos == qos
    with BagWriter(tmp_path / "two") as writer:
        for info in one.topics.values():
            writer.copy_topic(info)
        writer.copy_topic(one.topics["/imu/data_raw"], "/imu/data")
        for message in one.messages():
            writer.write(message.topic, message.data, *message[2:])
    two = BagReader(tmp_path / "two")
    assert list(two.messages()) == list(one.messages())
    assert {name: two.topics[name] for name in one.topics} == one.topics
    copied = two.topics["/imu/data"]
    assert copied == one.topics["/imu/data_raw"]._replace(name="/imu/data", count=0)


def test_an_abandoned_writer_leaves_nothing(tmp_path):
    for name in ("bag.mcap", "folder"):
        with pytest.raises(RuntimeError):
            with BagWriter(tmp_path / name) as writer:
                writer.add_topic("/imu/data_raw", cdr.IMU)
                raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_targets_that_cannot_be_written(tmp_path):
    write_bag(tmp_path / "folder", TOPICS)
    write_bag(tmp_path / "bag.mcap", TOPICS)
    write_bag(tmp_path / "bag.mcap", TOPICS)
    with pytest.raises(BagError, match="exists"):
        write_bag(tmp_path / "folder", TOPICS)
    with pytest.raises(BagError, match="exists"):
        BagWriter(tmp_path / "bag.mcap", in_place=True)
    with pytest.raises(BagError, match="cannot be written"):
        write_bag(tmp_path / "no" / "such.mcap", TOPICS)
    with pytest.raises(BagError, match="cannot be written"):
        write_bag("/dev/full/x.mcap", TOPICS)
    before = Samples.of([-1], np.zeros((1, 3)))
    with pytest.raises(BagError, match="out of range"):
        write_bag(tmp_path / "bag.mcap", {"/imu/data_raw": before})
    assert len(read_bag(tmp_path / "bag.mcap")) == 2


def test_flushed_messages_are_readable_while_writing(tmp_path):
    path = tmp_path / "bag.mcap"
    messages = cdr.encode_samples(cdr.IMU, random_samples(8, 100))
    with BagWriter(path, in_place=True) as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
        with pytest.raises(BagError, match="empty"):
            BagReader(path)
        for i, message in enumerate(messages):
            writer.write("/imu/data_raw", message, START_NS + i)
            if i % 10 == 9:
                writer.flush()
                reader = BagReader(path)
                assert [m.data for m in reader.messages()] == messages[: i + 1]
                assert reader.recovered
    assert not BagReader(path).recovered


def test_memory_does_not_grow_with_the_bag(tmp_path):
    """Peak memory for a bag of 60 MB of messages stays below 12 of its chunks of 1 MiB."""
    path = tmp_path / "bag.mcap"
    messages = cdr.encode_samples(cdr.IMU, random_samples(9, 2000))
    total = 0
    with BagWriter(path) as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
        for i in range(180_000):
            writer.write("/imu/data_raw", messages[i % 2000], START_NS + i)
            total += len(messages[0])
    assert total > 55 * 2**20
    tracemalloc.start()
    reader = BagReader(path)
    blocks = reader.samples(["/imu/data_raw"])
    assert sum(len(samples.stamps_ns) for _, samples in blocks) == 180_000
    assert sum(1 for _ in reader.messages()) == 180_000
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 12 * 2**20
