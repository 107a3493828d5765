"""What counts from the record's start counts from the sensor's first sample, as when correcting."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from frac_accel import Samples, SensorModel, diagnose, validate
from frac_accel.model.core import Gain
from frac_accel.model.effects.gain_step import GainStep


def topics(seed, disturb, late_s, rates=(200.0, 200.0), duration_s=60.0):
    """Reference that begins `late_s` after a sensor with a disturbance of its own time."""
    rng = np.random.default_rng(seed)
    fine = 1000.0
    motion = rng.normal(size=int(duration_s * fine))
    motion = lfilter(*butter(4, [0.5, 30], "band", fs=fine), motion)
    motion *= 2.0 / motion.std()
    found = []
    for rate, start_s in zip(rates, (late_s, 0.0)):
        t = np.arange(start_s, duration_s - 0.1, 1 / rate)
        found.append((t, np.interp(t, np.arange(len(motion)) / fine, motion)))
    t, true = found[1]
    found[1] = t, disturb(true, t) + rng.normal(0, 0.01, len(t))
    return tuple(Samples.of(np.round(1e9 * (100.0 + at)), np.outer(values, [1, 0, 0]))
                 for at, values in found)


@pytest.mark.parametrize("late_s, rates", [(3.1, (200.0, 200.0)), (0.0, (100.0, 200.0))])
def test_a_step_is_where_the_sensor_has_it(late_s, rates):
    at_s = 31.0
    pair = topics(1, lambda y, t: y + 0.5 * (t >= at_s), late_s, rates)
    found = diagnose(pair, SensorModel(Gain(1.0)))
    step, = [f for f in found.findings if f.cause == "offset_step"]
    assert abs(step.effect.at_s - at_s) < 1.5 / min(rates)


@pytest.mark.parametrize("late_s", [0.0, 3.1])
def test_a_tone_has_the_phase_that_it_has_at_the_sensors_first_sample(late_s):
    hz, phase = 17.3, 0.7
    pair = topics(2, lambda y, t: y + 0.4 * np.sin(2 * np.pi * hz * t + phase), late_s)
    found = diagnose(pair, SensorModel(Gain(1.0)))
    tone, = found.findings
    assert tone.cause == "tone_interference"
    assert abs(tone.effect.frequency_hz - hz) < 4 * tone.std["frequency_hz"]
    assert abs(tone.effect.phase_rad - phase) < 4 * tone.std["phase_rad"]


def test_validate_counts_from_the_sensors_first_sample():
    pair = topics(3, lambda y, t: y * (1 + 0.2 * (t >= 20.0)), 3.1)
    model = SensorModel(Gain(1.0), [GainStep(20.0, 1.2)])
    assert validate(pair, model).whole_nrmse < 0.01
