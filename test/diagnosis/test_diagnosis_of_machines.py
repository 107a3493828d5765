"""What records of vehicles and machines by others showed: sensors that differ only a little from
what a cause says, and faults of the record. Made at a far higher rate, without the package."""

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import bilinear, butter, lfilter, sosfilt, sosfiltfilt

from frac_accel import Record, Samples, SensorModel, diagnose
from frac_accel.model.core import Gain

RATE, FINER, DURATION_S = 200.0, 8, 120.0
FINE = RATE * FINER


def moving(rng, band_hz=(0.3, 60.0), duration_s=DURATION_S):
    """Random motion of 1 m/s² RMS whose level comes and goes, at the fine rate."""
    count, beside = round(FINE * duration_s), round(20 * FINE)
    motion = sosfiltfilt(butter(4, band_hz, "band", fs=FINE, output="sos"),
                         rng.normal(size=count + 2 * beside))[beside:-beside]
    level = 0.7 + 0.5 * np.sin(2 * np.pi * np.arange(count) / FINE / rng.uniform(15, 40))
    motion *= level
    return motion / motion.std()


def causes(found):
    return {finding.cause for finding in found.findings}


def gain_of_one(record):
    return diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)


@pytest.mark.parametrize("seed", range(2))
def test_a_gain_that_settles_is_no_step(seed):
    rng = np.random.default_rng(seed)
    motion = moving(rng)
    time = np.arange(len(motion)) / FINE
    settling = np.exp(-time / rng.uniform(12, 25))
    sensor = motion * (1 + 0.06 * settling)
    found = gain_of_one(sampled_pair(rng, (motion, sensor), FINER, RATE, 0.01))
    assert "gain_step" not in causes(found)
    stepped = motion * np.where(time > rng.uniform(40, 80), 1.06, 1.0)
    found = gain_of_one(sampled_pair(rng, (motion, stepped), FINER, RATE, 0.01))
    assert causes(found) == {"gain_step"}


@pytest.mark.parametrize("seed, band_hz", [
    (0, (60.0, 80.0)), (1, (60.0, 80.0)),
    # where little of it is compared
    (2, (38.0, 40.0)), (3, (38.0, 40.0))])
def test_a_tone_beyond_what_is_compared_is_told(seed, band_hz):
    rng = np.random.default_rng(seed)
    motion = moving(rng, (0.3, 15.0))
    tone_hz = rng.uniform(*band_hz)
    hum = 0.12 * np.sin(2 * np.pi * tone_hz * np.arange(len(motion)) / FINE)
    reference, sensor = sampled_pair(rng, (motion, motion + hum), FINER, RATE, 0.003)
    slower = Samples.of(reference.stamps_ns[::2], reference.values[::2])
    found = gain_of_one((slower, sensor))
    assert found.verdict == "undecided"
    assert "compared up to 36 Hz only: 8." in found.reason
    beyond = Record.of(slower, sensor).beyond(0)
    assert beyond.tone_hz == pytest.approx(tone_hz, abs=2 / DURATION_S)
    assert beyond.share == pytest.approx(0.12 / np.sqrt(2) / np.hypot(1, 0.085), rel=0.05)
    assert gain_of_one((slower, sampled_pair(rng, (motion,), FINER, RATE, 0.003)[0])).verdict \
        == "consistent"
    assert Record.of(reference, sensor).beyond(0) is None


def on_a_mount(motion, frequency_hz, ratio):
    """Motion behind a mount's spring; the bilinear transform moves the peak by a hundredth at most.
    """
    omega = 2 * np.pi * frequency_hz
    return lfilter(*bilinear([2 * ratio * omega, omega**2],
                             [1, 2 * ratio * omega, omega**2], FINE), motion)


@pytest.mark.parametrize("seed", range(2))
def test_a_soft_mount_and_limits_are_told_without_a_model(seed):
    rng = np.random.default_rng(seed)
    motion = moving(rng, (0.5, 80.0), 60.0)
    frequency_hz, ratio = rng.uniform(45.0, 70.0), rng.uniform(0.04, 0.1)
    offset = rng.uniform(0.1, 0.4)
    sensor = on_a_mount(motion, frequency_hz, ratio) + offset
    reference, raw = sampled_pair(rng, (motion, sensor), FINER, RATE, 0.004)
    limit = np.quantile(np.abs(raw.values[:, 0]), 0.99)
    raw = Samples.of(raw.stamps_ns, np.clip(raw.values, -limit, limit))
    found = diagnose((reference, raw), time_limit_s=60)
    assert causes(found) == {"mounting_resonance", "offset", "clipping"}
    mount = next(f for f in found.findings if f.cause == "mounting_resonance")
    assert mount.effect.frequency_hz == pytest.approx(frequency_hz, rel=0.01)


