"""Whole inputs, small ones: every message type and layout of bags, every core and effect of models.

Nothing here is measured against, so the package's own writers will do.
"""

import numpy as np
import yaml
from mcap.writer import CompressionType, IndexType, Writer

from frac_accel import SensorModel, simulate
from frac_accel.io import cdr
from frac_accel.io.bag import (
    RAW_TOPIC,
    REFERENCE_TOPIC,
    TEMPERATURE_TOPIC,
    BagWriter,
    Samples,
    Temperatures,
    write_bag,
)
from frac_accel.model import SCHEMA
from frac_accel.model.effects import known_effects
from frac_accel.model.parameters import parameter_fields

RATE_HZ = 1000.0
COUNT = 400
START_NS = 1_700_000_000 * 10**9
OSCILLATOR = {"natural_frequency_hz": 180.0, "damping_ratio": 0.4}
CORES = {
    "oscillator": OSCILLATOR,
    "fractional": {**OSCILLATOR, "damping_order": 0.8, "sensitivity": 2.0},
    "arx": {"type": "arx", "numerator": [0.2, 0.1], "denominator": [1.0, -1.0, 0.3],
            "sampling_rate_hz": RATE_HZ},
    "transfer function": {"type": "fractional_transfer_function",
                          "denominator_coefficients": [1.0, 3e-4, 1e-6],
                          "denominator_orders": [0.0, 0.9, 1.9],
                          "numerator_coefficients": [1.0], "numerator_orders": [0.0]},
}
PLAIN = {"schema": SCHEMA, "core": OSCILLATOR}


def samples(rng, model=None, count=COUNT):
    """A reference that excites all axes, and what a sensor says to it."""
    stamps = START_NS + np.arange(count) * int(1e9 / RATE_HZ)
    reference = rng.standard_normal((count, 3)).cumsum(axis=0)
    reference -= np.linspace(reference[0], reference[-1], count)
    raw = simulate(SensorModel.from_dict(model or PLAIN), reference, RATE_HZ)
    raw = raw + 1e-3 * rng.standard_normal(raw.shape)
    return {REFERENCE_TOPIC: Samples.of(stamps, reference),
            RAW_TOPIC: Samples.of(stamps, raw, np.full(raw.shape, 1e-6))}


def topics_of(rng):
    """All topics of a pair with its temperature."""
    topics = samples(rng)
    stamps = topics[RAW_TOPIC].stamps_ns[::100]
    topics[TEMPERATURE_TOPIC] = Temperatures(stamps, 20 + rng.standard_normal(len(stamps)),
                                             np.zeros(len(stamps)), "t")
    return topics


def plain_bag(path, rng):
    """As we write it, with a temperature."""
    write_bag(path, topics_of(rng))


def accel_bag(path, rng):
    """Another message type, by the mcap library's own writer in one of its layouts."""
    options = [{"compression": CompressionType.LZ4}, {"compression": CompressionType.NONE},
               {"use_chunking": False}, {"compression": CompressionType.ZSTD,
                                         "index_types": IndexType.NONE, "use_statistics": False}]
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=20_000, **options[rng.integers(len(options))])
        writer.start("ros2", "fuzz")
        for name, content in samples(rng).items():
            schema = writer.register_schema(cdr.ACCEL_STAMPED, "ros2msg", b"")
            channel = writer.register_channel(name, "cdr", schema, {
                "offered_qos_profiles": "- history: 1\n  depth: 5\n  reliability: 1\n"})
            for stamp, message in zip(content.stamps_ns.tolist(),
                                      cdr.encode_samples(cdr.ACCEL_STAMPED, content)):
                writer.add_message(channel, stamp, message, stamp)
        writer.finish()


def block_bag(path, rng):
    """Blocks of samples."""
    with BagWriter(path) as writer:
        for name, content in samples(rng).items():
            writer.add_topic(name, cdr.POINT_CLOUD2)
            for start in range(0, len(content.stamps_ns), 50):
                block = Samples(*(part[start:start + 50] for part in content[:3]), "b")
                writer.write(name, cdr.encode_point_cloud(block), int(block.stamps_ns[0]))


BAGS = (plain_bag, plain_bag, accel_bag, block_bag)


def model_of(rng):
    """Content of a model file: some core, some effects in their ranges, sometimes axes' own."""
    data = {"schema": SCHEMA, **_axis(rng)}
    if rng.random() < 0.2:
        data["axes"] = {axis: _axis(rng) for axis in "xyz" if rng.random() < 0.5}
    if rng.random() < 0.3:
        data["noise_std"] = float(10 ** rng.uniform(-6, 0))
    if rng.random() < 0.2:
        data["band_hz"] = [1.0, 300.0]
    return data


def _axis(rng):
    effects = []
    for cause, effect in sorted(known_effects().items()):
        if rng.random() < 0.12:
            effects.append({"cause": cause, **{field.name: _value(field, rng)
                                               for field in parameter_fields(effect)}})
    return {"core": dict(CORES[rng.choice(list(CORES))]), "effects": effects}


def _value(field, rng):
    limits = field.metadata
    if limits.get("list"):
        return rng.normal(size=rng.integers(1, 4)).tolist()
    if limits.get("choices"):
        return str(rng.choice(limits["choices"]))
    low = next((limits[key] for key in ("above", "minimum") if limits[key] is not None), None)
    high = next((limits[key] for key in ("below", "maximum") if limits[key] is not None), None)
    size = float(10 ** rng.uniform(-6, 3))
    if low is not None and high is not None and high - low < 1e4:
        return float(rng.uniform(low, high))
    return size + low if low is not None else size * (1 if rng.random() < 0.5 else -1)


def text_of(data):
    """A model or the like as YAML."""
    return yaml.safe_dump(data, sort_keys=False)

