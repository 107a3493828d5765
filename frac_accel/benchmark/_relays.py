"""Nodes that the corrector is compared with: python -m frac_accel.benchmark._relays NAME.

They take ``imu/data_raw`` and publish it on ``imu/data`` as it is: whatever filters costs more.
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

QOS = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)


def typed(node):
    """What everyone writes: a typed callback on the default executor."""
    publisher = node.create_publisher(Imu, "imu/data", QOS)
    node.create_subscription(Imu, "imu/data_raw", publisher.publish, QOS)
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


RELAYS = {"typed": typed, "raw": raw, "raw_drained": raw_drained}


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
