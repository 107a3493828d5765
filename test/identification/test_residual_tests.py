"""The residual tests raise the alarm as rarely as they say, and where the model lacks something."""

import numpy as np
import pytest
import rig
from scipy.signal import lfilter
from scipy.stats import binom

from frac_accel import FracAccelError, identify
from frac_accel.identification.fit.output_error import fit_output_error
from frac_accel.identification.fit.structures import OscillatorStructure
from frac_accel.identification.judge.fit_validation import (
    BandFit,
    fit_validation,
    judge_residual,
)
from frac_accel.identification.judge.residual_tests import residual_tests
from frac_accel.io.samples import Samples
from frac_accel.record import Record

pytestmark = pytest.mark.long

RATE_HZ = 2000.0
STRUCTURE = OscillatorStructure()


def record_of(rng, effects=(), duration_s=1.5, band_hz=(5.0, 700.0), rng_noise=None, **noise):
    sensor = rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay", *effects],
                             natural_frequency=(0.05, 0.2), damping_ratio=(0.05, 0.7))
    excitation = rig.band_noise(rng, RATE_HZ, duration_s, band_hz, (1.0, 0.0, 0.0), lead_s=0.5)
    return rig.simulate_record(sensor, excitation, rng_noise, **noise)


def pair_of(record):
    return Record.of(Samples.of(record.stamps_ns, record.reference),
                     Samples.of(record.sensor_stamps_ns, record.sensor))


def coloured(rng, n, ar):
    return lfilter([1.0], np.r_[1, -np.array(ar)], rng.standard_normal(n + 500))[500:]


def alarms_are_rare(p_values, level):
    """Whether as few as so many of the trials are below the level with a chance of 99.8 %."""
    low, high = binom.ppf([0.001, 0.999], len(p_values), level)
    return low <= np.sum(np.array(p_values) < level) <= high


@pytest.mark.parametrize("ar", [(), (0.9,)], ids=["white", "coloured"])
def test_false_alarms_of_a_fitted_model_are_as_rare_as_said(ar):
    """300 noises on ten sensors, each with its own fit of five parameters."""
    rng = np.random.default_rng(20321)
    independence, whiteness = [], []
    for _ in range(10):
        pair = pair_of(record_of(rng))
        reference, clean = pair.reference[:, 0], pair.sensor[:, 0]
        fit = fit_output_error(STRUCTURE, reference, clean, RATE_HZ)
        for _ in range(30):
            noise = coloured(rng, len(clean), ar)
            sensor = clean + 0.03 * np.std(clean) / np.std(noise) * noise
            fit = fit_output_error(STRUCTURE, reference, sensor, RATE_HZ, start=fit.unknowns)
            tests = judge_residual(STRUCTURE.core(fit), fit, reference, pair)
            independence.append(tests.independence_p_value)
            whiteness.append(tests.whiteness_p_value)
    assert alarms_are_rare(independence, 0.01) and alarms_are_rare(independence, 0.05)
    if ar:
        assert max(whiteness) < 1e-6
    else:
        assert alarms_are_rare(whiteness, 0.01) and alarms_are_rare(whiteness, 0.05)


def test_bands_hold_99_percent_of_chance_also_with_missing_samples():
    rng = np.random.default_rng(20322)
    reference = rig.shock(RATE_HZ, 1.0, 2e-3).reference[:, 0]
    inside, within, p_values = [], [], []
    for _ in range(300):
        valid = rng.random(len(reference)) > 0.1
        tests = residual_tests(coloured(rng, len(reference), (0.7,)), reference, valid)
        inside.append(np.abs(tests.reference_correlation) <= tests.reference_band)
        p_values.append(tests.independence_p_value)
        tests = residual_tests(rng.standard_normal(len(reference)), reference, valid)
        within.append(np.abs(tests.autocorrelation) <= tests.autocorrelation_band)
    # neighbouring lags of a shock are much the same: 300 trials count, not 15300
    assert 0.975 <= np.mean(inside) <= 0.9985
    assert 0.985 <= np.mean(within) <= 0.995
    assert alarms_are_rare(p_values, 0.01)


