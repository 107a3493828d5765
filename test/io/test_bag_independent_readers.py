"""Other people's tools accept our bags, and we theirs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_fixtures import assert_equal, random_samples
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from frac_accel.io import cdr
from frac_accel.io.bag import BagReader, read_bag, write_bag

TOPICS = {"/imu/reference": random_samples(1, 5000), "/imu/data_raw": random_samples(2, 5000)}
STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope="module", params=["bag.mcap", "folder"])
def bag(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("bag") / request.param
    write_bag(path, TOPICS)
    return path


def mcap_of(bag: Path) -> Path:
    return bag if bag.is_file() else next(bag.glob("*.mcap"))


def test_rosbags_reads_ours(bag):
    with AnyReader([bag]) as reader:
        hashes = {connection.digest for connection in reader.connections}
        assert hashes <= {STORE.hash_rihs01(cdr.IMU), ""}
        stamps = {topic: [] for topic in TOPICS}
        values = {topic: [] for topic in TOPICS}
        for connection, log_time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            stamp = message.header.stamp
            assert log_time == stamp.sec * 10**9 + stamp.nanosec
            stamps[connection.topic].append(log_time)
            a = message.linear_acceleration
            values[connection.topic].append([a.x, a.y, a.z])
        qos = reader.connections[0].ext.offered_qos_profiles[0]
        assert (qos.reliability.name, qos.depth) == ("RELIABLE", 10)
    for topic, samples in TOPICS.items():
        np.testing.assert_array_equal(stamps[topic], samples.stamps_ns)
        np.testing.assert_array_equal(values[topic], samples.values)


def test_pymcap_doctor_finds_nothing(bag):
    doctor = subprocess.run(
        [Path(sys.executable).with_name("pymcap-cli"), "doctor", mcap_of(bag)],
        capture_output=True,
        text=True,
    )
    assert doctor.returncode == 0, doctor.stdout


def test_it_has_what_rosbag2_writes(bag):
    with open(mcap_of(bag), "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        (metadata,) = reader.iter_metadata()
        inner = yaml.safe_load(metadata.metadata["serialized_metadata"])
        summary = reader.get_summary()
        for channel in summary.channels.values():
            assert set(channel.metadata) == {"offered_qos_profiles", "topic_type_hash"}
            assert channel.message_encoding == "cdr"
        assert [schema.encoding for schema in summary.schemas.values()] == ["ros2msg"]
    assert (metadata.name, inner["version"], inner["message_count"]) == ("rosbag2", 9, 10000)
    if bag.is_dir():
        document = yaml.safe_load((bag / "metadata.yaml").read_text())
        assert document["rosbag2_bagfile_information"] == inner


@pytest.mark.parametrize("bare", [True, False])
def test_we_read_what_rosbags_writes(tmp_path, bare):
    folder = tmp_path / "theirs"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            topic: writer.add_connection(topic, cdr.IMU, typestore=STORE) for topic in TOPICS
        }
        for topic, samples in TOPICS.items():
            messages = cdr.encode_samples(cdr.IMU, samples)
            for stamp, message in zip(samples.stamps_ns.tolist(), messages):
                writer.write(connections[topic], stamp, message)
    path = next(folder.glob("*.mcap")) if bare else folder
    reader = BagReader(path)
    assert not reader.recovered and reader.message_count == 10000
    for topic, samples in read_bag(path).items():
        assert_equal(samples, TOPICS[topic])