def test_samples_that_are_sent_twice_are_no_scattering_instants():
    rng = np.random.default_rng(3)
    motion = moving(rng, (0.3, 30.0))
    reference, sensor = sampled_pair(rng, (motion, motion), FINER, RATE, 0.005)
    values = sensor.values.copy()
    for i in np.flatnonzero(rng.random(len(values)) < 0.25)[1:]:
        values[i] = values[i - 1]
    found = gain_of_one((reference, Samples.of(sensor.stamps_ns, values)))
    assert "sampling_jitter" not in causes(found)
    instants = np.arange(len(motion)) / FINE
    taken = instants[::FINER] + rng.normal(0, 8e-4, len(values))
    scattered = np.interp(taken, instants, motion) + rng.normal(0, 0.005, len(taken))
    found = gain_of_one((reference, Samples.of(sensor.stamps_ns, np.outer(scattered, [1, 0, 0]))))
    assert causes(found) == {"sampling_jitter"}


def test_a_clipped_reference_does_not_count():
    rng = np.random.default_rng(4)
    motion = moving(rng, (0.3, 30.0))
    reference, sensor = sampled_pair(rng, (motion, 1.1 * motion), FINER, RATE, 0.002)
    limit = np.sort(reference.values[:, 0])[-30]
    clipped = Samples.of(reference.stamps_ns, np.minimum(reference.values, limit))
    found = gain_of_one((clipped, sensor))
    assert any("the reference is clipped at" in words for words in found.integrity.words)
    gain = next(f for f in found.findings if f.cause == "sensitivity_error")
    assert abs(gain.effect.gain - 1.1) < 4 * gain.std["gain"]
    assert causes(found) == {"sensitivity_error"}


@pytest.mark.parametrize("seed", range(2))
def test_clocks_seconds_apart_are_set_right_in_a_narrow_band(seed):
    """As two recorders that a hand moved together at some two hertz."""
    rng = np.random.default_rng(seed)
    motion = moving(rng, (1.5, 2.6), 60.0)
    reference, sensor = sampled_pair(rng, (motion, motion), FINER, RATE, 0.01)
    late_ns = round(rng.uniform(3.0, 6.0) * 1e9)
    record = Record.of(reference, Samples.of(sensor.stamps_ns + late_ns, sensor.values))
    assert record.taken_out_s == pytest.approx(1e-9 * late_ns, abs=2e-3)


@pytest.mark.parametrize("seed", range(2))
def test_a_turn_is_named_beside_a_noisy_reference(seed):
    rng = np.random.default_rng(seed)
    axes = [moving(rng, (0.3, 30.0)) for _ in range(3)]
    turn = np.radians(rng.uniform(4.0, 8.0))
    turned = np.cos(turn) * axes[0] + np.sin(turn) * axes[1]
    _, sensor = sampled_pair(rng, (axes[0], turned), FINER, RATE, 0.005)
    values = np.stack([axis[::FINER] for axis in axes], axis=1)
    noisy = Samples.of(sensor.stamps_ns, values + rng.normal(0, 0.1, values.shape))
    found = gain_of_one((noisy, sensor))
    assert "reference_noise" in causes(found)
    assert causes(found) & {"misalignment", "cross_axis_sensitivity"}


@pytest.mark.parametrize("seed", range(2))
def test_samples_between_those_of_the_reference_lead_by_nothing(seed):
    """A mount and AC coupling; the sensor samples some way between two samples of the reference."""
    rng = np.random.default_rng(seed)
    motion = moving(rng, (0.3, 40.0), 60.0)
    sensor = sosfilt(butter(1, rng.uniform(0.2, 0.5), "high", fs=FINE, output="sos"),
                     on_a_mount(motion, rng.uniform(35.0, 45.0), rng.uniform(0.05, 0.15)))
    later = rng.integers(1, 4)
    reference, raw = sampled_pair(rng, (motion[:-FINER], sensor[later:later - FINER]), FINER, RATE,
                                  0.003)
    raw = Samples.of(raw.stamps_ns + round(later / FINE * 1e9), raw.values)
    assert causes(diagnose((reference, raw), time_limit_s=60)) == {"mounting_resonance",
                                                                  "ac_coupling"}


@pytest.mark.parametrize("seed", range(2))
def test_a_dead_zone_is_named_beside_a_slower_reference(seed):
    rng = np.random.default_rng(seed)
    motion = moving(rng, (0.2, 2.5))
    half_width = rng.uniform(0.08, 0.2)
    sensor = motion - np.clip(motion, -half_width, half_width)
    reference, raw = sampled_pair(rng, (motion, sensor), FINER, RATE, 0.003)
    found = gain_of_one((Samples.of(reference.stamps_ns[::2], reference.values[::2]), raw))
    assert causes(found) == {"dead_zone"}
    dead = found.findings[0]
    assert abs(dead.effect.half_width - half_width) < 4 * dead.std["half_width"]
