"""Every effect can be simulated and inverted, and the two undo each other."""

import numpy as np
import pytest
import rig
from random_models import model_of

from frac_accel import Corrector, simulate
from frac_accel.errors import FracAccelError
from frac_accel.model import SensorModel
from frac_accel.model.effects import Circumstances, known_effects
from frac_accel.signals.metrics import interpolate

RATE = 1000.0
LINEAR = ("sensitivity_error", "time_delay", "ac_coupling", "low_pass_lag", "mounting_resonance",
          "fractional_damping")
ON_SAMPLES = ("offset", "cross_axis_sensitivity")
NONLINEAR = ("cubic_stiffness", "quadratic_stiffness", "coulomb_friction", "hysteresis")
CORE = ("core_parameter_shift",)
IN_TIME = ("clock_skew", "gain_drift", "temperature_sensitivity", "tone_interference")
# in test_changes_in_time
CHANGING = ("offset_drift", "warm_up_drift", "thermal_offset", "offset_step", "gain_step",
            "time_step")
LOSSY = ("clipping", "dead_zone", "quantization", "dropped_samples", "timestamp_jitter")

# in test_further_forces
FORCES = ("stiffness_drift", "quadratic_damping", "impact_stop")
# in test_misalignment
TURNED = ("misalignment",)
# in test_backlash
PATH = ("backlash",)
# in test_residual_causes
BY_POWER = ("sampling_jitter", "polled_readout", "interference_bursts")

# in test_linear_causes
LINKS = ("second_resonance", "low_pass_filter", "linear_phase_filter")
# in test_reference_faults
OF_REFERENCE = ("reference_ac_coupling", "reference_delay", "reference_low_pass",
                "reference_smoothing")
# in test_reference_noise and test_free_mass
NOISE_AND_FRICTION = ("reference_noise", "free_mass_friction")
# in test_empirical_link and test_empirical_map
FITTED = ("empirical_link", "empirical_map")


def test_every_effect_of_this_package_is_tested_here():
    ours = {cause for cause, effect in known_effects().items()
            if effect.__module__.startswith("frac_accel.")}
    assert ours == {*LINEAR, *ON_SAMPLES, *NONLINEAR, *CORE, *IN_TIME, *LOSSY,
                    *CHANGING, *FORCES, *TURNED,
                    *BY_POWER, *PATH, *LINKS, *OF_REFERENCE,
                    *NOISE_AND_FRICTION, *FITTED}


@pytest.mark.parametrize("cause", rig.CAUSES)
def test_effect_explains_itself(cause):
    effect = known_effects()[cause]
    assert effect.cause == cause
    assert effect.explanation.endswith(".") and effect.__doc__


@pytest.mark.parametrize("seed", range(5))
def test_sample_effects_are_undone_to_rounding(seed):
    rng = np.random.default_rng(seed)
    sensor = rig.draw_sensor(rng, RATE, "classical", ON_SAMPLES)
    model = model_of(rig.Sensor(sensor.core, sensor.effects, {"y": {"effects": {
        "offset": {"offset": 3.0}}}}))
    values = rng.normal(size=(500, 3))
    affected = model.live_simulation(RATE)(values, Circumstances.at_rest(500))
    assert np.max(np.abs(affected - values)) > 0.01
    restored, _ = model.live_inverse(RATE)(affected, np.zeros_like(affected),
                                              Circumstances.at_rest(500))
    np.testing.assert_allclose(restored, values, atol=1e-13)


def test_sample_effects_by_hand():
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 100.0, "damping_ratio": 0.5},
        "axes": {"x": {"effects": [{"cause": "cross_axis_sensitivity", "y": 0.02, "z": -0.01},
                                   {"cause": "offset", "offset": 0.5}]}}})
    affected = model.live_simulation(RATE)(np.array([[1.0, 10.0, 100.0]]), Circumstances.at_rest(1))
    np.testing.assert_allclose(affected, [[1.0 + 0.2 - 1.0 + 0.5, 10.0, 100.0]])


def test_input_is_left_as_it_was():
    model = model_of(rig.draw_sensor(np.random.default_rng(0), RATE, "classical", ON_SAMPLES))
    values = np.ones((5, 3))
    there = Circumstances.at_rest(5)
    model.live_inverse(RATE)(model.live_simulation(RATE)(values, there), np.zeros((5, 3)), there)
    np.testing.assert_array_equal(values, np.ones((5, 3)))


@pytest.mark.parametrize("cause", [*LINEAR, *ON_SAMPLES])
@pytest.mark.parametrize("seed", range(2))
def test_simulated_and_corrected_is_the_reference(cause, seed):
    """Each effect around a sensor, in band, to the design's tolerance; the stamps say when."""
    rng = np.random.default_rng([seed, len(cause)])
    sensor = rig.draw_sensor(rng, RATE, "classical", [cause], natural_frequency=(0.15, 0.3),
                             damping_ratio=(0.1, 0.7))
    model = model_of(sensor)
    corrector = Corrector(model, RATE)
    low = max(axis.band_hz[0] for axis in corrector.design.axes)
    high = min(axis.band_hz[1] for axis in corrector.design.axes)
    reference = rig.noise_bursts(rng, RATE, 8.0, (max(2 * low, 1.0), 0.95 * high),
                                 [1, 2]).reference
    stamps_ns = np.arange(len(reference)) * 1_000_000
    corrected = corrector.process(stamps_ns, simulate(model, reference, RATE))
    expected = interpolate(stamps_ns, reference, corrected.stamps_ns, RATE)
    usable = np.isfinite(expected).all(axis=1)
    assert usable.sum() > 7000
    error = np.sqrt(np.mean((corrected.values - expected)[usable]**2, axis=0))
    assert np.max(error / np.std(expected[usable], axis=0)) < 3e-3


def test_cross_axis_that_makes_the_axes_one_is_refused():
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 100.0, "damping_ratio": 0.5},
        "effects": [{"cause": "cross_axis_sensitivity", "x": 1.0, "y": 1.0, "z": 1.0}]})
    with pytest.raises(FracAccelError, match="cross_axis_sensitivity"):
        model.live_inverse(RATE)(np.zeros((2, 3)), np.zeros((2, 3)), Circumstances.at_rest(2))
