"""Publisher and sink of the benchmark of many sensors, each a process of its own.

Both print ``ready`` once the other side has found them, do their work after a line on stdin, and
write what they saw to a file; the sink ends after a second line.
"""

import argparse
import sys
import threading
import time

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Imu

from ..io import cdr
from ..io.samples import Samples
from ._bench_relays import QOS
from ._bench_stamps import START_NS
from ._intake import DirectIntake, RawSubscription
from ._runtime import FracAccelNode


def publish(node, arguments):
    """Publish on all topics in turn; the instants [ns] of sending go to the file, (k, n)."""
    count, rate_hz = arguments.count, arguments.rate
    publishers = [node.create_publisher(Imu, f"s{i}/imu/data_raw", QOS)
                  for i in range(arguments.sensors)]
    stamps = START_NS + np.round(np.arange(count) / rate_hz * 1e9).astype(np.int64)
    values = np.random.default_rng(0).standard_normal((count, 3))
    messages = cdr.encode_samples(cdr.IMU, Samples.of(stamps, values, np.full((count, 3), 1e-4)))
    _await([publisher.get_subscription_count for publisher in publishers])
    sent = np.zeros((len(publishers), count), np.int64)
    start_s, step_s = time.monotonic(), 1 / (rate_hz * len(publishers))
    for number in range(count * len(publishers)):
        left_s = start_s + number * step_s - time.monotonic()
        if left_s > 1e-3:
            time.sleep(left_s)
        i, sensor = divmod(number, len(publishers))
        sent[sensor, i] = time.time_ns()
        publishers[sensor].publish(messages[i])
    for publisher in publishers:
        publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=10))
    np.save(arguments.file, sent)


def receive(node, arguments):
    """Take all until a second line comes; sensor, stamp and arrival [ns] go to the file, (3, n)."""
    batches = [[] for _ in range(arguments.sensors)]
    subscriptions = [RawSubscription(node, Imu, f"s{i}/imu/data", batch.extend, QOS, is_direct=True)
                     for i, batch in enumerate(batches)]
    _await([subscription.subscription.get_publisher_count for subscription in subscriptions])
    stop = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.readline(), stop.set()), daemon=True).start()
    node.latency_budget_s, intake = 0.003, DirectIntake(node)
    while not stop.is_set():
        intake.wait(0.1)
    rows = [(i, cdr.read_header(message.data).stamp_ns, message.received_time_ns)
            for i, batch in enumerate(batches) for message in batch]
    np.save(arguments.file, np.array(rows, np.int64).reshape(-1, 3).T)


def _await(counts, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not all(count() for count in counts):
        if time.monotonic() > deadline:
            sys.exit("nobody on the other side")
        time.sleep(0.05)
    print("ready", flush=True)
    sys.stdin.readline()


def main():
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("role", choices=("publish", "receive"))
    parser.add_argument("file")
    parser.add_argument("--sensors", type=int, required=True)
    parser.add_argument("--rate", type=float, required=True)
    parser.add_argument("--count", type=int, required=True)
    arguments = parser.parse_args()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = FracAccelNode(f"benchmark_{arguments.role}")
    try:
        (publish if arguments.role == "publish" else receive)(node, arguments)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
