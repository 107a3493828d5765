"""Every cause that can be simulated is taken out again, live, and what cannot be known is said.

The records come from the independent simulator.
"""

import numpy as np
import pytest
import rig
from random_models import model_of

from frac_accel import Corrector, LiveSimulator, simulate
from frac_accel.errors import DesignError
from frac_accel.model import SensorModel
from frac_accel.signals.metrics import error_metrics, interpolate

pytestmark = pytest.mark.long

RATE = 1000.0
SPRING = ("cubic_stiffness", "quadratic_stiffness", "hysteresis")
KNOWN = ("core_parameter_shift", "clock_skew", "gain_drift", "temperature_sensitivity")
EASY = {"natural_frequency": (0.1, 0.3), "damping_ratio": (0.1, 0.7)}
ONE_AXIS = (1, 0, 0)


class Case:
    """A record of one random sensor, and what correctors with and without the cause make of it."""

    def __init__(self, seed, causes, kind="classical", duration_s=3.0, snr_db=80.0, core=(),
                 **ranges):
        rng = np.random.default_rng([7, seed])
        sensor = rig.draw_sensor(rng, RATE, kind, causes, level=1.5, **{**EASY, **ranges})
        self.sensor = rig.Sensor({**sensor.core, **dict(core)}, sensor.effects)
        self.model = model_of(self.sensor)
        low, high = Corrector(self.model, RATE).design.axes[0].band_hz
        self.band = max(2 * low, 3.0), 0.9 * high
        excitation = rig.band_noise(rng, RATE, duration_s, self.band, ONE_AXIS, lead_s=0.5)
        self.record = rig.simulate_record(self.sensor, excitation, rng, snr_db)

    def without(self, *causes):
        kept = {cause: value for cause, value in self.sensor.effects.items() if cause not in causes}
        return model_of(rig.Sensor(self.sensor.core, kept))

    def corrected(self, model):
        """Error, truth and variance along x, and the corrector."""
        record = self.record
        corrector = Corrector(model, RATE)
        variance = np.tile(record.noise_std**2, (len(record.sensor), 1))
        parts = []
        for start in range(0, len(record.sensor), 100):
            part = slice(start, start + 100)
            corrector.set_temperature(record.temperature_c[part].mean())
            parts.append(corrector.process(record.sensor_stamps_ns[part], record.sensor[part],
                                           variance[part]))
        stamps, values, variance = (np.concatenate([getattr(part, name) for part in parts])
                                    for name in ("stamps_ns", "values", "variance"))
        truth = interpolate(record.stamps_ns, record.reference, stamps, RATE)
        usable = np.isfinite(truth[:, 0])
        return (values - truth)[usable, 0], truth[usable, 0], variance[usable, 0], corrector

    def nrmse(self, model):
        error, truth, _, _ = self.corrected(model)
        return error_metrics(truth, truth + error, RATE, [self.band]).total.nrmse


@pytest.mark.parametrize("kind", ["classical", "fractional"])
@pytest.mark.parametrize("cause", SPRING)
def test_nonlinear_spring_is_taken_out(cause, kind):
    case = Case(len(cause), [cause], kind)
    with_it, without = case.nrmse(case.model), case.nrmse(case.without(cause))
    assert with_it < 3e-3
    assert with_it < 0.1 * without


@pytest.mark.parametrize("link", ["mounting_resonance", "low_pass_lag", "ac_coupling"])
def test_also_behind_and_before_a_link(link):
    case = Case(1, ["cubic_stiffness", link])
    with_it, without = case.nrmse(case.model), case.nrmse(case.without("cubic_stiffness"))
    assert with_it < 3e-3
    assert with_it < 0.1 * without


@pytest.mark.parametrize("seed", range(2))
def test_friction_is_taken_out_as_far_as_the_mass_moves(seed):
    case = Case(seed, ["coulomb_friction"])
    assert case.nrmse(case.model) < 0.15 * case.nrmse(case.without("coulomb_friction"))


@pytest.mark.parametrize("cause", KNOWN)
def test_what_changes_parameters_gain_or_clock_leaves_no_trace(cause):
    case = Case(2, [cause], duration_s=6.0)
    assert case.nrmse(case.model) < 1e-3
    assert case.nrmse(case.without(cause)) > 1e-2


def test_dead_zone_is_opened_again():
    case = Case(3, ["dead_zone"])
    assert case.nrmse(case.model) < 0.3 * case.nrmse(case.without("dead_zone"))


