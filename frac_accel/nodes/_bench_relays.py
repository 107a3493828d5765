"""Nodes that the corrector is compared with: python -m frac_accel.nodes._bench_relays NAME.

They take ``imu/data_raw`` and publish it on ``imu/data``, all but one as it is.
"""

import sys

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from scipy.signal import butter, sosfilt
from sensor_msgs.msg import Imu

QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)


def typed(node):
    """What everyone writes: a typed callback on the default executor."""
    # as many as the command line says, each below a namespace, or one
    for prefix in [f"s{i}/" for i in range(int(sys.argv[2]))] if sys.argv[2:] else [""]:
        publisher = node.create_publisher(Imu, f"{prefix}imu/data", QOS)
        node.create_subscription(Imu, f"{prefix}imu/data_raw", publisher.publish, QOS)
    return SingleThreadedExecutor()


def typed_filter(node):
    """The same with a filter of order ten, one sample at a time, and a message of its own."""
    publisher = node.create_publisher(Imu, "imu/data", QOS)
    sections = butter(10, 0.5, output="sos")
    state = np.zeros((len(sections), 3, 2))

    def on_message(message):
        nonlocal state
        a = message.linear_acceleration
        filtered, state = sosfilt(sections, [[a.x], [a.y], [a.z]], zi=state)
        result = Imu(header=message.header, orientation=message.orientation,
                     orientation_covariance=message.orientation_covariance,
                     angular_velocity=message.angular_velocity,
                     angular_velocity_covariance=message.angular_velocity_covariance,
                     linear_acceleration_covariance=message.linear_acceleration_covariance)
        a = result.linear_acceleration
        a.x, a.y, a.z = filtered[:, 0].tolist()
        publisher.publish(result)

    node.create_subscription(Imu, "imu/data_raw", on_message, QOS)
    return SingleThreadedExecutor()


def raw(node):
    """Serialised messages, one by one, on rclpy's fastest executor."""
    publisher = node.create_publisher(Imu, "imu/data", QOS)
    node.create_subscription(Imu, "imu/data_raw", publisher.publish, QOS, raw=True)
    return EventsExecutor()


def raw_drained(node):
    """Serialised messages on the default executor, each callback taking all that wait."""
    publisher = node.create_publisher(Imu, "imu/data", QOS)

    def on_message(data):
        publisher.publish(data)
        with subscription.handle:
            while (taken := subscription.handle.take_message(Imu, True)) is not None:
                publisher.publish(taken[0])

    subscription = node.create_subscription(Imu, "imu/data_raw", on_message, QOS, raw=True)
    return SingleThreadedExecutor()


RELAYS = {"typed": typed, "typed_filter": typed_filter, "raw": raw, "raw_drained": raw_drained}


def main():
    """Entry point."""
    rclpy.init()
    node = Node("relay")
    executor = RELAYS[sys.argv[1]](node)
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
