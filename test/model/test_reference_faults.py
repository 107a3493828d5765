"""Faults of the recorded reference: found, kept out of the correction, and known to `validate`."""

import numpy as np
import pytest
from exact_sines import RATE, oscillator, record, samples
from scipy.optimize import brentq

from frac_accel import Corrector, diagnose
from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model.effects.reference_smoothing import ReferenceSmoothing
from frac_accel.validation import validate

FAULTS = {
    "reference_ac_coupling": ("corner_hz", lambda s, hz: s / (s + 2 * np.pi * hz), (0.5, 3.0)),
    "reference_low_pass": ("corner_hz", lambda s, hz: 1 / (1 + s / (2 * np.pi * hz)), (60, 400)),
    "reference_smoothing": ("length_s", lambda s, length: np.sinc(length * s.imag / 2 / np.pi)**3,
                            (5e-4, 2e-3)),
    "reference_delay": ("delay_s", lambda s, delay: np.exp(-s * delay), (3e-4, 3e-3)),
}
FIXED = {"reference_smoothing": {"order": 3}}


def model(core, **keys):
    return SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core, **keys})


def drawn(cause, seed):
    """Core, value of the fault's parameter, noise, and the exact record."""
    rng = np.random.default_rng([seed, 47])
    _, link, limits = FAULTS[cause]
    value, noise = rng.uniform(*limits), 10**rng.uniform(-3.5, -2)
    frequency, ratio = rng.uniform(120, 350), rng.uniform(0.05, 0.7)
    core = {"natural_frequency_hz": frequency, "damping_ratio": ratio}
    return core, value, noise, record(rng, lambda s: oscillator(s, frequency, ratio),
                                      lambda s: link(s, value), noise=noise)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("cause", FAULTS)
def test_found_and_validated(cause, seed):
    core, value, noise, pair = drawn(cause, seed)
    found = diagnose(samples(*pair), model(core))
    assert [finding.cause for finding in found.findings] == [cause]
    parameter = found.findings[0].as_dict()["parameters"][FAULTS[cause][0]]
    assert abs(parameter["value"] - value) < 5 * parameter["std"]
    assert [fault.cause for fault in found.model.reference_faults] == [cause]
    errors = validate(samples(*pair), found.model).simulation.bands
    # what drifts below the excited band, the reference does not tell
    assert all(band.nrmse < 5e-3 + 3 * noise for band in errors[1:])
    # a step of the sensor's stamps right at the start is a delay, too
    assert {*found.findings[0].confusable_with} - {"time_step"} == (
        {"time_delay"} if cause == "reference_delay" else set())


@pytest.mark.parametrize("cause", FAULTS)
def test_no_part_of_the_correction(cause):
    core, value, _, (_, sensor) = drawn(cause, 0)
    raw = samples(sensor, sensor)[1]
    fault = {"cause": cause, FAULTS[cause][0]: value, **FIXED.get(cause, {})}
    one, other = (Corrector(model(core, **keys), sampling_rate_hz=RATE).process(*raw[:3])
                  for keys in ({}, {"reference_faults": [fault]}))
    assert np.array_equal(one.values, other.values, equal_nan=True)
    assert np.array_equal(one.stamps_ns, other.stamps_ns)


def test_the_key_is_read_and_written(tmp_path):
    faults = [{"cause": "reference_ac_coupling", "corner_hz": 1.9, "known_from_hz": 0.3}]
    model({"type": "gain"}, reference_faults=faults).save(tmp_path / "m.yaml")
    again = SensorModel.load(tmp_path / "m.yaml")
    assert again.to_dict()["reference_faults"] == faults
    assert "reference_faults" not in model({"type": "gain"}).to_dict()


@pytest.mark.parametrize("keys, words", [
    ({"reference_faults": [{"cause": "offset", "offset": 1}]},
     "reference_faults: offset given, which is an effect of the sensor"),
    ({"effects": [{"cause": "reference_delay", "delay_s": 1e-3}]},
     "effects: reference_delay given, which is a fault of the reference"),
    ({"reference_faults": [{"cause": "reference_low_pass", "corner_hz": -1}]},
     r"reference_faults\[0\].corner_hz: -1 given, expected a number in Hz above 0"),
    ({"reference_fault": []}, "did you mean 'reference_faults'"),
])
def test_errors_say_what_was_expected(keys, words):
    with pytest.raises(ModelError, match=words):
        model({"type": "gain"}, **keys)


def test_a_model_with_the_fault_is_consistent():
    core, value, _, pair = drawn("reference_low_pass", 3)
    fault = {"cause": "reference_low_pass", "corner_hz": value}
    found = diagnose(samples(*pair), model(core, reference_faults=[fault]))
    assert not found.findings and not found.suspects


@pytest.mark.parametrize("seed", range(5))
def test_a_tone_by_the_notch_of_an_average_is_turned_back_and_noise_is_not(seed):
    rng = np.random.default_rng([48, seed])
    rate, n = 200.0, 20_000
    length_s, order, noise = rng.uniform(0.018, 0.026), int(rng.integers(1, 4)), 1e-4
    effect = ReferenceSmoothing(length_s, order)
    # strong slow motion, and a tone of which a fiftieth to a twelfth is left
    share = rng.uniform(0.02, 0.08)
    tone_hz = brentq(lambda hz: np.sinc(length_s * hz)**order - share, 1.0, 1 / length_s)
    time = np.arange(n) / rate
    waves = [(rng.uniform(0.5, 5.0), 1.0), (tone_hz, 0.3)]
    phases = rng.uniform(0, 2 * np.pi, 2)
    motion = sum(size * np.sin(2 * np.pi * hz * time + phase)
                 for (hz, size), phase in zip(waves, phases))
    recorded = sum(size * np.sinc(length_s * hz)**order * np.sin(2 * np.pi * hz * time + phase)
                   for (hz, size), phase in zip(waves, phases)) + noise * rng.normal(size=n)
    inner = slice(200, -200)
    back = effect.change_base(recorded, rate)
    # of 0.2 that were lost
    assert np.std((back - motion)[inner]) < 0.01
    # beyond the notches nothing but noise: as large as where a tenth is left, at most
    alone = effect.change_base(noise * rng.normal(size=n), rate)
    assert np.std(alone[inner]) < 10 * noise
