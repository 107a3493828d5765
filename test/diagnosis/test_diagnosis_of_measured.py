"""What measured records have taught: each draw is made by its own equations, no package's."""

import numpy as np
import pytest
from exact_sines import RATE as EXACT_RATE
from exact_sines import oscillator, record
from rig.road import draw_drive, drive_on_road
from scipy.signal import butter, lfilter

import frac_accel
from frac_accel.model.core import Gain

RATE = 200.0


def drive(seed, duration_s=40.0):
    rng = np.random.default_rng(seed)
    motion = drive_on_road(rng, RATE, duration_s, draw_drive(rng)).reference[:, 0]
    return rng, motion / np.std(motion)


def named(found):
    return {finding.cause: finding for finding in found.findings}


@pytest.mark.parametrize("seed", [4101, 4102])
def test_a_large_offset_is_one_beside_a_reference_that_is_not_understood(seed):
    """As of two seismometers on one pier: the reference is filtered at both ends of the band."""
    rng, motion = drive(seed, 20.0)
    offset, gain, constant = -rng.uniform(10, 20), rng.uniform(0.7, 0.9), rng.uniform(3, 5)
    sensor = gain * (motion + constant) + offset + 0.03 * rng.standard_normal(len(motion))
    reference = lfilter(*butter(1, rng.uniform(12, 18), fs=RATE), motion)
    reference = lfilter(*butter(1, 0.01, "high", fs=RATE), reference) + constant
    found = frac_accel.diagnose((reference, sensor), sampling_rate_hz=RATE)
    assert named(found)["offset"].effect.offset == pytest.approx(offset, abs=0.3)
    assert found.extended["nrmse"] < 0.5


@pytest.mark.parametrize("seed", [4111, 4112])
def test_friction_is_named_beside_a_lag_that_two_causes_say(seed):
    """A motor's velocity behind a first-order filter, integrated at 50 times the rate."""
    rng = np.random.default_rng(seed)
    corner, level, lag = rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.4), rng.uniform(4, 8)
    time = np.arange(int(20 * RATE)) / RATE
    force = lfilter(*butter(2, 1.0, fs=RATE), rng.standard_normal(len(time)))
    force /= np.std(force)
    fine = np.interp(np.arange(50 * len(time)) / (50 * RATE), time, force)
    step, velocity, q = 2 * np.pi * corner / (50 * RATE), np.empty(len(fine)), 0.0
    for i, x in enumerate(fine):
        driven = q + step * (x - q)
        # dry friction takes at most what there is
        q = np.sign(driven) * max(abs(driven) - step * level, 0.0)
        velocity[i] = q
    slow = lfilter(*butter(1, lag, fs=50 * RATE), velocity)[::50]
    sensor = slow + 0.01 * np.std(slow) * rng.standard_normal(len(slow))
    found = frac_accel.diagnose((force, sensor), sampling_rate_hz=RATE)
    friction = named(found)["free_mass_friction"].effect
    assert friction.corner_hz == pytest.approx(corner, rel=0.05)
    assert friction.level == pytest.approx(level, rel=0.1)
    assert not named(found).keys() - {"free_mass_friction", "low_pass_lag", "low_pass_filter"}


@pytest.mark.parametrize("seed", [4121, 4122])
def test_jitter_that_is_large_beside_the_period_is_jitter(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(12000) / RATE
    tones = [(rng.uniform(5, 40), rng.uniform(0, 6.3)) for _ in range(30)]
    jitter = rng.uniform(0.15, 0.25) / RATE

    def motion(at):
        return sum(np.sin(2 * np.pi * f * at + phase) for f, phase in tones)
    sensor = motion(time + jitter * rng.standard_normal(len(time)))
    sensor += 0.002 * np.std(sensor) * rng.standard_normal(len(time))
    found = frac_accel.diagnose((motion(time), sensor), frac_accel.SensorModel(Gain(1.0)),
                                sampling_rate_hz=RATE)
    assert named(found)["sampling_jitter"].effect.rms_s == pytest.approx(jitter, rel=0.05)


@pytest.mark.parametrize("seed", [4131, 4132])
def test_what_a_model_leaves_is_in_the_band_of_what_it_corrects(seed):
    """A sensor with a law that `identify` does not know: twice the stated deviation holds."""
    rng, motion = drive(seed, 60.0)
    sensor = motion + rng.uniform(0.05, 0.1) * np.abs(motion) * motion
    sensor += 0.001 * rng.standard_normal(len(motion))
    model = frac_accel.identify((motion, sensor), sampling_rate_hz=RATE).model
    assert 0.02 < model.model_error < 0.5
    stamps = np.round(np.arange(len(motion)) * 1e9 / RATE).astype(np.int64)
    done = frac_accel.Corrector(model, RATE).process(
        stamps, np.stack([sensor] * 3, axis=1))
    inside = np.searchsorted(stamps, done.stamps_ns)
    inside = np.minimum(inside, len(stamps) - 1)
    off = done.values[:, 0] - np.interp(done.stamps_ns, stamps, motion)
    covered = np.abs(off) < 2 * np.sqrt(done.variance[:, 0])
    assert 0.85 < covered.mean()


@pytest.mark.parametrize("seed", [4141, 4142])
def test_a_turn_has_its_angles_where_nobody_has_stated_the_gain(seed):
    """The gain that is found for one axis is that of all: the sine of the turn is not divided by
    its cosine."""
    rng = np.random.default_rng(seed)
    pitch, yaw = rng.uniform(6, 12, 2) * rng.choice([-1, 1], 2)
    frequency, ratio, gain = rng.uniform(120, 300), rng.uniform(0.3, 0.7), rng.uniform(0.5, 2)
    motion, felt = np.transpose([record(rng, lambda s: gain * oscillator(s, frequency, ratio),
                                        noise=0.0) for _ in "xyz"], (1, 2, 0))
    (sp, cp), (sy, cy) = ((np.sin(a), np.cos(a)) for a in np.radians([pitch, yaw]))
    # Rz(yaw) Ry(pitch): from the sensor's axes to the reference's
    turn = np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0, cp]])
    sensor = felt @ turn + 1e-3 * rng.standard_normal(felt.shape)
    found = named(frac_accel.diagnose((motion, sensor), sampling_rate_hz=EXACT_RATE))
    assert found.keys() == {"misalignment"}
    assert found["misalignment"].effect.pitch_deg == pytest.approx(pitch, abs=0.05)
    assert found["misalignment"].effect.yaw_deg == pytest.approx(yaw, abs=0.05)


@pytest.mark.parametrize("seed", [4151, 4152])
def test_a_hum_does_not_make_a_filter_look_like_an_oscillator(seed):
    rng = np.random.default_rng(seed)
    length, late, hum = rng.uniform(1.5e-3, 2.2e-3), rng.uniform(0.3e-3, 1e-3), rng.uniform(45, 55)
    reference, sensor = record(rng, lambda s: np.exp(-s * (late + length / 2))
                               * np.sinc(length * s.imag / (2 * np.pi)), band=(5, 300))
    sensor += 0.1 * np.sin(2 * np.pi * hum * np.arange(len(sensor)) / EXACT_RATE)
    found = named(frac_accel.diagnose((reference, sensor), sampling_rate_hz=EXACT_RATE))
    assert found.keys() == {"linear_phase_filter", "time_delay", "tone_interference"}
    assert found["linear_phase_filter"].effect.length_s == pytest.approx(length, rel=0.005)
    assert found["time_delay"].effect.delay_s == pytest.approx(late, rel=0.01)
