"""A curve without a name: found, monotonic, worth something only where there is something."""

import numpy as np
import pytest
from exact_sines import RATE, oscillator, record, samples

from frac_accel import Corrector, check_effect, diagnose
from frac_accel.diagnosis.empirical_map import fit_empirical_map
from frac_accel.errors import FracAccelError, ModelError
from frac_accel.model import SensorModel
from frac_accel.model.effects import effect_of

GAIN = {"schema": "frac_accel/sensor_model/1", "core": {"type": "gain"}}


def saturated(values, seed):
    """Levels off, and more so on one side: no cause of the catalogue."""
    limit = np.random.default_rng(seed).uniform(2.0, 4.0)
    return np.where(values > 0, limit * np.tanh(values / limit),
                    2 * limit * np.tanh(values / (2 * limit)))


def bent(seed, noise=1e-2, n=16_000, of_sensor=np.ones_like):
    reference, sensor = record(np.random.default_rng(seed), of_sensor, band=(1.0, 100.0), n=n,
                               noise=0)
    rng = np.random.default_rng([seed, 1])
    return reference, sensor, saturated(sensor, seed) + noise * rng.standard_normal(n)


def masks(n):
    used = np.ones(n, bool)
    used[:64] = used[-64:] = False
    return used, np.arange(n) >= 0.75 * n


@pytest.mark.parametrize("seed", range(4))
def test_describes_an_unknown_curve_down_to_the_noise(seed):
    reference, _, measured = bent(seed)
    found = fit_empirical_map(measured, reference, *masks(len(measured)))
    assert found.is_worth_it
    assert found.gain.after < 1.2e-2 < 2e-2 < found.gain.before
    x = np.linspace(-2.5, 2.5, 101)
    assert np.max(np.abs(found.effect.simulate(x, None) - saturated(x, seed))) < 0.04
    # what it says of its own uncertainty is of that size in the middle
    knots = np.abs(found.effect.before) < 1.5
    error = (found.effect.after - saturated(np.array(found.effect.before), seed))[knots]
    assert np.sqrt(np.mean(error**2)) < 0.02 and max(np.array(found.effect.std)[knots]) < 0.005


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_described_where_noise_is_all_that_is_left(seed):
    reference, sensor, _ = bent(seed)
    noisy = sensor + 0.05 * np.random.default_rng(seed).standard_normal(len(sensor))
    try:
        assert not fit_empirical_map(noisy, reference, *masks(len(sensor))).is_worth_it
    except FracAccelError as error:
        assert "straight line" in str(error)


def test_a_curve_that_turns_back_is_none():
    reference, _, _ = bent(1)
    with pytest.raises(FracAccelError, match="straight line"):
        fit_empirical_map(np.abs(reference), reference, *masks(len(reference)))


def test_undone_to_the_last_bits_with_its_uncertainty():
    check_effect(effect_of("empirical_map"))
    effect = effect_of("empirical_map")((-2.0, 0.0, 3.0), (-1.0, 0.0, 2.5), (0.1, 0.0, 0.2))
    x = np.linspace(-9, 9, 999)
    back, variance = effect.invert(effect.simulate(x, None), np.full(999, 0.01), None)
    np.testing.assert_allclose(back, x, atol=1e-9)
    # in the middle only the samples' noise, by the slope there
    middle = np.argmin(np.abs(x))
    slope = np.diff(effect.simulate(np.array([-1e-3, 1e-3]), None))[0] / 2e-3
    assert variance[middle] == pytest.approx(0.01 / slope**2, rel=0.1)
    assert variance[-1] > variance[middle]
    with pytest.raises(ModelError, match="ascending"):
        effect_of("empirical_map")((0.0, 1.0), (1.0, 0.0), (0.0, 0.0))


@pytest.mark.long
def test_part_of_an_extended_model_and_of_its_correction_but_no_finding():
    def sensor(s):
        return oscillator(s, 300.0, 0.6)
    reference, _, measured = bent(5, of_sensor=sensor)
    used = SensorModel.from_dict({**GAIN, "core": {"natural_frequency_hz": 300.0,
                                                   "damping_ratio": 0.6}})
    found = diagnose(samples(reference, measured), used, time_limit_s=120)
    assert "empirical_map" not in [finding.cause for finding in found.findings]
    assert found.verdict in ("unexplained", "partly_explained")
    own = found.model.axis("x").effects
    assert "empirical_map" in [effect.cause for effect in own]
    assert "fitted curve" in found.reason
    assert found.extended["rmse"] < 0.3 * found.baseline["rmse"]
    again = SensorModel.from_dict(found.model.to_dict())
    errors = []
    for model in (used, again):
        raw = samples(reference, measured)[1]
        done = Corrector(model, sample_rate_hz=RATE, bandwidth_hz=150.0).process(*raw[:3])
        errors.append(np.std((done.values[:, 0] - reference[done.index])[500:-500]))
    assert errors[1] < 0.4 * errors[0]
