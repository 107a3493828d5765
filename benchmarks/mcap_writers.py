"""Our MCAP writer beside that of small_mcap and that of the mcap library, on the same messages.

Each writes the same `sensor_msgs/Imu` messages in chunks of 1 MiB with zstd. A node that is killed
has not finished its file: what a reader still finds after the last call that hands data on is in
the column on the right (small_mcap has no such call but that at the end).
"""

import io
import time

import numpy as np
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, Writer
from small_mcap import McapWriter as SmallWriter

from frac_accel import Samples
from frac_accel.io import cdr
from frac_accel.io.bag.mcap_writer import CHUNK_BYTES, McapWriter

COUNT, ROUNDS = 100_000, 5


def messages():
    """(data, stamp [ns]) of COUNT messages."""
    stamps = 1_700_000_000 * 10**9 + np.arange(COUNT) * 1_000_000
    values = np.random.default_rng(0).normal(size=(COUNT, 3))
    return list(zip(cdr.encode_samples(cdr.IMU, Samples.of(stamps, values)), stamps.tolist()))


def ours(stream, content, finish=True):
    """frac_accel."""
    writer = McapWriter(stream, "ros2", "")
    channel = writer.register_channel("/imu", "cdr", writer.register_schema("Imu", "ros2msg", b"x"),
                                      {})
    for i in range(0, len(content), 500):
        writer.add_messages(channel, [(data, at, at) for data, at in content[i:i + 500]])
    writer.finish() if finish else writer.flush()


def small(stream, content, finish=True):
    """small_mcap."""
    writer = SmallWriter(stream, chunk_size=CHUNK_BYTES)
    writer.start("ros2", "")
    writer.add_schema(1, "Imu", "ros2msg", b"x")
    writer.add_channel(1, "/imu", "cdr", 1)
    for number, (data, at) in enumerate(content):
        writer.add_message(1, at, data, at, number)
    if finish:
        writer.finish()


def library(stream, content, finish=True):
    """mcap."""
    writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start("ros2", "")
    channel = writer.register_channel("/imu", "cdr",
                                      writer.register_schema("Imu", "ros2msg", b"x"))
    for number, (data, at) in enumerate(content):
        writer.add_message(channel, at, data, at, number)
    writer.finish() if finish else writer.flush()


def readable(write, content):
    """Messages that a reader finds in a file that was never finished."""
    stream = io.BytesIO()
    write(stream, content, finish=False)
    found, reader = 0, NonSeekingReader(io.BytesIO(stream.getvalue()))
    try:
        for _ in reader.iter_messages(log_time_order=False):
            found += 1
    except Exception:  # the file ends in its middle
        pass
    return found


def run():
    """Rows of the table."""
    content, best, sizes = messages(), {}, {}
    for _ in range(ROUNDS):
        for write in (ours, small, library):
            stream = io.BytesIO()
            start = time.process_time()
            write(stream, content)
            took = 1e6 * (time.process_time() - start) / COUNT
            best[write] = min(took, best.get(write, np.inf))
            sizes[write] = len(stream.getvalue())
    return [{"writer": write.__doc__.rstrip("."), "processor time per message [µs]": best[write],
             "file [MB]": sizes[write] / 1e6,
             f"of {COUNT} in a file not finished": readable(write, content)} for write in best]