def test_tone_of_unknown_phase_is_found_and_taken_out():
    case = Case(4, ["tone_interference"], duration_s=20.0)
    error, truth, variance, _ = case.corrected(case.model)
    late = slice(len(error) // 2, None)
    before = case.corrected(case.without("tone_interference"))[0]
    # what is left is the motion's own part in the tone's band
    assert np.std(error[late]) < 0.5 * np.std(before[late])
    assert np.mean(np.abs(error) < 2 * np.sqrt(variance)) > 0.8


@pytest.mark.parametrize("cause, least", [("quantization", 0.9), ("clipping", 0.9)])
def test_what_is_lost_shows_in_the_variance(cause, least):
    """Where samples were clipped or rounded, two standard deviations hold the error."""
    case = Case(5, [cause], snr_db=50.0)
    error, _, variance, corrector = case.corrected(case.model)
    known = case.corrected(case.without(cause))[2]
    hit = variance > 1.5 * known
    assert hit.sum() > 100
    assert np.mean(np.abs(error[hit]) < 2 * np.sqrt(variance[hit])) > least
    if cause == "clipping":
        limits = case.sensor.effects["clipping"]
        x = case.record.sensor[:, 0]
        assert corrector.counters["clipped"] == np.sum((x == limits["lower"])
                                                       | (x == limits["upper"]))


def test_clipping_is_seen_behind_a_rounding():
    """The rounding moves the limits inwards; the counter follows."""
    model = sensor_of([{"cause": "clipping", "lower": -1.04, "upper": 1.04},
                       {"cause": "quantization", "step": 0.1}])
    corrector = Corrector(model, RATE)
    values = np.zeros((400, 3))
    values[200:210, 1] = 1.0
    values[300, 2] = -1.0
    corrector.process(np.arange(400) * 1_000_000, values)
    assert corrector.counters["clipped"] == 11


@pytest.mark.parametrize("snr_db", [50.0, 80.0])
def test_stuck_mass_shows_in_the_variance(snr_db):
    """While friction holds the mass, the acceleration is known to the Coulomb level only."""
    stiff = {"natural_frequency_hz": 280.0, "damping_ratio": 0.7}
    case = Case(6, ["coulomb_friction"], core=stiff.items(), snr_db=snr_db)
    error, _, variance, _ = case.corrected(case.model)
    assert np.mean(np.abs(error) < 2 * np.sqrt(variance)) > 0.95
    assert np.mean(variance) < 2**2 * np.mean(error**2)


def sensor_of(effects, **core):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "effects": effects,
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.3, **core}})


def test_without_a_temperature_the_doubt_shows():
    """25 degrees are assumed, with 35 K of uncertainty; a value ends that and is held."""
    model = sensor_of([{"cause": "temperature_sensitivity", "coefficient_per_k": 2e-3}])
    corrector = Corrector(model, RATE)
    stamps, values = np.arange(2000) * 1_000_000, np.full((2000, 3), 5.0)
    before = corrector.process(stamps[:1000], values[:1000], np.full((1000, 3), 1e-6))
    corrector.set_temperature(45.0)
    corrector.set_temperature(np.nan)
    after = corrector.process(stamps[1000:], values[1000:], np.full((1000, 3), 1e-6))
    assert corrector.counters["without_temperature"] == 1000
    np.testing.assert_allclose(before.values, 5.0, rtol=3e-3)
    np.testing.assert_allclose(after.values[500:], 5.0 / 1.04, rtol=3e-3)
    gain = corrector.design.axes[0].noise_gain
    np.testing.assert_allclose(np.sqrt(before.variance[-1]), gain * np.hypot(1e-3, 5.0 * 0.07),
                               rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(after.variance[-1]), gain * 1e-3 / 1.04, rtol=1e-6)


def test_live_simulator_plays_the_effects_on_samples_and_clock():
    """As offline, but for the filter's own error; the skew is in the stamps."""
    effects = [{"cause": "gain_drift", "rate_per_s": 0.05},
               {"cause": "temperature_sensitivity", "coefficient_per_k": 1e-3},
               {"cause": "tone_interference", "frequency_hz": 50.0, "amplitude": 0.3},
               {"cause": "dead_zone", "half_width": 0.05},
               {"cause": "quantization", "step": 1e-3}]
    rng = np.random.default_rng(8)
    reference = rig.noise_bursts(rng, RATE, 3.0, (2.0, 200.0), [1, 2]).reference
    stamps = 10**9 + np.arange(len(reference)) * 1_000_000
    kernel = LiveSimulator(sensor_of([*effects, {"cause": "clock_skew", "skew_ppm": 100.0}]), RATE)
    kernel.set_temperature(30.0)
    played = kernel.process(stamps, reference)
    expected = simulate(sensor_of(effects), reference, RATE, temperature_c=30.0)[played.index]
    assert np.std(played.values - expected) < 5e-3 * np.std(expected)
    sensor_time = (played.stamps_ns - stamps[0]) * (1 + 1e-4)
    assert np.max(np.abs(sensor_time - played.index * 1e6)) < 2


def test_what_cannot_be_done_live_is_refused():
    cubic = {"cause": "cubic_stiffness", "alpha3": 0.01}
    with pytest.raises(DesignError, match="played live"):
        LiveSimulator(sensor_of([cubic]), RATE)
    with pytest.raises(DesignError, match="nonlinear terms need a delay"):
        Corrector(sensor_of([cubic]), RATE, max_delay_s=0.009)
    with pytest.raises(DesignError, match="clock's rate differs"):
        Corrector(SensorModel.from_dict({
            "schema": "frac_accel/sensor_model/1",
            "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.3},
            "axes": {"x": {"effects": [{"cause": "clock_skew", "skew_ppm": 10.0}]}}}), RATE)


def test_drift_goes_on_where_a_clock_is_set_back():
    model = sensor_of([{"cause": "gain_drift", "rate_per_s": 0.1}])
    corrector = Corrector(model, RATE)
    stamps = np.arange(4000) * 1_000_000 + 10**12
    stamps[2000:] -= 60 * 10**9
    values = np.full((4000, 3), 2.0) * (1 + 0.1e-3 * np.arange(4000))[:, None]
    result = corrector.process(stamps, values)
    assert corrector.counters["restarts"] == 1
    np.testing.assert_allclose(result.values, 2.0, rtol=3e-3)
