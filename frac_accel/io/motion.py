"""Orientation and angular velocity of an Imu at the instant of its corrected acceleration.

A corrected message is stamped with the instant that its acceleration estimates, the
accelerometer's own delay before the raw stamp. What else it says belongs to the raw stamp, so it is
interpolated: the angular velocity linearly, the orientation along the chord between quaternions,
which differs from the arc by less than 1e-3 of the angle for steps below 10 degrees.
"""

import struct

import numpy as np

from . import cdr

# Offsets behind the header, as in `cdr`: the orientation is the first.
_ORIENTATION_COVARIANCE, _ANGULAR_VELOCITY, _ITS_COVARIANCE = 32, 104, 128


class MovedMotion:
    """Takes orientation and angular velocity to another instant, in blocks of any length.

    Parameters
    ----------
    type_name : str
        Only an Imu has both; other messages stay as they are.
    """

    def __init__(self, type_name):
        self._is_imu = type_name == cdr.IMU
        self._past = np.empty(0, np.int64), np.empty((0, 7))

    def moved(self, messages, delay_ns):
        """The next messages, with these fields as they were `delay_ns` before the stamp.

        A field that says of itself that it is not measured (REP-145: first element of its
        covariance -1) stays. Before the first message it is as that one says.
        """
        if not (self._is_imu and delay_ns and messages):
            return messages
        headers = [cdr.read_header(message) for message in messages]
        stamps = np.array([header.stamp_ns for header in headers], np.int64)
        # a clock that was set back begins anew
        starts = [0, *(np.flatnonzero(np.diff(stamps) <= 0) + 1).tolist(), len(stamps)]
        result = []
        for start, stop in zip(starts[:-1], starts[1:]):
            part = slice(start, stop)
            result += self._moved(messages[part], headers[part], stamps[part], delay_ns)
        return result

    def _moved(self, messages, headers, stamps, delay_ns):
        own = np.array([[*_doubles(message, header, 0, 4),
                         *_doubles(message, header, _ANGULAR_VELOCITY, 3)]
                        for message, header in zip(messages, headers)])
        if len(self._past[0]) and stamps[0] <= self._past[0][-1]:
            self._past = self._past[0][:0], self._past[1][:0]
        at = stamps - delay_ns
        times = np.concatenate([self._past[0], stamps])
        motion = np.concatenate([self._past[1], own])
        after = np.clip(np.searchsorted(times, at), min(1, len(times) - 1), len(times) - 1)
        before = np.maximum(after - 1, 0)
        self._past = times[before[-1]:], motion[before[-1]:]
        step = np.maximum(times[after] - times[before], 1)
        share = np.clip((at - times[before]) / step, 0.0, 1.0)[:, None]
        first, second = motion[before], motion[after].copy()
        with np.errstate(all="ignore"):
            # q and -q are the same orientation
            alike = (first[:, :4] * second[:, :4]).sum(axis=1, keepdims=True)
            second[:, :4] *= np.where(alike < 0, -1.0, 1.0)
            between = first + share * (second - first)
            size = np.sqrt((between[:, :4]**2).sum(axis=1, keepdims=True))
            between[:, :4] /= np.where(size > 0, size, 1.0)
        return [_patched(message, header, each)
                for message, header, each in zip(messages, headers, between.tolist())]


def _doubles(message, header, offset, count):
    return struct.unpack_from(f"{header.byte_order}{count}d", message, header.body_offset + offset)


def _patched(message, header, motion):
    patched = bytearray(message)
    for values, offset, covariance in ((motion[:4], 0, _ORIENTATION_COVARIANCE),
                                       (motion[4:], _ANGULAR_VELOCITY, _ITS_COVARIANCE)):
        if _doubles(message, header, covariance, 1)[0] != -1.0:
            struct.pack_into(f"{header.byte_order}{len(values)}d", patched,
                             header.body_offset + offset, *values)
    return bytes(patched)
