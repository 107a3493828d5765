"""Simulation of a long fractional record: time, growth with length, a direct sum beside it."""

import time

import numpy as np

from frac_accel import SensorModel, simulate

RATE_HZ = 1000.0
NATURAL_HZ, DAMPING, ORDER = 80.0, 0.2, 0.6


def direct_sum(reference):
    """Grünwald-Letnikov solution step by step: the whole past in each step, O(N²)."""
    step, natural = 1 / RATE_HZ, 2 * np.pi * NATURAL_HZ
    n = len(reference)
    weights = np.cumprod(np.r_[1.0, 1 - (ORDER + 1) / np.arange(1, n)])
    damping = 2 * DAMPING * natural**(2 - ORDER) * step**-ORDER
    output = np.zeros(n)
    for k in range(2, n):
        memory = weights[1:k + 1] @ output[k - 1::-1]
        output[k] = ((natural**2 * reference[k] + (2 * output[k - 1] - output[k - 2]) / step**2
                      - damping * memory) / (step**-2 + damping + natural**2))
    return output


def seconds(function, repeats=5):
    """Shortest of several times [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def run():
    """Rows of the table."""
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": NATURAL_HZ, "damping_ratio": DAMPING,
                 "damping_order": ORDER}})
    reference = np.random.default_rng(0).normal(size=100_000)
    short, long = (seconds(lambda n=n: simulate(model, reference[:n], RATE_HZ, axis="x"))
                   for n in (10_000, 100_000))
    direct = seconds(lambda: direct_sum(reference[:10_000]), repeats=1)
    return [
        {"figure": "1e5 samples, one axis, fractional [s]", "value": long},
        {"figure": "1e5 over 1e4 samples (10 is linear, 100 quadratic)", "value": long / short},
        {"figure": "direct Grünwald-Letnikov sum over ours, 1e4 samples", "value": direct / short},
    ]
