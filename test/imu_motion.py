"""Imu messages of a body that turns, with the exact orientation and angular velocity."""

import numpy as np
from rosbags.typesys import Stores, get_typestore

from frac_accel.io import cdr

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
START_NS = 1_700_000_000 * 10**9
RATE_HZ = 100.0


def seconds(stamps_ns):
    return 1e-9 * (stamps_ns - START_NS)


def orientation(t):
    """Turning about z with up to a radian a second; x, y, z, w."""
    angle = np.sin(t)
    return np.stack([0 * t, 0 * t, np.sin(angle / 2), np.cos(angle / 2)], axis=1)


def angular_velocity(t):
    return np.stack([0 * t, np.sin(3 * t), np.cos(t)], axis=1)


def messages(stamps_ns, known=(True, True), flipped=False):
    t = seconds(stamps_ns)
    result = []
    for i, (stamp, q, rate) in enumerate(zip(stamps_ns.tolist(), orientation(t),
                                             angular_velocity(t))):
        header = TYPES["std_msgs/msg/Header"](
            TYPES["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), "imu")
        covariances = [np.r_[0.01 if each else -1.0, np.zeros(8)] for each in known]
        q = -q if flipped and i % 2 else q
        result.append(TYPES[cdr.IMU](
            header, TYPES["geometry_msgs/msg/Quaternion"](*q), covariances[0],
            TYPES["geometry_msgs/msg/Vector3"](*rate), covariances[1],
            TYPES["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0), np.ones(9)))
    return [bytes(STORE.serialize_cdr(each, cdr.IMU)) for each in result]


def fields(data):
    read = [STORE.deserialize_cdr(each, cdr.IMU) for each in data]
    q, w = [each.orientation for each in read], [each.angular_velocity for each in read]
    return (np.array([[each.x, each.y, each.z, each.w] for each in q]),
            np.array([[each.x, each.y, each.z] for each in w]))


def stamps(count=400):
    return START_NS + (np.arange(count) * 1e9 / RATE_HZ).astype(np.int64)
