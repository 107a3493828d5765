"""A sensor far below its resonance is a gain, and a smoothed reference makes it no resonance."""

import numpy as np
import pytest
import shaken
from exact_sines import oscillator, record, samples
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfiltfilt

from frac_accel import Samples, diagnose, identify
from frac_accel.model.core import Gain, Oscillator
from frac_accel.record import Record


def pair_of(seed, sensor, reference=np.ones_like, **options):
    return Record.of(*samples(*record(np.random.default_rng(seed), sensor, reference,
                                      **{"noise": 1e-2, **options})), "x")


@pytest.mark.parametrize("structure", ["gain", "auto", "classical"])
def test_gain_delay_and_offset(structure):
    """Far below a resonance at 5 kHz, which no fit to 60 Hz can see."""
    rng = np.random.default_rng(2)
    gain, delay = rng.uniform(0.5, 2), rng.uniform(0, 5e-3)
    found = identify(pair_of(3, lambda s: gain * oscillator(s, 5000.0, 0.7) * np.exp(-s * delay),
                             band=(0.5, 60.0)), "x", structure)
    assert found.structure == "gain" and isinstance(found.model.core, Gain)
    value = {name: (entry["value"], entry["std"]) for name, entry in found.parameters.items()}
    assert abs(value["sensitivity"][0] - gain) < 4 * value["sensitivity"][1]
    # the damping of a resonance out of sight is a delay of 2 zeta / w0
    assert abs(value["delay_s"][0] - delay - 1.4 / (2 * np.pi * 5000)) < 4 * value["delay_s"][1]
    assert abs(value["offset"][0]) < 4 * value["offset"][1]


@pytest.mark.parametrize("corner_hz", [30.0, 60.0])
def test_a_smoothed_reference_makes_no_resonance(corner_hz):
    found = identify(pair_of(4, np.ones_like, lambda s: 1 / (1 + s / (2 * np.pi * corner_hz)),
                             band=(0.5, 20.0)), "x", "classical")
    assert isinstance(found.model.core, Gain)
    assert "open" in found.reason


def test_a_resonance_in_the_band_stays_one():
    found = identify(pair_of(5, lambda s: oscillator(s, 150.0, 0.4), band=(0.5, 250.0)), "x",
                     "classical")
    assert isinstance(found.model.core, Oscillator)
    assert found.parameters["natural_frequency_hz"]["value"] == pytest.approx(150, rel=1e-3)


def test_a_diagnosis_without_a_model_begins_with_the_gain():
    reference, sensor = record(np.random.default_rng(6), lambda s: 1.2 * np.exp(-s * 3e-3),
                               band=(0.5, 60.0), noise=1e-2)
    found = diagnose(samples(reference, sensor))
    assert [finding.cause for finding in found.findings] == ["time_delay"]
    assert found.findings[0].effect.delay_s == pytest.approx(3e-3, abs=1e-5)
    assert isinstance(found.model.core, Gain)


def test_a_low_pass_without_a_phase_is_no_resonance():
    """As loggers have it before they thin out; with the noise of a phone in a car."""
    found = identify(pair_of(7, lambda s: 1 / np.sqrt(1 + (np.abs(s) / (2 * np.pi * 400))**24),
                             band=(5.0, 410.0), noise=0.08), "x", "classical")
    assert isinstance(found.model.core, Gain)


def test_a_damped_resonance_just_beyond_the_band_stays_one():
    """Which has its delay, though a clock takes a tenth of it back."""
    found = identify(pair_of(8, lambda s: oscillator(s, 450.0, 0.6) * np.exp(4e-5 * s),
                             band=(5.0, 410.0)), "x", "classical")
    assert found.parameters["natural_frequency_hz"]["value"] == pytest.approx(450, rel=1e-2)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_lightly_damped_resonance_above_a_sweep_is_one(seed):
    """Noise of the reference, which it amplifies, looks like a lead of a hundredth of a sample."""
    rng = np.random.default_rng([50272, seed])
    rate, frequency_hz = 50_000.0, rng.uniform(17_000, 21_000)
    motion = shaken.sweep(rate, 24_000, 30.0, 15_000.0)
    pair = shaken.measured(rng, motion, rate, frequency_hz, 0.02, rng.uniform(50, 60),
                           rng.uniform(60, 75))
    found = identify(pair, sampling_rate_hz=rate)
    assert found.structure == "oscillator"
    assert found.parameters["natural_frequency_hz"]["value"] == pytest.approx(frequency_hz,
                                                                              rel=2e-3)
    assert found.held_out_nrmse < 0.01


@pytest.mark.parametrize("late_s", [0.4, 0.8, -0.4, -0.8])
def test_a_delay_longer_than_the_ends_that_do_not_count(late_s):
    """Where the reference has no motion for a sample, the sample counts nowhere: 17 % was left,
    and the sensitivity was 5 standard uncertainties off."""
    rng, fine, seconds = np.random.default_rng(7), 1600.0, 60
    motion = sosfiltfilt(butter(6, [0.3, 20], "band", fs=fine, output="sos"),
                         rng.normal(size=int(fine * (seconds + 4))))
    spline = CubicSpline(np.arange(len(motion)) / fine, motion / motion.std())
    topics = []
    for delay, gain in ((0.0, 1.0), (late_s, 1.05)):
        at = 2 + np.arange(0, seconds, 0.01)
        values = gain * spline(at - delay) + 0.005 * rng.normal(size=len(at))
        topics.append(Samples.of(np.round(1e9 * (100 + at)), np.outer(values, [1, 0, 0])))
    found = identify(tuple(topics))
    own = found.parameters["sensitivity"]
    assert abs(own["value"] - 1.05) < 4 * own["std"] and own["std"] < 2e-4
    assert found.parameters["delay_s"]["value"] == pytest.approx(late_s, abs=1e-4)
    assert found.nrmse < 0.008 and found.held_out_nrmse < 0.008


@pytest.mark.parametrize("seed", range(6))
def test_reference_that_is_far_slower_than_the_sensor(seed):
    """Thermometers on one mast, one in a shield: no delay within a model's reach makes up for it,
    and what no model may hold is not said."""
    rng = np.random.default_rng([20261128, seed])
    samples, fine = 3600, 20
    corner_hz = 10**rng.uniform(-2.9, -2.3)
    moving = rng.normal(size=(samples + 2000) * fine)
    for lag_hz in (5e-4, corner_hz):
        fast, moving = moving, lfilter(*butter(1, lag_hz, fs=fine), moving)
    fast, slow = (values[2000 * fine::fine][:samples] / fast.std() for values in (fast, moving))
    found = identify((slow + 0.1 * rng.normal(size=samples), fast + 0.02 * rng.normal(size=samples)
                      + 0.002 * np.cumsum(rng.normal(size=samples))), sampling_rate_hz=1.0)
    assert isinstance(found.model.core, Gain)
    assert abs(found.parameters["delay_s"]["value"]) <= 10
