"""A node of the test's own: publishes raw bytes, collects messages, diagnostics and metrics."""

import contextlib
import os
import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from frac_accel.nodes._intake import RawSubscription

RELIABLE = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.BEST_EFFORT)


class Probe:
    """Context manager for a node; `environment` as `ros_processes.ros_domain` gives it."""

    def __init__(self, environment, name="probe"):
        self.environment = environment
        self._name = name
        self.statuses = []
        self.figures = {}
        self._received = {}

    def __enter__(self):
        self._before = {name: os.environ.get(name) for name in self.environment}
        os.environ.update(self.environment)
        self._context = Context()
        rclpy.init(context=self._context, domain_id=int(self.environment["ROS_DOMAIN_ID"]))
        self.node = Node(self._name, context=self._context)
        self.node.create_subscription(DiagnosticArray, "/diagnostics",
                                      lambda array: self.statuses.extend(array.status), 100)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()
        for name, value in self._before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value

    def _spin(self):
        while not self._stop.is_set():
            self._executor.spin_once(timeout_sec=0.02)

    def collect(self, message_class, topic):
        """List that grows with the serialised messages of a topic."""
        received = self._received.setdefault(topic, [])
        RawSubscription(self.node, message_class, topic,
                        lambda batch: received.extend(message.data for message in batch), RELIABLE)
        return received

    def watch(self, *topics):
        """Collect the values of Float64 topics in `figures`."""
        for topic in topics:
            values = self.figures.setdefault(topic, [])
            self.node.create_subscription(Float64, topic, lambda m, v=values: v.append(m.data), 10)

    def metrics(self, topic):
        """List that grows with stamp [ns] and values, a dict, of each message of metrics."""
        found = []
        self.node.create_subscription(DiagnosticArray, topic, lambda array: found.extend(
            (array.header.stamp.sec * 10**9 + array.header.stamp.nanosec,
             {pair.key: pair.value for pair in status.values}) for status in array.status), 10)
        return found

    def publisher(self, message_class, topic, qos=RELIABLE, subscriptions=1):
        """Publisher that has found its subscriptions."""
        publisher = self.node.create_publisher(message_class, topic, qos)
        self.until(lambda: publisher.get_subscription_count() >= subscriptions,
                   f"no subscription on {topic}")
        time.sleep(0.3)
        return publisher

    def status(self, text, seconds=20.0, ever=False):
        """First status whose message contains a text: from now on, or `ever`."""
        start = 0 if ever else len(self.statuses)
        found = []
        self.until(lambda: found or found.extend(s for s in self.statuses[start:]
                                                 if text in s.message),
                   lambda: f"no status with {text!r}: {[s.message for s in self.statuses[start:]]}",
                   seconds)
        return found[0]

    def set_parameter(self, node, name, value):
        """Result of setting a parameter."""
        client = self.node.create_client(SetParameters, f"/{node}/set_parameters")
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self._call(client, request).results[0]

    def trigger(self, service):
        """Response of a Trigger service."""
        return self._call(self.node.create_client(Trigger, service), Trigger.Request())

    def _call(self, client, request):
        """Response to a request; asked again, for one that comes before the server knows its
        client is answered to nobody.
        """
        assert client.wait_for_service(20.0)
        asked = []
        for _ in range(4):
            asked.append(client.call_async(request))
            with contextlib.suppress(AssertionError):
                self.until(lambda: any(future.done() for future in asked), "", 5.0)
                break
        self.until(lambda: any(future.done() for future in asked), "no response")
        return next(future.result() for future in asked if future.done())

    @staticmethod
    def until(condition, complaint, seconds=20.0):
        """Wait for a condition."""
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(complaint() if callable(complaint) else complaint)
            time.sleep(0.01)


def publish(publishers_and_messages, rate_hz=None, enough=None):
    """Publish pairs of publisher and messages side by side, at a rate or all at once; until an
    event says that it is `enough`.
    """
    start = time.monotonic()
    for i, together in enumerate(zip(*(messages for _, messages in publishers_and_messages))):
        if enough and enough.is_set():
            break
        if rate_hz:
            left = start + i / rate_hz - time.monotonic()
            if left > 1e-3:
                time.sleep(left)
        for (publisher, _), message in zip(publishers_and_messages, together):
            publisher.publish(message)


@contextlib.contextmanager
def background(function, *arguments):
    """Run a function in a thread for as long as the block lasts, at least."""
    thread = threading.Thread(target=function, args=arguments, daemon=True)
    thread.start()
    try:
        yield
    finally:
        thread.join()
