"""PyDynamic's published shock example: ours stays below its error and its delay.

There PyDynamic's filter reaches a largest error of 1.5 % of the peak with a delay of 113 µs;
`benchmarks/pydynamic_shock.py` runs the two side by side.
"""

import pathlib
import sys

import numpy as np
import pytest
import rig

FOLDER = pathlib.Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(FOLDER))
    try:
        import published_shock
    finally:
        sys.path.remove(str(FOLDER))
    return published_shock


def test_sensor_is_played_exactly(example):
    """The closed-form response against the independent integration."""
    sensor = rig.Sensor({"type": "oscillator", "natural_frequency_hz": example.NATURAL_HZ,
                         "damping_ratio": example.DAMPING, "damping_order": 1.0,
                         "sensitivity": example.STATIC_GAIN})
    excitation = rig.shock(example.RATE_HZ, example.SAMPLES / example.RATE_HZ, example.SIGMA_S,
                           at_s=example.SHOCK_AT_S, amplitude=(example.PEAK, 0, 0))
    record = rig.simulate_record(sensor, excitation)
    output = example.sensor_output()
    assert np.max(np.abs(record.sensor[:, 0] - output)) < 1e-4 * np.max(np.abs(output))


def test_error_and_delay(example):
    clean = example.sensor_output()
    worst = []
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(size=len(clean)) * example.NOISE_STD
        instants_s, values, delay_s = example.our_estimate(clean + noise)
        worst.append(np.max(np.abs(values - example.shock(instants_s))) / example.PEAK)
        assert delay_s < 113e-6
    assert max(worst) < 0.015
