"""Samples per second of the corrector: three axes, in one piece and as a node gets them."""

import time

import numpy as np

from frac_accel import Corrector, SensorModel

RATE_HZ = 2000.0
SAMPLES = 200_000


def rate_of(order, block, samples=SAMPLES):
    """Samples per second for one damping order and block length."""
    kernel = Corrector(SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 300.0, "damping_ratio": 0.2, "damping_order": order}}),
        RATE_HZ, noise_std=0.01)
    values = np.random.default_rng(0).normal(size=(samples, 3))
    stamps_ns = np.arange(samples) * round(1e9 / RATE_HZ)
    start = time.perf_counter()
    for first in range(0, samples, block):
        kernel.process(stamps_ns[first:first + block], values[first:first + block])
    return samples / (time.perf_counter() - start)


def run():
    """Rows of the table."""
    rows = []
    for name, order in (("classical", 1.0), ("fractional", 0.6)):
        for block, samples in ((SAMPLES, SAMPLES), (100, SAMPLES), (1, 20_000)):
            rows.append({"figure": f"{name}, blocks of {block} [samples/s]",
                         "value": rate_of(order, block, samples)})
    return rows
