"""The variance that a corrected sample carries is that of its error: by Monte Carlo."""

import numpy as np
import pytest
import rig
from random_models import draw_sensor, model_of

from frac_accel import Corrector, simulate
from frac_accel.model import SensorModel
from frac_accel.model.effects import Circumstances
from frac_accel.signals.metrics import interpolate

RATE = 1000.0


def stamps_of(n):
    return 1_700_000_000_000_000_000 + np.arange(n) * 1_000_000


@pytest.mark.parametrize("seed", range(8))
def test_white_noise_alone(seed):
    """Sensor at rest: the output is the noise through the filter, cross-axis terms included."""
    rng = np.random.default_rng([5, seed])
    model = model_of(draw_sensor(rng, RATE, own_axes=0.5, share=0.5))
    std = 10 ** rng.uniform(-3, 0, 3)
    kernel = Corrector(model, RATE)
    n = 60_000
    values = model.live_simulation(RATE)(np.zeros((n, 3)), Circumstances.at_rest(n))
    values = values + rng.normal(size=(n, 3)) * std
    result = kernel.process(stamps_of(n), values, np.tile(std**2, (n, 1)))
    late = slice(20_000, None)
    for axis, design in enumerate(kernel.design.axes):
        if design.band_hz[0]:
            continue  # behind a high-pass the output wanders: too few independent samples here
        actual = np.mean(result.values[late, axis]**2)
        assert actual == pytest.approx(np.mean(result.variance[late, axis]), rel=0.15)


def test_mean_error_over_many_records_sample_by_sample():
    """From the first output on, with noise whose variance changes during the record."""
    rng = np.random.default_rng(6)
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2, "damping_order": 1.4}})
    n, records = 400, 600
    std = np.where(np.arange(n) < 200, 0.1, 1.0)[:, None] * [1.0, 2.0, 3.0]
    squares = 0
    for _ in range(records // 3):
        result = Corrector(model, RATE).process(stamps_of(n), rng.normal(size=(n, 3)) * std, std**2)
        squares = squares + (result.values / np.sqrt(result.variance))**2
    mean = squares.sum(axis=1) / records
    settled = (result.index < 170) | (result.index > 330)
    # slow poles forget the louder noise only slowly, so the change itself is left out
    assert np.all(mean[settled] < 1.5)
    assert 0.7 < np.mean(mean[result.index > 330]) < 1.3


def test_unknown_noise_is_said_and_the_models_own_noise_is_used():
    data = {"schema": "frac_accel/sensor_model/1",
            "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2}}
    values = np.random.default_rng(7).normal(size=(400, 3))
    unknown = Corrector(SensorModel.from_dict(data), RATE).process(stamps_of(400), values)
    assert np.isnan(unknown.variance).all()
    known = Corrector(SensorModel.from_dict({**data, "noise_std": 0.5}), RATE)
    result = known.process(stamps_of(400), values)
    gain = known.design.axes[0].noise_gain
    np.testing.assert_allclose(result.variance, 0.25 * gain**2, rtol=1e-9)
    given = Corrector(SensorModel.from_dict({**data, "noise_std": 0.5}), RATE,
                      noise_std=(0.1, 0.2, 0.3)).process(stamps_of(400), values)
    np.testing.assert_allclose(np.sqrt(given.variance[-1]), gain * np.array([0.1, 0.2, 0.3]))


@pytest.mark.parametrize("order", [0.6, 1.0, 1.5])
def test_bridged_gaps_are_covered(order):
    """Errors beside a bridged gap stay within the stated variance, or it is conservative."""
    rng = np.random.default_rng(8)
    sensor = rig.Sensor({"type": "oscillator", "natural_frequency_hz": 150.0,
                         "damping_ratio": 0.2, "damping_order": order, "sensitivity": 1.0})
    model = model_of(sensor)
    excitation = rig.band_noise(rng, RATE, 20.0, (2.0, 120.0), lead_s=0.5)
    record = rig.simulate_record(sensor, excitation, rng, 60.0)
    kept = np.ones(len(record.sensor), bool)
    for at in range(500, 19_500, 250):
        kept[at:at + rng.integers(1, 4)] = False
    kernel = Corrector(model, RATE, bandwidth_hz=200.0, noise_std=record.noise_std)
    result = kernel.process(record.stamps_ns[kept], record.sensor[kept])
    expected = interpolate(record.stamps_ns, record.reference, result.stamps_ns, RATE)
    usable = np.isfinite(expected).all(axis=1)
    scaled = ((result.values - expected) / np.sqrt(result.variance))[usable]
    touched = (result.variance[usable, 0] > 3 * np.median(result.variance[:, 0]))
    assert 500 < touched.sum() < 0.5 * len(touched)
    assert np.mean(scaled[touched]**2) < 2.0
    assert np.mean(np.abs(scaled[touched]) > 3) < 0.05
    # the rest is noise and the filter's own error, which the tolerance allows
    rest = (result.values - expected)[usable][~touched]
    assert np.std(rest) < 0.01 * np.std(record.reference)


@pytest.mark.parametrize("effects, order", [
    ((), 0.5), ((), 1.5), (({"cause": "ac_coupling", "corner_hz": 2.0},), 1.0),
    (({"cause": "ac_coupling", "corner_hz": 0.5},), 0.7)])
def test_unknown_history_at_the_start_is_covered(effects, order):
    """A record that starts in mid-motion: the filter has not seen what came before."""
    rng = np.random.default_rng(9)
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.3, "damping_order": order},
        "effects": list(effects)})
    low = Corrector(model, RATE).design.axes[0].band_hz[0]
    inside, count = 0, 0
    for _ in range(20):
        excitation = rig.band_noise(rng, RATE, 6.0, (max(2 * low, 1.0), 200.0), lead_s=0.1)
        output = simulate(model, excitation.reference, RATE)[3000:]
        result = Corrector(model, RATE, noise_std=1e-4).process(stamps_of(3000), output)
        error = result.values - excitation.reference[3000:][result.index]
        # the filter's tolerance is no noise: it is added here
        bound = 3 * np.sqrt(result.variance) + 6e-3
        inside += np.sum(np.abs(error) < bound)
        count += error.size
    assert inside > 0.99 * count


def test_variance_is_never_negative_nor_zero():
    rng = np.random.default_rng(10)
    for seed in range(4):
        model = model_of(draw_sensor(np.random.default_rng(seed), RATE))
        values = rng.normal(size=(1000, 3))
        variance = np.where(rng.random((1000, 3)) < 0.5, 0.0, rng.random((1000, 3)))
        result = Corrector(model, RATE).process(stamps_of(1000), values, variance)
        assert not np.any(result.variance <= 0)
