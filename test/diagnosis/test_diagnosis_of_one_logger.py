"""What a record of one logger, or of blows above a resonance, must not be named for."""

import numpy as np
import pytest
from rig.oscillator import integrate
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.verdict import _misleads

RATE, FINE = 2000.0, 16


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("stated", [True, False])
def test_motion_above_the_resonance_turns_no_sensor_round(seed, stated):
    """There all axes look reversed, as after half a turn: misalignment was named, of 175 deg."""
    rng, count = np.random.default_rng([61, seed]), 12_000
    f0, zeta = rng.uniform(200, 300), rng.uniform(0.3, 0.5)
    band = butter(3, (1.3 * f0, 3.0 * f0), "band", fs=FINE * RATE, output="sos")
    reference, output = np.zeros((2, count, 3))
    for axis, size in enumerate((1.0, 0.8, 0.05)):
        motion = sosfiltfilt(band, rng.normal(size=count * FINE))
        motion *= size / motion.std() * np.minimum(np.arange(count * FINE) / (100 * FINE), 1)
        moved = integrate(np.append(motion, motion[-1]), 1 / (RATE * FINE), f0, zeta).q
        reference[:, axis] = motion[::FINE]
        output[:, axis] = moved[:count * FINE:FINE] + 2e-3 * rng.normal(size=count)
    stamps = np.round(1e9 * np.arange(count) / RATE)
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": {
            "type": "oscillator", "natural_frequency_hz": 1.03 * f0, "damping_ratio": zeta,
            "damping_order": 1.0, "sensitivity": 1.0}, "effects": []})
    found = diagnose(tuple(Samples.of(stamps, values) for values in (reference, output)),
                     model if stated else None)
    assert {finding.cause for finding in found.findings} == (
        {"core_parameter_shift"} if stated else set())
    assert not any("turned" in words for words in found.integrity.words)
    assert found.extended["nrmse"] < 0.01


def test_stamps_that_both_have_are_no_fault_of_the_sensor():
    """A logger that stamps what it has read together scatters for both: sample is with sample."""
    rng, count = np.random.default_rng(62), 4000
    true = sosfiltfilt(butter(3, (0.02, 0.3), "band", output="sos"), rng.normal(size=count))
    stamps = np.round(1e9 * (np.arange(count) + 0.03 * rng.normal(size=count)) / 100)
    values = np.zeros((2, count, 3))
    values[:, :, 0] = true, true + 0.02 * true.std() * rng.normal(size=count)
    found = diagnose(tuple(Samples.of(stamps, each) for each in values))
    assert found.findings == [] and any("scatter" in words for words in found.integrity.words)


@pytest.mark.parametrize("after, own, misleads", [
    (1.3, 0.0, True), (1.05, 0.0, False), (1.3, 1.0, False)])
def test_names_do_not_leave_more_than_the_model_in_use(after, own, misleads):
    """Unless it is noise of the reference, which a truer model lets through."""
    assert _misleads(after, own, before=1.0) is misleads
