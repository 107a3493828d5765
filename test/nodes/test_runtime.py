"""The nodes' shared subscription takes all waiting messages, counts losses, and falls back."""

import sys
import time
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402
from ros_processes import ros_domain  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from frac_accel.io import cdr  # noqa: E402
from frac_accel.nodes._channel import _node_of  # noqa: E402
from frac_accel.nodes._errors import NodeError  # noqa: E402
from frac_accel.nodes._intake import (  # noqa: E402
    DirectIntake,
    RawSubscription,
    publish_serialized,
)
from frac_accel.nodes._runtime import (  # noqa: E402
    FracAccelNode,
    import_message_class,
    normalised,
    run_node,
)

pytestmark = pytest.mark.ros


@pytest.fixture
def node(monkeypatch):
    with ros_domain() as environment:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        rclpy.init()
        node = FracAccelNode("test_runtime")
        yield node
        node.destroy_node()
        rclpy.try_shutdown()


def message(number):
    imu = Imu()
    imu.header.stamp.sec = number
    imu.header.frame_id = "imu"
    return serialize_message(imu)


def subscribe(node, depth, publisher_qos=10):
    """A publisher, matched with a `RawSubscription`, the batches it gets, and an executor."""
    batches = []
    publisher = node.create_publisher(Imu, "/imu/data_raw", publisher_qos)
    qos = QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST)
    subscription = RawSubscription(node, Imu, "/imu/data_raw", batches.append, qos)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + 20
    taker = subscription.subscription
    while not (publisher.get_subscription_count() and taker.get_publisher_count()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return publisher, subscription, batches, executor


def spin_until(executor, condition):
    deadline = time.monotonic() + 20
    while not condition() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)


@pytest.mark.parametrize("can_drain", [True, False])
def test_all_messages_come_once_and_in_order(node, can_drain):
    publisher, subscription, batches, executor = subscribe(node, 500, 500)
    if not can_drain:

        class WithoutTake:
            """A handle as of an rclpy in which the undocumented method is gone."""

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

        class Facade:
            handle = WithoutTake()
            topic_name = subscription.subscription.topic_name
            get_publisher_count = subscription.subscription.get_publisher_count

        subscription.subscription = Facade()
    sent = [message(number) for number in range(200)]
    for data in sent:
        publisher.publish(data)
    spin_until(executor, lambda: sum(map(len, batches)) == 200)
    assert [one.data for batch in batches for one in batch] == sent
    assert all(one.source_time_ns <= one.received_time_ns for batch in batches for one in batch)
    assert subscription.lost == 0
    if can_drain:
        assert max(map(len, batches)) > 10
    else:
        assert set(map(len, batches)) == {1}


def test_direct_subscriptions_need_no_executor_and_fall_back_on_it(node):
    batches = []
    publisher = node.create_publisher(Imu, "/imu/data_raw", 100)
    subscription = RawSubscription(node, Imu, "/imu/data_raw", batches.append,
                                   QoSProfile(depth=100), is_direct=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + 20
    while not subscription.subscription.get_publisher_count() and time.monotonic() < deadline:
        time.sleep(0.01)
    intake = DirectIntake(node)
    sent = [message(number) for number in range(20)]

    def received():
        return [one.data for batch in batches for one in batch]

    publish_serialized(publisher, sent[:10])
    executor.spin_once(timeout_sec=0.1)
    assert not batches
    while len(received()) < 10 and time.monotonic() < deadline:
        intake.wait(0.1)
    assert received() == sent[:10]
    intake._ready = None  # as in an rclpy without it
    intake.wait(0.1)
    assert not intake.is_possible
    publish_serialized(publisher, sent[10:])
    spin_until(executor, lambda: len(received()) == 20)
    assert received() == sent


def test_the_executor_has_a_turn_where_a_service_waits_and_none_otherwise(node):
    publisher = node.create_publisher(Imu, "/imu/data_raw", 100)
    batches = []
    RawSubscription(node, Imu, "/imu/data_raw", batches.append, QoSProfile(depth=100),
                    is_direct=True)
    node.create_service(Trigger, "~/ask", lambda _, response: response)
    client = node.create_client(Trigger, "~/ask")
    assert client.wait_for_service(20)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)
    intake = DirectIntake(node)
    publish_serialized(publisher, [message(0)])
    assert not intake.wait(0.3)
    assert [one.data for batch in batches for one in batch] == [message(0)]
    future = client.call_async(Trigger.Request())
    start = time.monotonic()
    assert intake.wait(5.0)
    assert time.monotonic() - start < 2.0
    spin_until(executor, future.done)


