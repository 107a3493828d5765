"""Messages through the live streams: nothing kept for ever, nothing lost, whatever the blocks."""

from pathlib import Path

import numpy as np
import pytest

from frac_accel.errors import BagError
from frac_accel.io import cdr
from frac_accel.io.samples import Samples
from frac_accel.model import SensorModel
from frac_accel.streaming import Corrector
from frac_accel.streaming.live_messages import BlockMessages, NoisySensor, SampleMessages

MODELS = Path(__file__).parents[2] / "config" / "models"
RATE_HZ = 1000.0


@pytest.fixture(scope="module")
def model():
    return SensorModel.load(MODELS / "classical.yaml")


def samples(count, seed=3):
    rng = np.random.default_rng(seed)
    return Samples.of(10**18 + np.arange(count) * 10**6, rng.standard_normal((count, 3)),
                      np.full((count, 3), 1e-4))


def unreadable(data):
    raise BagError("no message")


def run(messages, raw, sizes):
    """All that comes out of blocks of random sizes."""
    rng = np.random.default_rng(4)
    parts, start = [], 0
    while start < len(raw):
        stop = start + int(rng.integers(1, sizes))
        block = raw[start:stop]
        parts.append(messages.process(block, list(range(start, start + len(block)))))
        start = stop
    return parts


def test_outputs_belong_to_their_input_and_arrival(model):
    raw = samples(900)
    stamps = raw.stamps_ns.copy()
    stamps[200] = stamps[199]
    raw = raw._replace(stamps_ns=stamps)
    messages = SampleMessages(Corrector(model, RATE_HZ), cdr.IMU, unreadable)
    parts = run(messages, cdr.encode_samples(cdr.IMU, raw), 40)
    expected = Corrector(model, RATE_HZ).process(*raw[:3])
    out = cdr.read_samples(cdr.IMU, [data for part in parts for data in part.messages])
    np.testing.assert_array_equal(out.values, expected.values)
    np.testing.assert_array_equal(out.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(out.variance, expected.variance)
    np.testing.assert_array_equal(np.concatenate([part.arrivals_ns for part in parts]),
                                  expected.index)


@pytest.mark.parametrize("kind", ["duplicates", "not_finite", "gaps"])
def test_messages_that_never_come_out_are_forgotten(model, kind):
    raw = samples(3000)
    stamps, values = raw.stamps_ns.copy(), raw.values.copy()
    if kind == "duplicates":
        stamps[500:] = stamps[499]
    elif kind == "not_finite":
        values[500:] = np.nan
    else:
        stamps[500:] += np.arange(2500) * 10**9
    messages = SampleMessages(Corrector(model, RATE_HZ), cdr.IMU, unreadable)
    run(messages, cdr.encode_samples(cdr.IMU, Samples.of(stamps, values)), 40)
    assert len(messages._waiting) <= 1040
    messages = BlockMessages(Corrector(model, RATE_HZ), unreadable)
    for i in range(3000):
        messages.process([cdr.encode_point_cloud(Samples.of(stamps[i:i + 1], values[i:i + 1]))],
                         [i])
    assert len(messages._starts) <= 1001


def test_unreadable_messages_are_counted_and_others_made_plain(model):
    raw = cdr.encode_samples(cdr.IMU, samples(200))
    strange = [b"\x00\x07" + data[2:] for data in raw[50:60]]
    messages = SampleMessages(
        Corrector(model, RATE_HZ), cdr.IMU,
        lambda data: b"\x00\x01" + data[2:] if data[1:2] == b"\7" else unreadable(data))
    part = messages.process([*raw[:50], *strange, b"", b"garbage", *raw[60:]], list(range(202)))
    assert messages.malformed == 2
    expected = Corrector(model, RATE_HZ).process(*samples(200)[:3])
    np.testing.assert_array_equal(part.values, expected.values)


def test_a_prepared_model_takes_over_without_a_gap(model):
    other = SensorModel.load(MODELS / "fractional.yaml")
    raw = samples(2000)
    data = cdr.encode_samples(cdr.IMU, raw)
    messages = SampleMessages(Corrector(model, RATE_HZ), cdr.IMU, unreadable)
    parts = [messages.process(data[:1000], [0] * 1000)]
    messages.stream.prepare(other, bandwidth_hz=200.0)
    prepared = messages.stream._prepared[2]
    parts += [messages.replace(other, {"bandwidth_hz": 200.0}),
              messages.process(data[1000:], [0] * 1000)]
    assert messages.stream.design is prepared
    stamps = np.concatenate([part.stamps_ns + (600_000 if i == 0 else 0)
                             for i, part in enumerate(parts)])
    np.testing.assert_array_equal(np.diff(stamps), 10**6)
    assert len(stamps) > 1900


def test_blocks_are_the_same_as_samples(model):
    raw = samples(1000)
    blocks = [Samples(*(column[i:i + 50] for column in raw[:3]), "f") for i in range(0, 1000, 50)]
    messages = BlockMessages(Corrector(model, RATE_HZ), unreadable)
    part = messages.process([cdr.encode_point_cloud(block) for block in blocks] + [b"x"],
                            list(range(21)))
    out = cdr.read_samples(cdr.POINT_CLOUD2, part.messages)
    expected = Corrector(model, RATE_HZ).process(*raw[:2])
    np.testing.assert_array_equal(out.values, expected.values)
    np.testing.assert_array_equal(out.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(part.arrivals_ns, expected.index // 50)
    assert messages.malformed == 1


def test_noise_does_not_depend_on_the_blocks(model):
    raw = samples(500)
    whole = NoisySensor(model, RATE_HZ, 0.1, seed=7).process(*raw[:3])
    stream = NoisySensor(model, RATE_HZ, 0.1, seed=7)
    parts = [stream.process(*(column[i:i + 9] for column in raw[:3])) for i in range(0, 500, 9)]
    np.testing.assert_array_equal(np.concatenate([part.values for part in parts]), whole.values)
    clean = NoisySensor(model, RATE_HZ).process(*raw[:3])
    assert np.std(whole.values - clean.values) == pytest.approx(0.1, rel=0.1)
    np.testing.assert_allclose(whole.variance - clean.variance, 0.01, rtol=1e-9)
