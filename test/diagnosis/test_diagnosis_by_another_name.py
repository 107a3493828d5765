"""A low-pass of second order answers as a sensor does that is damped by 0.7: which one it is."""

import numpy as np
import pytest
from exact_sines import samples
from scipy.signal import bilinear, butter, lfilter, sosfilt

from frac_accel import SensorModel, diagnose
from frac_accel.diagnosis.engine import Engine
from frac_accel.diagnosis.sprung import as_the_sensor, by_another_name, is_better, may_hide_one
from frac_accel.model.core import Gain, Oscillator
from frac_accel.model.effects import effect_of
from frac_accel.record import Record

RATE, COUNT, FINER = 1000.0, 20_000, 16


def engines(damping, seed):
    """Engine of a gain with its best low-pass, and of an oscillator with its best set, for a sensor
    that is damped like that."""
    rng = np.random.default_rng(seed)
    fine, own = RATE * FINER, 2 * np.pi * rng.uniform(380, 430)
    motion = sosfilt(butter(10, rng.uniform(200, 250), fs=fine, output="sos"),
                     rng.standard_normal(COUNT * FINER))
    sensor = lfilter(*bilinear([own**2], [1, 2 * damping * own, own**2], fine), motion)[::FINER]
    sensor = sensor + 0.02 * sensor.std() * rng.standard_normal(COUNT)
    record = Record.of(*samples(motion[::FINER], sensor, RATE))
    found = []
    for core, effects in ((Gain(1.0), [effect_of("low_pass_filter")(400.0, 2, "butterworth")]),
                          (Oscillator(400.0, 0.7), [
                              effect_of("core_parameter_shift")(400.0, 0.7)])):
        effects = [*effects, effect_of("sensitivity_error")(1.001)]
        engine = Engine(record, 0, SensorModel(core), record.valid, {})
        found += [engine, engine.search.fit({effect.cause: effect for effect in effects})]
    return found


@pytest.mark.parametrize("seed", [3461, 3462, 3465, 3466])
def test_a_sensor_with_another_damping_is_no_low_pass(seed):
    gain, low_pass, _, oscillator = engines(0.66, seed)
    assert by_another_name(gain, low_pass) == {"low_pass_filter"}
    assert may_hide_one(gain, low_pass)
    assert is_better(gain, low_pass, oscillator, True)


@pytest.mark.parametrize("seed", [3463, 3464, 3467, 3468])
def test_a_low_pass_is_one_where_its_damping_is_known(seed):
    gain, low_pass, _, oscillator = engines(np.sqrt(0.5), seed)
    assert not is_better(gain, low_pass, oscillator, True)
    assert as_the_sensor(gain, low_pass, oscillator, (0.71, 0.005)) == {}
    assert "may be one" in as_the_sensor(gain, low_pass, oscillator, (0.7, 0.1))["low_pass_filter"]


@pytest.mark.parametrize("seed", [3611, 3614])
def test_a_mount_beside_a_gain_that_drifts_is_no_oscillator_with_a_lead(seed):
    """Where no core was identified beside the drift, an oscillator and a `reference_low_pass` had
    the mount's poles and its zero."""
    rng = np.random.default_rng(seed)
    rate, count, finer = 50.0, 950, 32
    fine = rate * finer
    band = [rng.uniform(0.1, 0.4), rng.uniform(2, 5)]
    motion = sosfilt(butter(2, band, "band", fs=fine, output="sos"),
                     rng.standard_normal(count * finer))
    frequency, damping = rng.uniform(6, 9), rng.uniform(0.1, 0.25)
    own = 2 * np.pi * frequency
    sensor = lfilter(*bilinear([2 * damping * own, own**2], [1, 2 * damping * own, own**2], fine),
                     motion)[::finer]
    drift = rng.choice([-1, 1]) * rng.uniform(0.25, 0.6)
    sensor = sensor * (1 + drift * np.arange(count) / count)
    sensor = sensor + 0.006 * sensor.std() * rng.standard_normal(count)
    found = {finding.cause: finding for finding in diagnose(
        samples(motion[::finer], sensor, rate)).findings}
    assert set(found) == {"mounting_resonance", "gain_drift"}
    mount = found["mounting_resonance"]
    assert abs(mount.effect.frequency_hz - frequency) < 4 * mount.std["frequency_hz"]
    assert abs(mount.effect.damping_ratio - damping) < 4 * mount.std["damping_ratio"]
