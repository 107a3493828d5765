"""Instants that scatter in fast motion, which shows to higher orders."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.verdict import _shown
from frac_accel.model.core import Gain
from frac_accel.model.effects import known_effects
from frac_accel.model.effects.sampling_jitter import SamplingJitter

RATE, FINE = 10e3, 32


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("count", [12_000, 50_000])
def test_instants_scatter_by_a_tenth_of_the_interval(count, seed):
    """Up to 0.8 of the Nyquist frequency, from rest, it was not named: beside what
    the slope alone makes, 20 to 30 % of the power differed where the motion was fast or slow."""
    rng = np.random.default_rng([91, seed])
    motion = sosfiltfilt(butter(4, (300, rng.uniform(3800, 4200)), "band", fs=RATE * FINE,
                                output="sos"), rng.normal(size=count * FINE))
    motion *= np.clip(np.arange(len(motion)) / len(motion) * 4 - 0.3, 0, 1) / motion.std()
    scatter = rng.uniform(0.08, 0.12)
    taken = np.arange(count) + scatter * rng.normal(size=count)
    values = np.interp(taken * FINE, np.arange(len(motion)), motion) + 0.01 * rng.normal(size=count)
    stamps = np.round(1e9 * np.arange(count) / RATE)
    found = diagnose(tuple(Samples.of(stamps, np.outer(each, [1.0, 0.0, 0.0]))
                           for each in (motion[::FINE], values)), SensorModel(Gain(1.0)))
    assert [finding.cause for finding in found.findings] == ["sampling_jitter"]
    named, = found.findings
    assert named.effect.rms_s == pytest.approx(scatter / RATE, rel=0.03)
    assert found.verdict == "explained"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("shape, smallest_s, largest_s", [
    ((2, (0.5, 20.0)), 4e-4, 8e-4), ((8, (10.0, 56.0)), 2e-4, 4e-4)])
def test_instants_of_a_faster_sensor_scatter(shape, smallest_s, largest_s, seed):
    """Each of its samples has less to say than one of as many as there are instants; it was said
    that none of them could be told. What the filter to the common band took of the motion was
    missing in its slope: 4 to 16 % too much scatter."""
    rng = np.random.default_rng([92, seed])
    fine, count = 4000.0, 24_000
    # 64 Hz are compared, and from 51 Hz on less and less
    motion = sosfiltfilt(butter(*shape, "band", fs=fine, output="sos"),
                         rng.normal(size=20 * count + 80_000))[40_000:-40_000]
    motion *= (1 + 0.4 * np.sin(2 * np.pi * np.arange(len(motion)) / len(motion) * 7)) \
        / motion.std()
    scatter_s = rng.uniform(smallest_s, largest_s)
    every = np.arange(0, len(motion), 20), np.arange(0, len(motion), 25)
    stamps = [np.round(1e9 * taken / fine) for taken in every]
    reference = Samples.of(stamps[1], np.outer(motion[every[1]], [1.0, 0, 0]))

    def found(scatter_s):
        taken = every[0] + scatter_s * fine * rng.normal(size=count)
        values = np.interp(taken, np.arange(len(motion)), motion) + 0.01 * rng.normal(size=count)
        return diagnose((reference, Samples.of(stamps[0], np.outer(values, [1.0, 0, 0]))),
                        SensorModel(Gain(1.0)))
    named, = found(scatter_s).findings
    assert named.cause == "sampling_jitter"
    assert named.effect.rms_s == pytest.approx(scatter_s, rel=0.05)
    assert abs(named.effect.rms_s - scatter_s) < 3 * named.std["rms_s"] < 0.15 * scatter_s
    assert found(0.0).findings == []


def test_noise_that_grows_with_the_level_of_motion_is_no_scatter():
    """Noise in the envelope of a lift's motion scattered instants: the slope's square followed it
    better than those of the level and of the bend did, of the same instants; as in two of these."""
    count, rate = 40_000, 200.0
    for seed in range(12):
        rng = np.random.default_rng([93, seed])
        motion = 0.0
        for size, band in ((0.3, (0.5, 2)), (1.0, (5, 25)), (0.7, (25, 50))):
            part = sosfiltfilt(butter(2, band, "band", fs=rate, output="sos"),
                               rng.normal(size=count))
            motion = motion + size * part / part.std()
        comes = sosfiltfilt(butter(2, 0.2, fs=rate, output="sos"), rng.normal(size=count))
        motion *= np.exp(0.8 * comes / comes.std())
        level = np.sqrt(gaussian_filter1d(np.gradient(motion)**2, 20))
        grown = np.sqrt(1 + (0.6 * level / level.mean())**2)
        values = motion + 0.01 * motion.std() * grown * rng.normal(size=count)
        seen = SimpleNamespace(
            found=SimpleNamespace(jitter_rms_s=0.0), repeated=0.0, of_one_error=np.ones(1),
            record=SimpleNamespace(sampling_rate_hz=rate), used=np.ones(count, bool),
            measured=values, output=motion, is_coarse=False, slope_beyond=lambda noise: 0.0)
        assert SamplingJitter.recognised(seen, None) is None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("clock", [0.0, 1.0])
def test_a_delay_too_small_to_be_found_scatters_no_instants(clock, seed):
    """13 us at 100 Hz, a fifteenth of what noise left, followed the square of the slope: 21 us."""
    count, rate = 24_000, 100.0
    rng = np.random.default_rng([94, seed])
    motion = sosfiltfilt(butter(4, (0.5, 35), "band", fs=rate, output="sos"),
                         rng.normal(size=count))
    motion *= (1 + 0.9 * np.sin(np.arange(count) / 900)) / motion.std()
    slope = np.fft.irfft(2j * np.pi * np.fft.rfftfreq(count) * np.fft.rfft(motion))
    late = slope * (np.linspace(-1, 1, count) if clock else 1.0)
    noise = rng.normal(size=count) + rng.uniform(0.25, 0.35) * late / late.std()
    scatters, scatter = slope * rng.normal(size=count), 0.01 / slope.std()

    def recognised(scatter):
        return SamplingJitter.recognised(SimpleNamespace(
            of_one_error=np.ones(1), found=SimpleNamespace(jitter_rms_s=0.0), repeated=0.0,
            record=SimpleNamespace(sampling_rate_hz=rate), used=np.ones(count, bool),
            output=motion, is_coarse=False, slope_beyond=lambda power: 0.0,
            measured=motion + 0.01 * noise + scatter * scatters), None)
    assert recognised(0.0) is None
    named, reading = recognised(scatter)
    assert abs(named.rms_s * rate - scatter) < 4 * reading.std["rms_s"] * rate < 0.2 * scatter


def test_a_scatter_that_only_a_wider_fit_shows_is_named():
    """Beside what is named alone, the error of what is only suspected hides the law of a scatter;
    what is no scatter is told beside what is named."""
    scatter, tone = (SimpleNamespace(effect=known_effects()[cause](**values)) for cause, values in
                     (("sampling_jitter", {"rms_s": 1e-3}),
                      ("interference_bursts", {"share": 0.1, "rms": 1.0})))
    named, best, widest = object(), object(), object()
    shown = {named: [], best: [tone], widest: [scatter, tone]}
    assert _shown(shown.get, named, (best, widest)) == [scatter]
    assert _shown(shown.get, widest, (best, widest)) == [scatter, tone]
    shown[named] = [scatter]
    assert _shown(shown.get, named, (best, widest)) == [scatter]


@pytest.mark.parametrize("seed", range(4))
def test_an_error_that_stays_behind_the_slope_where_that_is_large_is_no_scatter(seed):
    """Beside a dead zone, the slope's square explained 135 % of the error's power, where few
    seconds hold most of the motion."""
    count, rate = 24_000, 100.0
    rng = np.random.default_rng([95, seed])
    motion = sosfiltfilt(butter(4, (0.5, 20), "band", fs=rate, output="sos"),
                         rng.normal(size=count))
    time = np.linspace(0, 1, count)
    motion *= (0.15 + np.exp(-((time - rng.uniform(0.3, 0.7)) / 0.03)**2)) / motion.std()
    slope = np.fft.irfft(2j * np.pi * np.fft.rfftfreq(count) * np.fft.rfft(motion))

    def recognised(most):
        error = 0.02 * np.minimum(np.abs(slope), most * slope.std()) * rng.normal(size=count)
        return SamplingJitter.recognised(SimpleNamespace(
            of_one_error=np.ones(1), found=SimpleNamespace(jitter_rms_s=0.0), repeated=0.0,
            record=SimpleNamespace(sampling_rate_hz=rate), used=np.ones(count, bool),
            output=motion, is_coarse=False, slope_beyond=lambda power: 0.0,
            measured=motion + error + 2e-4 * rng.normal(size=count)), None)
    named, _ = recognised(np.inf)
    assert named.rms_s == pytest.approx(0.02 / rate, rel=0.05)
    assert recognised(rng.uniform(2.2, 2.6)) is None


@pytest.mark.parametrize("seed", range(2))
def test_samples_that_say_the_last_value_again_scatter_no_instants(seed):
    """Where the reference has another rate, what repeats was not looked at: 7 % of a sensor's."""
    rng, rate, fine = np.random.default_rng([96, seed]), 80.0, 20
    count = 12_000
    motion = sosfiltfilt(butter(4, (0.5, 12), "band", fs=rate * fine, output="sos"),
                         rng.normal(size=count * fine))
    motion /= motion.std()
    values = motion[::fine] + 0.002 * rng.normal(size=count)
    again = 1 + np.flatnonzero(rng.random(count - 1) < 0.07)
    values[again] = values[again - 1]
    stamps = np.round(1e9 * np.arange(count) / rate)
    places = np.arange(0, count - 1, rate / 43.1)
    reference = np.interp(places * fine, np.arange(len(motion)), motion)
    found = diagnose(tuple(
        Samples.of(np.round(at).astype(np.int64), np.outer(each, [1.0, 0.0, 0.0]))
        for at, each in ((1e9 * places / rate, reference), (stamps, values))),
        SensorModel(Gain(1.0)))
    assert "sampling_jitter" not in {finding.cause for finding in found.findings}