@pytest.mark.parametrize("ar", [(), (0.9,)], ids=["white", "coloured"])
@pytest.mark.parametrize("effect", ["low_pass_lag", "mounting_resonance"])
def test_what_the_model_lacks_is_caught(effect, ar):
    rng = np.random.default_rng(20323)
    for _ in range(4):
        record = record_of(rng, [effect], duration_s=2.5, rng_noise=rng, snr_db=40.0, noise_ar=ar)
        result = identify(pair_of(record), structure="oscillator")
        tests = result.validation.residual
        assert tests.independence_p_value < 1e-6
        # what is missing is the residual less its noise of 1 % of the output
        missing = np.sqrt(max(result.nrmse**2 - 0.01**2, 0))
        assert tests.dependent_share * result.nrmse == pytest.approx(missing, rel=0.25)
        assert result.validation.verdict[0].startswith("the residual depends on the reference")


def test_a_complete_model_is_not_accused():
    rng = np.random.default_rng(20324)
    record = record_of(rng, duration_s=2.5, rng_noise=rng, snr_db=30.0, noise_ar=(0.9,))
    result = identify(pair_of(record), structure="oscillator")
    assert "does not depend linearly on the reference" in result.validation.verdict[0]
    assert "not white" in result.validation.verdict[0]


def test_held_out_residual_by_octaves_is_the_noise():
    """White noise of known power: its share of each octave, and the floor from the coherence."""
    rng = np.random.default_rng(20325)
    record = record_of(rng, duration_s=12.0, rng_noise=rng, snr_db=20.0)
    result = identify(pair_of(record), structure="oscillator")
    judged = result.validation.held_out_bands[1:]
    assert len(judged) == 5
    for band in judged:
        low, high = band.band_hz
        frequency = np.fft.rfftfreq(len(record.clean), 1 / RATE_HZ)
        inside = (frequency >= low) & (frequency <= high)
        signal = np.sum(np.abs(np.fft.rfft(record.clean[:, 0])[inside])**2)
        noise = record.noise_std[0]**2 * inside.sum() * len(record.clean)
        expected = np.sqrt(noise / (signal + noise))
        assert band.nrmse == pytest.approx(expected, rel=0.15)
        assert band.floor == pytest.approx(expected, rel=0.25)
    assert result.model.metadata["validation"]["held_out_bands"][1]["nrmse"] == judged[0].nrmse


@pytest.mark.parametrize("residual, reference, words", [
    (np.ones(100), np.ones(100), "100 samples of the residual"),
    (np.ones(1000), np.ones(999), "expected the same length"),
    (np.full(1000, np.nan), np.ones(1000), "0 samples of the residual"),
    (np.zeros(1000), np.ones(1000), "the residual is zero"),
])
def test_too_little_to_test_is_said(residual, reference, words):
    with pytest.raises(FracAccelError, match=words):
        residual_tests(residual, reference)


@pytest.mark.parametrize("floor, words", [
    (0.3283, "30.84% of the output there, all of which no linear model explains"),
    (0.1, "30.84% of the output there, of which 10.00% no linear model explains"),
    (np.nan, "30.84% of the output there")])
def test_no_part_of_an_octave_is_said_to_be_larger_than_the_whole(floor, words):
    """The floor is estimated by coherence, the whole by a spectrum of its own."""
    assert fit_validation(None, 0.1, [BandFit((5.0, 10.0), 0.3084, floor)]).verdict[0].endswith(
        words)


def test_a_dependence_too_small_to_show_is_said_to_be_small():
    rng = np.random.default_rng(50269)
    reference, noise = rng.standard_normal((2, 20_000))
    tests = residual_tests(0.1 * np.roll(reference, 3) + noise, reference)
    assert not tests.independent
    assert "a further 1." in fit_validation(tests, 0.1, []).verdict[0]
    assert "a further less than 0.01% of" in fit_validation(tests, 1e-5, []).verdict[0]
