"""Intervals of a diagnosis where what is left is no stationary noise: coverage by Monte Carlo."""

import numpy as np
import pytest
from exact_sines import oscillator, record, samples

from frac_accel import SensorModel
from frac_accel.diagnosis.engine import Engine
from frac_accel.model.core import Oscillator
from frac_accel.model.effects import effect_of
from frac_accel.record import Record

DRAWS = 100


def scores(seed, noise_of):
    """Distances of three parameters from the truth in stated standard uncertainties."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(60, 200), rng.uniform(0.1, 0.8), rng.uniform(0.8, 1.25)
    reference, output = record(rng, lambda s: truth[2] * oscillator(s, *truth[:2]), n=4000,
                               sines=300, noise=0.0)
    pair = Record.of(*samples(reference, output + noise_of(output, rng)))
    base = {"core_parameter_shift": effect_of("core_parameter_shift")(110.0, 0.4),
            "sensitivity_error": effect_of("sensitivity_error")(1.0)}
    engine = Engine(pair, 0, SensorModel(Oscillator(110.0, 0.4)), pair.valid, base)
    fit = engine.search.fit(base)
    stds = engine.uncertainties(fit)
    return [(getattr(fit.effects[cause], name) - value) / stds[cause][name]
            for (cause, name), value in zip((
                ("core_parameter_shift", "natural_frequency_hz"),
                ("core_parameter_shift", "damping_ratio"), ("sensitivity_error", "gain")), truth)]


def white(output, rng):
    return 0.03 * np.std(output) * rng.standard_normal(len(output))


def coloured(output, rng):
    return np.convolve(white(output, rng), np.hanning(42), "same")


def louder_with_the_motion(output, rng):
    return 0.05 * output * rng.standard_normal(len(output))


@pytest.mark.parametrize("noise_of", [white, coloured, louder_with_the_motion])
def test_coverage(noise_of):
    inside = np.abs([scores(seed, noise_of) for seed in range(DRAWS)]) < 1.96
    # 300 intervals, three of each record together: 0.95 within two standard deviations of chance
    assert 0.91 <= inside.mean() <= 0.99
