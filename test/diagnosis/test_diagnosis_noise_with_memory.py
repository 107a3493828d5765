"""Noise and hum as instruments have them: no false name, and the true one."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import frac_accel
from frac_accel.model.core import Gain, Oscillator

RATE = 200.0


def diagnosed(motion, sensor):
    return frac_accel.diagnose((motion, sensor), frac_accel.SensorModel(Gain(1.0)),
                               sampling_rate_hz=RATE)


def band(rng, count, low_hz, high_hz):
    sos = butter(4, (low_hz, high_hz), "bandpass", fs=RATE, output="sos")
    return sosfilt(sos, rng.standard_normal(count + 1000))[1000:]


@pytest.mark.parametrize("seed", [4101, 4102, 4103])
def test_a_high_pass_gets_no_credit_for_a_decay_that_follows_a_wandering_zero(seed):
    rng = np.random.default_rng(seed)
    motion = band(rng, 8000, 5.0, 60.0)
    walk = np.cumsum(rng.standard_normal(len(motion)))
    sensor = motion + 0.1 * walk / np.std(walk) + 1e-3 * rng.standard_normal(len(motion))
    assert not {f.cause for f in diagnosed(motion, sensor).findings} & {
        "ac_coupling", "reference_ac_coupling"}


@pytest.mark.parametrize("seed", [4103, 4108, 4102])
def test_fractional_damping_gets_no_credit_for_decays_that_follow_a_wandering_zero(seed):
    """A lag far above the motion is nearly a delay with a little damping of another order, whose
    memory of the time before the record could follow any drift if it were as large."""
    rng, count, rate = np.random.default_rng(seed), 20_000, 2000.0
    frequency = np.fft.rfftfreq(count, 1 / rate)
    lines = np.where((frequency > 70) & (frequency < 680), rng.standard_normal(len(frequency))
                     + 1j * rng.standard_normal(len(frequency)), 0.0)
    core = Oscillator(rng.uniform(1100, 1400), rng.uniform(0.02, 0.05))
    corner_hz = rng.uniform(2200, 2800)
    # the motion repeats, so that the response is exact
    u = 1j * frequency / core.natural_frequency_hz
    answered = lines / (u**2 + 2 * core.damping_ratio * u + 1) / (1 + 1j * frequency / corner_hz)
    motion, sensor = (np.fft.irfft(values, count) for values in (lines, answered))
    walk = np.cumsum(rng.standard_normal(count))
    sensor = sensor + np.std(motion) * (0.02 * walk / np.std(walk)
                                        + 0.004 * rng.standard_normal(count))
    found = frac_accel.diagnose((motion, sensor), frac_accel.SensorModel(core),
                                sampling_rate_hz=rate)
    effects = {f.cause: f.effect for f in found.findings}
    assert np.isclose(effects["low_pass_lag"].corner_hz, corner_hz, rtol=0.01)
    assert not effects.keys() & {"fractional_damping", "time_delay", "ac_coupling"}


@pytest.mark.parametrize("seed", [4111, 4112, 4113])
def test_slow_noise_makes_no_step_of_static_levels(seed):
    rng = np.random.default_rng(seed)
    levels = np.r_[0:101:20, 80:-1:-20]
    motion = np.repeat(levels, 600).astype(float) + 1e-3 * rng.standard_normal(600 * len(levels))
    spectrum = np.fft.rfft(rng.standard_normal(len(motion)))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    pink = np.fft.irfft(spectrum, len(motion))
    sensor = rng.uniform(1.01, 1.03) * motion + 0.35 + 0.02 * pink / np.std(pink)
    assert not {f.cause for f in diagnosed(motion, sensor).findings} - {
        "sensitivity_error", "offset"}


@pytest.mark.parametrize("seed", [4121, 4122, 4123])
def test_the_harmonics_of_a_hum_say_nothing_against_it(seed):
    rng = np.random.default_rng(seed)
    motion, time = band(rng, 8000, 2.0, 40.0), np.arange(8000) / RATE
    hum_hz = rng.uniform(16, 19)
    hum = sum(size * np.sin(2 * np.pi * number * hum_hz * time + rng.uniform(0, 2 * np.pi))
              for number, size in ((1, 1.0), (2, 0.35), (3, 0.2), (4, 0.1)))
    sensor = motion + 0.1 * hum + 1e-3 * rng.standard_normal(len(time))
    found = {f.cause: f.effect for f in diagnosed(motion, sensor).findings}
    assert found.keys() == {"tone_interference"}
    assert np.isclose(found["tone_interference"].frequency_hz, hum_hz, rtol=1e-4)


@pytest.mark.parametrize("seed", [4141, 4142, 4143])
def test_a_line_of_another_axis_is_no_tone_from_elsewhere(seed):
    """A lightly damped part that another axis' motion sets in motion: it picks one line of it."""
    rng = np.random.default_rng(seed)
    count = 8000
    frequency = np.fft.rfftfreq(count, 1 / RATE)
    lines = np.zeros((2, len(frequency)), complex)
    # every twentieth line, so that each axis repeats, and each has its own
    for axis in range(2):
        chosen = np.arange(80 + 10 * axis, 1600, 20)
        lines[axis, chosen] = rng.uniform(0.3, 1, len(chosen)) * np.exp(
            2j * np.pi * rng.random(len(chosen)))
    rings_hz = frequency[90 + 20 * rng.integers(30, 50)]
    ratio = 1j * frequency / rings_hz
    crosses = 0.002 * ratio**2 / (ratio**2 + 2 * 0.003 * ratio + 1)
    motion, other = np.fft.irfft(lines, count)
    scale = np.std(motion)
    reference = np.c_[motion, other, np.zeros(count)] / scale
    sensor = reference.copy()
    sensor[:, 0] += np.fft.irfft(lines[1] * crosses, count) / scale
    sensor[:, :2] += 1e-3 * rng.standard_normal((count, 2))
    assert "tone_interference" not in {f.cause for f in diagnosed(reference, sensor).findings}


@pytest.mark.parametrize("seed", [4131, 4132, 4133])
def test_a_rattle_above_a_level_is_no_scatter_of_the_instants(seed):
    rng = np.random.default_rng(seed)
    motion = band(rng, 8000, 2.0, 40.0) * np.linspace(0.3, 1.5, 8000)
    loud = np.abs(motion) > rng.uniform(1.5, 2.0) * np.std(motion)
    sensor = motion + np.std(motion) * (0.03 * loud + 1e-3) * rng.standard_normal(len(motion))
    assert "sampling_jitter" not in {f.cause for f in diagnosed(motion, sensor).findings}


@pytest.mark.parametrize("seed", [4151, 4152])
def test_a_hum_far_louder_than_the_motion_hides_no_relation(seed):
    rng = np.random.default_rng(seed)
    motion, time = band(rng, 8000, 2.0, 40.0), np.arange(8000) / RATE
    hum = 10 * np.std(motion) * np.sin(2 * np.pi * rng.uniform(45, 60) * time)
    noise = 1e-3 * rng.standard_normal(len(time))
    assert [f.cause for f in diagnosed(motion, motion + hum + noise).findings] == [
        "tone_interference"]
    with pytest.raises(frac_accel.FracAccelError, match="does not follow"):
        diagnosed(motion, band(rng, 8000, 2.0, 40.0) + hum + noise)
