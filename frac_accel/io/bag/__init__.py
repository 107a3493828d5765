"""Bags: MCAP as rosbag2 and Foxglove write and read it, bare or in a rosbag2 folder.

`read_bag` and `write_bag` handle whole topics in memory; `BagReader` and `BagWriter` stream.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from frac_accel.errors import BagError
from frac_accel.io import cdr
from frac_accel.io.bag.qos import Qos
from frac_accel.io.bag.reader import BagReader, Block, Message, TopicInfo
from frac_accel.io.bag.writer import BagWriter
from frac_accel.io.cdr import Temperatures
from frac_accel.io.samples import Samples
from frac_accel.io.topics import CORRECTED_TOPIC, RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC

__all__ = [
    "REFERENCE_TOPIC",
    "RAW_TOPIC",
    "CORRECTED_TOPIC",
    "TEMPERATURE_TOPIC",
    "BagError",
    "BagReader",
    "BagWriter",
    "Block",
    "Message",
    "Qos",
    "Samples",
    "Temperatures",
    "TopicInfo",
    "read_bag",
    "read_temperature",
    "write_bag",
]

# Blocks of a topic that are put together at a time: many small arrays leave memory in pieces.
_TOGETHER = 64


def read_bag(path: str | Path, topics: Sequence[str] | None = None) -> dict[str, Samples]:
    """Samples of whole topics.

    Parameters
    ----------
    path : bare .mcap or rosbag2 folder
    topics : names; default: every topic of an acceleration type that has messages

    Raises
    ------
    BagError
        If the bag or a topic cannot be read, a topic is missing, of another type or empty.

    Examples
    --------
    >>> import frac_accel
    >>> frac_accel.read_bag("bags/classical_bench.mcap")["/imu/data_raw"].values.shape
    (4000, 3)
    """
    reader = BagReader(path)
    if topics is None:
        topics = [
            info.name
            for info in reader.topics.values()
            if info.type_name in cdr.ACCELERATION_TYPES and info.count
        ]
    blocks: dict[str, list[Samples]] = {name: [] for name in topics}
    latest: dict[str, list[Samples]] = {name: [] for name in topics}
    for name, samples in reader.samples(topics):
        latest[name].append(samples)
        if len(latest[name]) == _TOGETHER:
            blocks[name].append(Samples.concatenate(latest[name]))
            latest[name].clear()
    for name, of_topic in blocks.items():
        of_topic += latest.pop(name)
        if not of_topic:
            raise BagError(f"{path}: topic {name} has no messages")
    # one after the other, each without its blocks: a long topic is in memory twice only by itself
    return {name: Samples.concatenate(blocks.pop(name)) for name in list(blocks)}


def read_temperature(path: str | Path, topic: str = TEMPERATURE_TOPIC) -> Temperatures:
    """A whole ``sensor_msgs/Temperature`` topic; raises as `read_bag`."""
    blocks = list(BagReader(path).temperatures(topic))
    if not blocks:
        raise BagError(f"{path}: topic {topic} has no messages")
    columns = list(zip(*blocks))[:3]
    return Temperatures(*(np.concatenate(column) for column in columns), blocks[0].frame_id)


def write_bag(path: str | Path, topics: Mapping[str, Samples | Temperatures]) -> None:
    """Write whole topics, interleaved by their stamps.

    Samples are written as ``sensor_msgs/msg/Imu``, temperatures as ``sensor_msgs/msg/Temperature``.
    The log time is the latest stamp so far, so that a stamp that goes back keeps its place.

    Parameters
    ----------
    path : a name that ends in .mcap for a bare file (replaced if it exists), else a new folder

    Examples
    --------
    >>> import os, tempfile, frac_accel
    >>> topics = frac_accel.read_bag("bags/classical_bench.mcap")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     frac_accel.write_bag(os.path.join(folder, "copy.mcap"), topics)
    ...     sorted(os.listdir(folder)), sorted(topics)
    (['copy.mcap'], ['/imu/data_raw', '/imu/reference'])
    """
    names = list(topics)
    numbers = [np.full(len(topics[name].stamps_ns), i) for i, name in enumerate(names)]
    log_times = [
        np.maximum.accumulate(topics[name].stamps_ns)
        if len(topics[name].stamps_ns)
        else np.empty(0, np.int64)
        for name in names
    ]
    with BagWriter(path) as writer:
        messages: list[bytes] = []
        for name, content in topics.items():
            if isinstance(content, Temperatures):
                writer.add_topic(name, cdr.TEMPERATURE)
                messages += cdr.encode_temperatures(content)
            else:
                writer.add_topic(name, cdr.IMU)
                messages += cdr.encode_samples(cdr.IMU, content)
        if not names:
            return
        all_numbers, all_times = np.concatenate(numbers), np.concatenate(log_times)
        order = np.argsort(all_times, kind="stable")
        for i, number, time_ns in zip(
            order.tolist(), all_numbers[order].tolist(), all_times[order].tolist()
        ):
            writer.write(names[number], messages[i], time_ns)
