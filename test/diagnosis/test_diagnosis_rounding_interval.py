"""What rounding takes of an error has an interval: the power of the rest is known only so well."""

import numpy as np
import pytest
from exact_sines import record
from scipy import signal

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.model.core import Gain

RATE = 200.0


@pytest.mark.parametrize("seed", range(4))
def test_the_interval_of_a_lattice_holds_what_it_is_worth(seed):
    rng = np.random.default_rng(seed)
    step, noise = rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.15)
    reference, sensor = record(rng, lambda s: 0.9 + 0 * s, band=(1.0, 60.0), n=6000, rate=RATE,
                               noise=noise, sines=300)
    found = diagnose((reference, step * np.round(sensor / step)), SensorModel(Gain(0.9)),
                     sampling_rate_hz=RATE)
    assert [finding.cause for finding in found.findings] == ["quantization"]
    gain = found.findings[0].gain
    # noise of this size makes of rounding an error of its own, uniform (Widrow and Kollar, 2008)
    worth = 1 - noise / np.hypot(noise, step / np.sqrt(12))
    low, high = gain.ci95
    width = high - low
    assert 0.005 < width < 0.1
    # of one draw, an interval twice as wide
    assert low - width / 2 < worth < high + width / 2


@pytest.mark.parametrize("seed", range(2))
def test_what_only_the_sensor_shows_drowns_no_rounding(seed):
    """It rings beyond the band of a slower reference, by more than its lattice's step."""
    rng = np.random.default_rng(seed)
    rate, n = 800.0, 24_000
    step = rng.uniform(0.05, 0.1)
    noise = 0.2 * step
    reference, sensor = record(rng, lambda s: 0.9 + 0 * s, band=(1.0, 100.0), n=n, rate=rate,
                               noise=noise, sines=300)
    band = rng.uniform(280, 300) * np.array([0.95, 1.05])
    ringing = signal.sosfiltfilt(signal.butter(4, band, "band", fs=rate, output="sos"),
                                 rng.standard_normal(n))
    sensor += rng.uniform(2, 4) * step * ringing / ringing.std()
    stamps = np.round(1e9 * np.arange(n) / rate).astype(np.int64)
    found = diagnose(tuple(Samples.of(at, np.c_[values, np.zeros((len(values), 2))])
                           for at, values in ((stamps[::2], reference[::2]),
                                              (stamps, step * np.round(sensor / step)))),
                     SensorModel(Gain(0.9)))
    assert [finding.cause for finding in found.findings] == ["quantization"]
    assert found.findings[0].effect.step == pytest.approx(step)
    low, high = found.findings[0].gain.ci95
    worth = 1 - noise / np.hypot(noise, step / np.sqrt(12))
    assert low - (high - low) / 2 < worth < high + (high - low) / 2


def test_a_lattice_that_the_reference_has_too_has_no_name():
    """Two logs of one gyroscope, a step apart: the model's own rounding, 2e-9, was rounded off."""
    rng = np.random.default_rng(9)
    motion, step = record(rng, lambda s: 1 + 0 * s, band=(0.5, 8.0), n=4000, rate=50.0)[0], 1e-2
    reference = step * np.round(motion / step)
    found = diagnose((reference, reference + step), SensorModel(Gain(1.0)), sampling_rate_hz=50.0)
    assert [finding.cause for finding in found.findings] == ["offset"]