def test_a_topic_that_never_falls_silent_leaves_time_for_the_rest(node):
    publisher = node.create_publisher(Imu, "/imu/data_raw", 100)
    subscription = RawSubscription(
        node, Imu, "/imu/data_raw",
        lambda batch: (publisher.publish(message(0)), time.sleep(0.01)), QoSProfile(depth=100),
        is_direct=True)
    deadline = time.monotonic() + 20
    while not subscription.subscription.get_publisher_count() and time.monotonic() < deadline:
        time.sleep(0.01)
    publisher.publish(message(0))
    intake = DirectIntake(node)
    start = time.monotonic()
    intake.wait(0.1)
    assert time.monotonic() - start < 1.0


def test_serialised_messages_are_published_the_documented_way_where_there_is_no_other():
    class Publisher:
        published = []

        def publish(self, data):
            self.published.append(data)

    publish_serialized(Publisher(), [b"one", b"two"])
    assert Publisher.published == [b"one", b"two"]


def test_messages_that_did_not_fit_are_counted_as_lost(node):
    publisher, subscription, batches, executor = subscribe(node, 5, 500)
    publisher.publish(message(0))
    spin_until(executor, lambda: batches)
    for number in range(1, 101):
        publisher.publish(message(number))
    publisher.wait_for_all_acked()
    spin_until(executor, lambda: sum(map(len, batches)) == 6)
    stamps = [deserialize_message(one.data, Imu).header.stamp.sec for b in batches for one in b]
    assert stamps == [0, 96, 97, 98, 99, 100]
    assert subscription.lost == 95


def test_two_publishers_are_not_mistaken_for_losses(node):
    publisher, subscription, batches, executor = subscribe(node, 100, 100)
    other = node.create_publisher(Imu, "/imu/data_raw", 100)
    spin_until(executor, lambda: subscription.subscription.get_publisher_count() == 2)
    spin_until(executor, lambda: other.get_subscription_count() == 1)
    for _ in range(5):
        publisher.publish(message(1))
    for _ in range(20):
        publisher.publish(message(1))
        other.publish(message(2))
    spin_until(executor, lambda: sum(map(len, batches)) == 45)
    assert subscription.lost == 0


def test_what_waits_is_handed_over_before_the_end(node):
    publisher, subscription, batches, _ = subscribe(node, 100, 100)
    for number in range(50):
        publisher.publish(message(number))
    publisher.wait_for_all_acked()
    subscription.drain()
    assert [one.data for batch in batches for one in batch] == [message(n) for n in range(50)]


def test_quality_of_service_can_be_overridden():
    with ros_domain():
        name = "qos_overrides./imu/data_raw.subscription.reliability"
        rclpy.init(args=["--ros-args", "-p", f"{name}:=best_effort"])
        node = FracAccelNode("test_runtime")
        try:
            subscription = RawSubscription(node, Imu, "/imu/data_raw", print, QoSProfile(depth=5))
            reliability = subscription.subscription.qos_profile.reliability
            assert reliability == ReliabilityPolicy.BEST_EFFORT
            with pytest.raises(NodeError, match="bad topic"):
                RawSubscription(node, Imu, "bad topic", print, QoSProfile(depth=5))
        finally:
            node.destroy_node()
            rclpy.try_shutdown()


def test_big_endian_messages_are_normalised_by_the_middleware():
    store = get_typestore(Stores.ROS2_JAZZY)
    imu = store.deserialize_cdr(message(7), cdr.IMU)
    swapped = bytes(store.serialize_cdr(imu, cdr.IMU, little_endian=False))
    assert swapped != message(7)
    assert normalised(swapped, Imu) == message(7)
    with pytest.raises(NodeError, match="cannot be read"):
        normalised(b"\x00\x01\x00\x00\x01", Imu)


def test_message_classes_by_name():
    assert import_message_class("sensor_msgs/msg/Imu") is Imu
    for name in ("sensor_msgs/msg/NoSuch", "no_such_pkg/msg/Imu", "Imu", "os.path/x/y", ""):
        with pytest.raises(NodeError, match="is not"):
            import_message_class(name)


def test_arguments_that_are_not_for_ros_are_refused(monkeypatch, capsys):
    """``-p`` without ``--ros-args`` was passed over, and the corrector ran without a model."""
    monkeypatch.setattr(sys, "argv", ["corrector", "-p", "model_file:=sensor.yaml"])
    assert run_node(FracAccelNode) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "unknown argument -p: parameters come behind --ros-args" in line


def test_a_node_that_discovery_has_not_named_yet_is_not_called_by_a_code():
    known = SimpleNamespace(node_namespace="/axle", node_name="driver")
    unknown = SimpleNamespace(node_namespace="_NODE_NAMESPACE_UNKNOWN_",
                              node_name="_NODE_NAME_UNKNOWN_")
    assert _node_of(known) == "/axle/driver"
    assert _node_of(unknown) == "a node whose name has not come yet"
