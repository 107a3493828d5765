"""Very long records: the search begins on a part of them, which must not show in what it finds."""

import numpy as np
import pytest
from scipy.signal import bilinear, chirp, lfilter

from frac_accel.identification.fit.output_error import fit_output_error
from frac_accel.identification.fit.structures import OscillatorStructure

RATE_HZ, SAMPLES = 1000.0, 270_000
# Of the standard uncertainties: what a search may stop short of.
SAME = 0.05


def sensor_of(reference, rng):
    """Output of an oscillator of 80 Hz with noise, independent of the package's simulation."""
    omega = 2 * np.pi * 80.0
    output = lfilter(*bilinear([omega**2], [1, 0.4 * omega, omega**2], RATE_HZ), reference)
    return output + 1e-3 * np.std(output) * rng.standard_normal(len(output))


def test_a_long_sweep_is_identified_from_all_of_it():
    rng = np.random.default_rng(7)
    time = np.arange(SAMPLES) / RATE_HZ
    # loudest at its end, far above the resonance
    reference = (0.2 + time / time[-1]) * chirp(time, 2.0, time[-1], 200.0)
    sensor = sensor_of(reference, rng)
    found = fit_output_error(OscillatorStructure(), reference, sensor, RATE_HZ)
    near = fit_output_error(OscillatorStructure(), reference, sensor, RATE_HZ,
                            start=np.array([np.log(80.0), np.log(0.2), 0.0]))
    assert np.all(np.abs(found.values - near.values) < SAME * near.std)
    assert found.std == pytest.approx(near.std, rel=1e-3)
    assert found.rmse < 0.1 * np.std(sensor)
