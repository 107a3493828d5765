"""Player and recorder over real DDS in separate processes: byte for byte, and hard to kill."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from bag_fixtures import START_NS, random_samples, write_foreign_bag
from mcap.reader import NonSeekingReader
from ros_processes import NodeProcess, ros_domain

from frac_accel.io import cdr
from frac_accel.io.bag import BagReader, BagWriter, Qos, read_bag, write_bag

pytestmark = pytest.mark.ros

TOPICS = {"/imu/reference": random_samples(1, 2000), "/imu/data_raw": random_samples(2, 2000)}
MATCHED = {"wait_for_subscribers": 1}


@pytest.fixture
def environment():
    with ros_domain() as environment:
        yield environment


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("player") / "bag.mcap"
    write_bag(path, TOPICS)
    return path


def data_of(path, topic):
    return [message.data for message in BagReader(path).messages([topic])]


def play_and_record(environment, bag, output, player=None, recorder=None):
    """Outputs of both, after both have ended by themselves."""
    count = BagReader(bag).message_count
    recording = {"bag": output, "max_messages": count, **(recorder or {})}
    with NodeProcess("recorder", environment, recording) as to_bag:
        with NodeProcess("player", environment, {"bag": bag, **MATCHED, **(player or {})}) as play:
            assert play.wait() == 0, play.text
            assert to_bag.wait() == 0, to_bag.text
            return play, to_bag


@pytest.mark.parametrize("rate, output", [(1.0, "out.mcap"), (0.0, "out"), (7.5, "out.mcap")])
def test_every_message_arrives_unchanged(environment, bag, tmp_path, rate, output):
    path = tmp_path / output
    play, to_bag = play_and_record(environment, bag, path, {"rate": rate})
    reader = BagReader(path)
    assert not reader.recovered
    for topic in TOPICS:
        assert data_of(path, topic) == data_of(bag, topic)
        assert f"{topic}: 2000 messages sent" in play.output
        assert f"{topic}: 2000 messages recorded" in to_bag.output
        assert reader.topics[topic].metadata["topic_type_hash"].startswith("RIHS01_7d9a00ff")
    # In order over both topics, and never before its time.
    sent = [(m.publish_time_ns, m.topic) for m in reader.messages()]
    recorded = [(m.log_time_ns, m.topic) for m in BagReader(bag).messages()]
    assert [topic for _, topic in sorted(sent)] == [topic for _, topic in recorded]
    if rate:
        since_start = (np.array([t for t, _ in recorded]) - recorded[0][0]) / rate
        played = np.sort([t for t, _ in sent])
        assert (played - played[0] - since_start > -1e6).all()


def test_any_type_with_its_own_qos(environment, tmp_path):
    samples = random_samples(3, 50)
    source = tmp_path / "source.mcap"
    string = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00"
    with BagWriter(source) as writer:
        writer.add_topic("/accel/blocks_raw", cdr.POINT_CLOUD2, (Qos(),))
        writer.add_topic("/latched", "std_msgs/msg/String", (Qos(durability="transient_local"),))
        writer.add_topic("/fast", cdr.ACCEL_STAMPED, (Qos("best_effort"),))
        writer.write("/latched", string, START_NS)
        for i, message in enumerate(cdr.encode_samples(cdr.ACCEL_STAMPED, samples)):
            writer.write("/fast", message, START_NS + i * 1_000_000)
        writer.write("/accel/blocks_raw", cdr.encode_point_cloud(samples), START_NS + 10**8)
    output = tmp_path / "out.mcap"
    play_and_record(environment, source, output)
    before, after = BagReader(source), BagReader(output)
    for topic, info in before.topics.items():
        # The middleware pads a message to a multiple of four bytes on its way.
        padded = [data + bytes(-len(data) % 4) for data in data_of(source, topic)]
        assert data_of(output, topic) == padded
        recorded = after.topics[topic]
        assert (recorded.type_name, recorded.qos) == (info.type_name, info.qos)
        assert recorded.schema_text == info.schema_text != b""
        assert recorded.metadata == info.metadata


def test_restamping_moves_all_stamps_alike(environment, bag, tmp_path):
    before = time.time_ns()
    play_and_record(environment, bag, tmp_path / "out.mcap", {"restamp": True, "rate": 10.0})
    after = read_bag(tmp_path / "out.mcap")
    shifts = np.concatenate(
        [after[topic].stamps_ns - samples.stamps_ns for topic, samples in TOPICS.items()]
    )
    assert (shifts == shifts[0]).all()
    first = min(samples.stamps_ns[0] for samples in after.values())
    assert before < first < time.time_ns()
    for topic, samples in TOPICS.items():
        np.testing.assert_array_equal(after[topic].values, samples.values)


def test_a_loop_goes_on_until_it_is_stopped(environment, tmp_path):
    source = tmp_path / "short.mcap"
    write_bag(source, {"/imu/data_raw": random_samples(4, 100)})
    output = tmp_path / "out.mcap"
    recording = {"bag": output, "max_messages": 250}
    playing = {"bag": source, "loop": True, "restamp": True, **MATCHED}
    with NodeProcess("recorder", environment, recording) as to_bag:
        with NodeProcess("player", environment, playing) as play:
            assert to_bag.wait() == 0, to_bag.text
            assert play.stop() == 0, play.text
            play.wait_for("messages sent")
    read = read_bag(output)["/imu/data_raw"]
    values = random_samples(4, 100).values
    np.testing.assert_array_equal(read.values, np.concatenate([values] * 3)[:250])
    assert (np.diff(read.stamps_ns) > 0).all()


def flushed_count(process):
    counts = [re.search(r"(\d+) messages are safe", line) for line in process.errors]
    return max((int(match[1]) for match in counts if match), default=0)


@pytest.mark.parametrize("output", ["killed.mcap", "killed"])
def test_a_killed_recorder_leaves_all_that_was_flushed(environment, bag, tmp_path, output):
    path = tmp_path / output
    recording = {"bag": path, "flush_period_s": 0.1}
    with NodeProcess(
        "recorder", environment, recording, "--log-level", "recorder:=debug"
    ) as to_bag:
        with NodeProcess("player", environment, {"bag": bag, "loop": True, **MATCHED}) as play:
            deadline = time.monotonic() + 30
            while flushed_count(to_bag) < 1000 and time.monotonic() < deadline:
                time.sleep(0.005)
            to_bag.process.send_signal(signal.SIGKILL)
            assert to_bag.wait() == -signal.SIGKILL
            assert play.stop() == 0, play.text
    safe = flushed_count(to_bag)
    assert safe >= 1000, to_bag.text
    reader = BagReader(path)
    assert reader.recovered and reader.message_count >= safe
    found = 0
    for topic in TOPICS:
        data = data_of(path, topic)
        played = data_of(bag, topic)
        assert data == (played * (len(data) // len(played) + 1))[: len(data)]
        found += len(data)
    assert found == reader.message_count
    file = path if path.is_file() else next(path.glob("*.mcap"))
    with open(file, "rb") as stream:
        messages = NonSeekingReader(stream).iter_messages(log_time_order=False)
        theirs = 0
        try:
            for _ in messages:
                theirs += 1
        except Exception as error:  # how the mcap library ends a file that is cut
            print(repr(error))
    assert theirs == found
    recovered = tmp_path / "recovered.mcap"
    tool = Path(sys.executable).with_name("pymcap-cli")
    subprocess.run([tool, "recover", file, "-o", recovered], check=True, capture_output=True)
    assert BagReader(recovered).message_count == found
    for topic in TOPICS:
        assert data_of(recovered, topic) == data_of(path, topic)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_recorder_closes_its_bag(environment, bag, tmp_path, number):
    path = tmp_path / "out.mcap"
    # Nothing is flushed before the end: what is still in the chunk is written when it stops.
    with NodeProcess("recorder", environment, {"bag": path, "flush_period_s": 60.0}) as to_bag:
        with NodeProcess("player", environment, {"bag": bag, "rate": 4.0, **MATCHED}) as play:
            assert play.wait() == 0, play.text
            assert to_bag.stop(number) == 0, to_bag.text
    reader = BagReader(path)
    assert not reader.recovered
    for topic in TOPICS:
        assert data_of(path, topic) == data_of(bag, topic)
    tool = Path(sys.executable).with_name("pymcap-cli")
    assert subprocess.run([tool, "doctor", path], capture_output=True).returncode == 0


def test_an_idle_recorder_stops_by_itself(environment, bag, tmp_path):
    recording = {
        "bag": tmp_path / "out.mcap",
        "topics": ["/imu/data_raw", "/never"],
        "idle_timeout_s": 1.0,
    }
    playing = {"bag": bag, "topics": ["/imu/data_raw"], "rate": 10.0, **MATCHED}
    with NodeProcess("recorder", environment, recording) as to_bag:
        with NodeProcess("player", environment, playing) as play:
            assert play.wait() == 0, play.text
        assert to_bag.wait() == 0, to_bag.text
    assert to_bag.output == [
        "/imu/data_raw: 2000 messages recorded",
        "/never: never had a publisher, nothing recorded",
    ]


def test_an_incompatible_publisher_is_named(environment, bag, tmp_path):
    with NodeProcess("recorder", environment, {"bag": tmp_path / "out.mcap"}) as to_bag:
        playing = {"bag": bag, "topics": ["/imu/data_raw"], "loop": True, **MATCHED}
        with NodeProcess("player", environment, playing):
            to_bag.wait_for("recording /imu/data_raw")
            weaker = {
                "bag": bag,
                "topics": ["/imu/data_raw"],
                "loop": True,
                "qos_overrides./imu/data_raw.publisher.reliability": "best_effort",
            }
            with NodeProcess("player", environment, weaker, "-r", "__node:=other"):
                line = to_bag.wait_for("incompatible")
    assert "/imu/data_raw" in line and "RELIABILITY" in line


def unknown_type(path):
    write_foreign_bag(
        path, {"/imu/data_raw": random_samples(1, 5)}, type_name="no_such_pkg/msg/Thing"
    )


@pytest.mark.parametrize(
    "node, parameters, says",
    [
        ("player", {}, "parameter 'bag' is missing"),
        ("player", {"bag": "/nowhere/x.mcap"}, "/nowhere/x.mcap: no such bag"),
        ("player", {"bag": "BAG", "topics": ["/x"]}, "has no topic /x; it has /imu/reference"),
        ("player", {"bag": "BAG", "rate": -1.0}, "'rate' must lie in [0.0, 1000000.0], got -1.0"),
        ("player", {"bag": "BAG", "rate": 2}, "expecting type 'DOUBLE', such as 1.0"),
        (
            "player",
            {"bag": "BAG", "wait_for_subscribers": 2, "wait_timeout_s": 0.2},
            "no subscribers within 0.2 s on /imu/reference (0 of 2), /imu/data_raw (0 of 2)",
        ),
        ("player", {"bag": "EMPTY"}, "file is empty"),
        ("player", {"bag": "UNKNOWN"}, "holds nothing that can be played"),
        (
            "player",
            {"bag": "UNKNOWN", "topics": ["/imu/data_raw"]},
            "message type no_such_pkg/msg/Thing is not installed here",
        ),
        ("recorder", {}, "parameter 'bag' is missing"),
        ("recorder", {"bag": "BAG"}, "exists already"),
        ("recorder", {"bag": "/nowhere/x.mcap"}, "/nowhere/x.mcap: cannot be written"),
        ("recorder", {"bag": "NEW", "depth": 0}, "'depth' must lie in [1, 10000000], got 0"),
        ("recorder", {"bag": "NEW", "topics": ["'bad topic'"]}, "topic name must not contain"),
    ],
)
def test_bad_input_is_one_clear_line(environment, bag, tmp_path, node, parameters, says):
    (tmp_path / "empty.mcap").touch()
    unknown_type(tmp_path / "unknown.mcap")
    paths = {
        "BAG": bag,
        "EMPTY": tmp_path / "empty.mcap",
        "UNKNOWN": tmp_path / "unknown.mcap",
        "NEW": tmp_path / "new.mcap",
    }
    if "bag" in parameters:
        parameters = {**parameters, "bag": paths.get(parameters["bag"], parameters["bag"])}
    with NodeProcess(node, environment, parameters) as process:
        assert process.wait() == 2, process.text
    (line,) = [line for line in process.errors if "error:" in line]
    assert line.startswith(f"{node}: error: ") and says in line
    assert "Traceback" not in process.text
    assert process.output == []
