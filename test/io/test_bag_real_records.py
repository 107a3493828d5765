"""The measured records outside the repository are read whole (skipped where they are absent)."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from frac_accel.io import cdr
from frac_accel.io.bag import BagReader, read_bag

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
NAMES = ["mems_package_sweep", "shock_ptb"] + [
    f"shaking_table_earthquake-test{number}" for number in (1, 5, 9)
]


@pytest.mark.parametrize("name", NAMES)
def test_every_message_is_read_as_the_mcap_library_does(name):
    path = DATA / f"{name}.mcap"
    if not path.exists():
        pytest.skip(f"{path} is absent")
    reader = BagReader(path)
    assert not reader.recovered
    topics = read_bag(path)
    assert {"/imu/reference", "/imu/data_raw"} <= set(topics)
    messages = {topic: [] for topic in topics}
    with open(path, "rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            messages[channel.topic].append(message.data)
    for topic, samples in topics.items():
        assert reader.topics[topic].count == len(samples.stamps_ns) == len(messages[topic])
        body = np.array([np.frombuffer(data, "<f8", 3, 228) for data in messages[topic]])
        np.testing.assert_array_equal(samples.values, body)
        assert cdr.read_header(messages[topic][0]).body_offset + 200 == 228
