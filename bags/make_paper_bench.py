"""Make the bags of the seed paper's bench: ``python bags/make_paper_bench.py`` from a checkout.

A shaker moves a reference and a sensor under test, as in the paper's Figure 1. Each has its
conditioner and its noise; a card of 10 kHz digitises both, the sensor's channel 70 us late. The
data come from the independent simulator in test/rig. For each sensor there is one record of noise
to identify from, and one of stepped sines, for judging; besides, the paper's own excitation, a
sine of 300 Hz. Card records are blocks of samples (PointCloud2), which keeps the files small.
"""

import sys
from pathlib import Path

import numpy as np
import yaml

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

import rig  # noqa: E402  (lives beside the tests)

from frac_accel.io import cdr  # noqa: E402
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, BagWriter, Samples  # noqa: E402

RATE_HZ = 10_000.0
SKEW_S = 70e-6
# The card's step [m/s²]: 16 bits over a range of +-256 m/s².
STEP = 2.0**-7
REFERENCE_NOISE_DB, SENSOR_NOISE_DB = 80, 60
# Frequencies of the paper, and beyond.
SINES_HZ = (100, 200, 300, 400, 500, 600, 700, 850, 1000, 1200)
SECONDS_PER_SINE = 0.1
BLOCK = 200


def oscillator(order):
    """A sensor whose resonance the bench reaches, unlike that of the 4507."""
    return {"type": "oscillator", "natural_frequency_hz": 650.0, "damping_ratio": 0.12,
            "damping_order": order, "sensitivity": 1.0}


LATE = {"time_delay": {"delay_s": SKEW_S}}
SENSORS = {
    "classical": rig.Sensor(oscillator(1.0), LATE),
    "fractional": rig.Sensor(oscillator(0.6), LATE),
    "lagging": rig.Sensor(oscillator(1.0), {**LATE, "low_pass_lag": {"corner_hz": 2500.0}}),
}


def noise(rng):
    """What the sensors are identified from."""
    return rig.band_noise(rng, RATE_HZ, 0.8, (10.0, 1500.0), (30.0, 0.0, 0.0), lead_s=0.2)


def sines():
    """What they are judged on."""
    return rig.stepped_sine(RATE_HZ, SECONDS_PER_SINE * len(SINES_HZ), SINES_HZ, (30.0, 0.0, 0.0))


def main():
    """Write all bags."""
    rng = np.random.default_rng(20261122)
    for name, sensor in SENSORS.items():
        write(f"paper_bench_{name}", sensor, noise(rng), rng)
        write(f"paper_bench_{name}_sines", sensor, sines(), rng)
        (HERE / f"paper_bench_{name}.yaml").write_text(
            yaml.safe_dump(sensor.to_model(), sort_keys=False))
    one = rig.sines(RATE_HZ, 0.5, [300.0], [0.0], (30.0, 0.0, 0.0), lead_s=0.2)
    write("paper_bench_one_sine", SENSORS["classical"], one, rng)


def write(name, sensor, excitation, rng):
    """One bag: the reference and the sensor as the card has them."""
    record = rig.simulate_record(sensor, excitation, rng, snr_db=SENSOR_NOISE_DB)
    std = record.reference.std(axis=0) * 10 ** (-REFERENCE_NOISE_DB / 20)
    reference = record.reference + std * rng.normal(size=record.reference.shape)
    topics = {REFERENCE_TOPIC: (record.stamps_ns, reference, "reference_link"),
              RAW_TOPIC: (record.sensor_stamps_ns, record.sensor, "accel_link")}
    blocks = []
    with BagWriter(HERE / f"{name}.mcap") as writer:
        for topic, (stamps_ns, values, frame) in topics.items():
            writer.add_topic(topic, cdr.POINT_CLOUD2)
            # only x is wired
            values = STEP * np.round(values / STEP) * [1, 0, 0]
            for first in range(0, len(stamps_ns), BLOCK):
                part = slice(first, first + BLOCK)
                blocks.append((stamps_ns[part][-1], topic, cdr.encode_point_cloud(
                    Samples.of(stamps_ns[part], values[part], frame_id=frame))))
        for time_ns, topic, message in sorted(blocks, key=lambda block: block[0]):
            writer.write(topic, message, int(time_ns))


if __name__ == "__main__":
    main()
