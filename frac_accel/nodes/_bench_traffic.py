"""Publisher and sink of the live benchmark, each a process of its own.

Both print ``ready`` once the other side has found them, do their work after a line on stdin, and
write what they saw to a file.
"""

import argparse
import json
import sys
import threading
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu, PointCloud2

from ..io import cdr
from ..io.samples import Samples
from ._bench_stamps import START_NS
from ._intake import RawSubscription

DEPTH = 20_000
QOS = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
TOPICS = {"imu": ("imu/data_raw", "imu/data", Imu),
          "blocks": ("accel/blocks_raw", "accel/blocks", PointCloud2)}
# Messages that a sink keeps as they came; a run of an hour would fill the memory with them.
_KEPT = 20_000


def encoded(kind, first, count, rate_hz, block):
    """Serialised messages of the samples from `first` on at `rate_hz`, `block` samples in each."""
    values = np.random.default_rng(0).standard_normal((count, 3))
    stamps = START_NS + np.round(np.arange(first, first + count) / rate_hz * 1e9).astype(np.int64)
    if kind == "imu":
        return cdr.encode_samples(cdr.IMU, Samples.of(stamps, values, np.full((count, 3), 1e-4)))
    return [cdr.encode_point_cloud(Samples.of(stamps[i:i + block], values[i:i + block]))
            for i in range(0, count, block)]


def publish(node, arguments):
    """Publish at a steady rate; the instants [ns] of sending go to the file."""
    topic, _, message_class = TOPICS[arguments.kind]
    publisher = node.create_publisher(message_class, topic, QOS)
    messages = encoded(arguments.kind, arguments.first, arguments.count, arguments.rate,
                       arguments.block)
    rate_hz = arguments.rate / arguments.block
    if not arguments.alone:
        _wait(lambda: publisher.get_subscription_count())
    _ready()
    sent = np.zeros(len(messages), np.int64)
    start = time.monotonic()
    for i, message in enumerate(messages):
        left = start + i / rate_hz - time.monotonic()
        if left > 0:
            time.sleep(left)
        sent[i] = time.time_ns()
        publisher.publish(message)
    publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=10))
    np.save(arguments.file, sent)


def receive(node, arguments):
    """Take all until a second line comes; stamps and instants [ns] of arrival go to the file."""
    _, topic, message_class = TOPICS[arguments.kind]
    arrived = _Arrived(arguments.kind)
    RawSubscription(node, message_class, topic, arrived.add, QOS)
    statuses = {}
    if arguments.counters:
        node.create_subscription(DiagnosticArray, "/diagnostics", lambda array: statuses.update(
            {status.name: {entry.key: entry.value for entry in status.values}
             for status in array.status}), 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    stop = threading.Event()

    def spin():
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.05)
            # in groups, since this process shares the other core with the publisher
            time.sleep(0.003)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        if not arguments.alone:
            _wait(lambda: node.count_publishers(topic))
        _ready()
        sys.stdin.readline()
    finally:
        stop.set()
        thread.join()
    np.save(arguments.file, arrived.all())
    if arguments.counters:
        with open(arguments.counters, "w", encoding="utf-8") as stream:
            json.dump(statuses, stream)


class _Arrived:
    """Stamps and instants of arrival [ns] of messages."""

    def __init__(self, kind):
        self._kind, self._messages, self._parts = kind, [], [np.empty((2, 0), np.int64)]

    def add(self, batch):
        self._messages += batch
        if len(self._messages) >= _KEPT:
            self._read()

    def all(self):
        """Shape (2, n)."""
        self._read()
        return np.concatenate(self._parts, axis=1)

    def _read(self):
        messages, self._messages = self._messages, []
        arrivals = np.array([message.received_time_ns for message in messages], np.int64)
        if self._kind == "imu":
            stamps = cdr.read_samples(cdr.IMU, [message.data for message in messages]).stamps_ns
        else:
            parts = [cdr.read_point_cloud(message.data).stamps_ns for message in messages]
            stamps = np.concatenate([np.empty(0, np.int64), *parts])
            arrivals = np.repeat(arrivals, [len(part) for part in parts])
        self._parts.append(np.stack([stamps, arrivals]))


def _ready():
    print("ready", flush=True)
    sys.stdin.readline()


def _wait(condition, seconds=30.0):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            sys.exit("nobody on the other side")
        time.sleep(0.02)


def main():
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("role", choices=("publish", "receive"))
    parser.add_argument("file")
    parser.add_argument("--kind", default="imu", choices=TOPICS)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first sample")
    parser.add_argument("--counters", help="file for the last diagnostics")
    parser.add_argument("--block", type=int, default=1)
    parser.add_argument("--alone", action="store_true", help="do not wait for the node")
    arguments = parser.parse_args()
    # signals end the process by KeyboardInterrupt, not by a context that vanishes under the threads
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node(f"benchmark_{arguments.role}")
    try:
        (publish if arguments.role == "publish" else receive)(node, arguments)
    except KeyboardInterrupt:
        sys.exit(1)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
