"""Messages wait until the filter gives out their samples; what they say of the motion is kept."""

import numpy as np
import pytest
from imu_motion import angular_velocity, fields, messages, seconds, stamps

from frac_accel.io import cdr
from frac_accel.model.file import SensorModel
from frac_accel.streaming.corrector import Corrector
from frac_accel.streaming.live_messages import SampleMessages
from frac_accel.streaming.waiting_messages import WaitingMessages

DELAY_NS = 23_400_000  # more than two of the samples
MOST = 1.2e-4          # of the angular velocity off between two samples: h²/8 of its curvature


def test_the_first_that_comes_out_has_the_motion_of_its_instant():
    at = stamps()
    waiting = WaitingMessages(cdr.IMU)
    waiting.add(messages(at), at.tolist())
    given, times = waiting.given(list(range(40, 300)), DELAY_NS)
    assert list(times) == at[40:300].tolist()
    _, rate = fields(given)
    assert np.abs(rate - angular_velocity(seconds(at[40:300] - DELAY_NS))).max() < MOST
    assert len(waiting) == 100


@pytest.mark.parametrize("seed", range(4))
def test_blocks_of_any_length_and_what_is_forgotten_change_nothing(seed):
    random = np.random.default_rng(seed)
    data, at = messages(stamps()), stamps()
    # some never come out: a warm-up, then here and there
    index = np.arange(60, 380)[random.random(320) > 0.1].tolist()
    whole = WaitingMessages(cdr.IMU)
    whole.add(data, at.tolist())
    expected, _ = whole.given(index, DELAY_NS)
    in_parts, result, count = WaitingMessages(cdr.IMU), [], 0
    while count < len(data):
        new = int(random.integers(1, 30))
        in_parts.add(data[count:count + new], at[count:count + new].tolist())
        count = min(count + new, len(data))
        ready = [i for i in index[len(result):] if i + 20 < count]
        result += in_parts.given(ready, DELAY_NS)[0]
        if random.random() < 0.3:
            in_parts.keep([i for i in index[len(result):] if i < count], DELAY_NS)
    result += in_parts.given(index[len(result):], DELAY_NS)[0]
    assert len(result) == len(expected)
    _, rate = fields(result)
    _, wanted = fields(expected)
    assert result[0] == expected[0]
    # what is forgotten among those that wait is interpolated over
    assert np.abs(rate - wanted).max() < np.diff(index).max()**2 * MOST


def test_a_corrected_topic_begins_with_the_motion_of_its_instant():
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"type": "oscillator", "natural_frequency_hz": 30.0, "damping_ratio": 0.6},
        "effects": [{"cause": "time_delay", "delay_s": 0.0234}]})
    at = stamps()
    live = SampleMessages(Corrector(model, 100.0), cdr.IMU, None)
    parts = [live.process([data], [0]) for data in messages(at)]
    first = next(part for part in parts if part.messages)
    _, rate = fields(first.messages)
    assert first.stamps_ns[0] > at[0], "the filter warms up"
    assert np.abs(rate - angular_velocity(seconds(first.stamps_ns))).max() < MOST
