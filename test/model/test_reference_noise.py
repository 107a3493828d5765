"""A noisy reference: its noise is read off, fits to it have no bias, and their intervals hold."""

import dataclasses
import json

import numpy as np
import pytest
from exact_sines import oscillator, record, samples
from scipy.signal import butter, sosfilt

from frac_accel import SensorModel
from frac_accel.budget.reference_noise import reference_noise
from frac_accel.diagnosis import Diagnosis, diagnose
from frac_accel.diagnosis.engine import Engine
from frac_accel.model.core import Oscillator
from frac_accel.model.effects import effect_of
from frac_accel.record import Record
from frac_accel.validation import validate

BAND = (2.0, 280.0)


def draw(seed, snr_db=20.0, n=8000, noise=0.01):
    """Record with a noisy reference, and the sensor's frequency, damping and gain."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(60, 200), rng.uniform(0.1, 0.8), rng.uniform(0.8, 1.25)
    pair = record(rng, lambda s: truth[2] * oscillator(s, *truth[:2]), band=BAND, n=n,
                  reference_noise=10**(-snr_db / 20), noise=noise)
    return Record.of(*samples(*pair)), truth


def fitted(pair, noise):
    """Frequency, damping and gain with their standard uncertainties, from a model that is off."""
    base = {"core_parameter_shift": effect_of("core_parameter_shift")(110.0, 0.4),
            "sensitivity_error": effect_of("sensitivity_error")(1.0)}
    if noise:
        base["reference_noise"] = effect_of("reference_noise").of_record(
            dataclasses.replace(pair.integrity(0), reference_noise=noise), None)
    engine = Engine(pair, 0, SensorModel(Oscillator(110.0, 0.4)), pair.valid, base)
    fit = engine.search.fit(base)
    stds = engine.uncertainties(fit)
    names = (("core_parameter_shift", "natural_frequency_hz"),
             ("core_parameter_shift", "damping_ratio"), ("sensitivity_error", "gain"))
    return (np.array([getattr(fit.effects[cause], name) for cause, name in names]),
            np.array([stds[cause][name] for cause, name in names]))


@pytest.mark.parametrize("snr_db", [20.0, 30.0])
def test_noise_that_the_sensor_lacks_is_read_off(snr_db):
    for seed in range(5):
        pair, _ = draw(seed, snr_db, noise=0.002)
        found = reference_noise(pair, 0, pair.valid)
        assert found.by == "floor"
        assert abs(found.std / 10**(-snr_db / 20) - 1) < 0.05


def test_a_quiet_reference_has_none():
    for seed in range(5):
        pair, _ = draw(seed, snr_db=60.0)
        assert reference_noise(pair, 0, pair.valid) is None


def test_white_motion_is_no_noise():
    """A sensor that does not follow fast motion lacks it, but the motion is all there is."""
    rng = np.random.default_rng(3)
    motion = rng.standard_normal(8000)
    output = np.convolve(motion, np.hanning(22) / np.hanning(22).sum(), "same")
    pair = Record.of(*samples(motion, output + 0.001 * rng.standard_normal(8000)))
    assert reference_noise(pair, 0, pair.valid) is None


def test_intervals_hold_at_20_db():
    """25 draws: 95 % intervals with the noise taken into account, and what is wrong without."""
    scores, before = [], []
    for seed in range(100, 125):
        pair, truth = draw(seed)
        for kept, noise in ((scores, reference_noise(pair, 0, pair.valid)), (before, None)):
            values, stds = fitted(pair, noise)
            kept.append((values - truth) / stds)
    scores, before = np.abs(scores), np.abs(before)
    # 75 intervals: 0.95 within two standard deviations of chance
    assert 0.90 <= np.mean(scores < 1.96) <= 1.0
    assert np.mean(before < 1.96) < 0.7


@pytest.mark.parametrize("with_model", [True, False])
def test_named_and_nothing_else_and_validated(with_model):
    pair, truth = draw(7, n=12_000)
    bag = samples(pair.reference[:, 0], pair.sensor[:, 0])
    core = Oscillator(truth[0], truth[1], sensitivity=truth[2])
    found = diagnose(bag, SensorModel(core) if with_model else None, "x")
    assert [finding.cause for finding in found.findings] == ["reference_noise"]
    finding = found.findings[0]
    assert abs(finding.effect.std - 0.1) < 3 * finding.std["std"]
    assert list(found.model.reference_faults) == [finding.effect]
    # what is left is what the reference hides, no unknown cause
    assert found.verdict == "explained" and "hides" in found.reason
    again = Diagnosis.from_dict(json.loads(json.dumps(found.as_dict())))
    assert again.findings[0].effect == finding.effect
    model = SensorModel.from_dict(found.model.to_dict())
    without = SensorModel(model.core, axes={"x": model.axis("x")})
    left, more = (validate(bag, one).simulation.total.nrmse for one in (model, without))
    assert left == pytest.approx(found.extended["nrmse"], rel=0.1)
    assert left < more


def coloured(seed, low_pass_hz=None):
    """Motion with resonances that fills the band, at 200 Hz; the reference with noise 20 to 34 dB
    below it, and a sensor that is late, or slow instead of a noisy reference."""
    rng = np.random.default_rng(seed)
    n, rate = 16_000, 200.0
    frequency = np.fft.rfftfreq(n, 1 / rate)
    lines = np.fft.rfft(rng.standard_normal(n)) * (1 + (frequency / rng.uniform(3, 10))**2)**2
    for resonance in rng.uniform(3, 90, 4):
        lines = lines / (1 - (frequency / resonance)**2 + 0.1j * frequency / resonance)
    late = np.exp(-2j * np.pi * frequency * rng.uniform(0, 0.01))
    if low_pass_hz:
        late = late / (1 + 1j * frequency / low_pass_hz)
    motion, output = np.fft.irfft(lines, n), np.fft.irfft(lines * late, n)
    scale = motion.std()
    std = 10**rng.uniform(-1.7, -1.0)
    reference = motion / scale
    if not low_pass_hz:
        reference = reference + std * rng.standard_normal(n)
    output = output / scale + 10**rng.uniform(-3, -2) * rng.standard_normal(n)
    return Record.of(*samples(reference, output, rate)), std


def test_noise_shows_as_what_is_even_beyond_the_motion():
    """Twelve draws without a rest and without a frequency that the motion lacks."""
    ways = []
    for seed in range(300, 312):
        pair, std = coloured(seed)
        noise = reference_noise(pair, 0, pair.valid)
        assert abs(noise.std - std) < 3 * noise.uncertainty
        ways.append(noise.by)
    assert ways.count("excess") >= 4


@pytest.mark.parametrize("low_pass_hz", [20.0, 60.0, 200.0])
def test_a_slow_sensor_is_no_noise_of_the_reference(low_pass_hz):
    for seed in range(320, 328):
        pair, _ = coloured(seed, low_pass_hz)
        assert reference_noise(pair, 0, pair.valid) is None


@pytest.mark.parametrize("seed", range(4))
def test_motion_that_a_filter_takes_from_the_sensor_is_no_noise(seed):
    """Steep motion over an even floor of it, and a sensor that averages twice: what both share of
    the floor is no noise of the reference (9 % were read off in a measured rotation)."""
    rng = np.random.default_rng([172, seed])
    rate, count, length = 50.0, 1000, int(rng.integers(17, 26))
    fine = rng.normal(size=(2, 8 * count))
    motion = 40 * sosfilt(butter(4, rng.uniform(1.5, 3), fs=8 * rate, output="sos"), fine[0]) \
        + 0.5 * sosfilt(butter(8, 24, fs=8 * rate, output="sos"), fine[1])
    kernel = np.convolve(np.ones(length), np.ones(length)) / length**2
    sensor = np.convolve(motion, kernel)[:8 * count]
    pair = Record.of(*samples(motion[::8], sensor[::8] + 1e-4 * rng.normal(size=count), rate))
    found = reference_noise(pair, 0, pair.valid)
    assert found is None or not found.bends
