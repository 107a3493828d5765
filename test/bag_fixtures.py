"""Small random bags for the bag tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from frac_accel.io import cdr
from frac_accel.io.bag import Samples

START_NS = 1_700_000_000 * 10**9


def random_samples(seed: int, count: int, frame_id: str = "accel_link") -> Samples:
    """Samples at about 1 kHz with random variances."""
    rng = np.random.default_rng(seed)
    stamps = START_NS + np.cumsum(rng.integers(500_000, 1_500_000, size=count))
    variance = rng.uniform(0.1, 1, size=(count, 3))
    return Samples.of(stamps, rng.normal(size=(count, 3)), variance, frame_id)


def assert_equal(one: Samples, other: Samples) -> None:
    assert one.frame_id == other.frame_id
    for a, b in zip(one[:3], other[:3]):
        np.testing.assert_array_equal(a, b)


def write_foreign_bag(
    path: Path,
    topics: dict[str, Samples],
    *,
    profile: str = "ros2",
    type_name: str = cdr.IMU,
    message_encoding: str = "cdr",
    schema_encoding: str = "ros2msg",
    one_topic_after_the_other: bool = False,
    **writer_options,
) -> None:
    """A bag by the mcap library's own writer, with whatever is to be unusual about it."""
    options = {"chunk_size": 8000, "compression": CompressionType.ZSTD, **writer_options}
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile, "test")
        schema = writer.register_schema(type_name, schema_encoding, b"float64 x")
        entries = []
        for topic, samples in topics.items():
            channel = writer.register_channel(topic, message_encoding, schema)
            for message, stamp in zip(
                cdr.encode_samples(cdr.IMU, samples), samples.stamps_ns.tolist()
            ):
                entries.append((stamp, channel, message))
        if not one_topic_after_the_other:
            entries.sort(key=lambda entry: entry[0])
        for stamp, channel, message in entries:
            writer.add_message(channel, stamp, message, stamp)
        writer.finish()
