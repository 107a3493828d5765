"""`simulate` agrees with the independent simulator to 1e-3 of the signal's RMS."""

import numpy as np
import pytest
import rig
from random_models import draw_sensor, model_of

from frac_accel import simulate
from frac_accel.errors import FracAccelError, ModelError
from frac_accel.model import SensorModel

REQUIRED = 1e-3
RATE = 1000.0
TOP = 0.3 * RATE  # 0.6 of the Nyquist frequency


def relative_error(sensor, excitation, skip=0):
    """Worst over the axes that move: RMS of the difference over RMS of the rig's output."""
    record = rig.simulate_record(sensor, excitation)
    simulated = simulate(model_of(sensor), record.reference, excitation.rate_hz)
    difference = np.sqrt(np.mean((simulated - record.sensor)[skip:]**2, axis=0))
    return np.max(difference / np.sqrt(np.mean(record.sensor[skip:]**2, axis=0)))


def oscillator(natural_frequency_hz, damping_ratio, damping_order, effects=None):
    return rig.Sensor({"type": "oscillator", "natural_frequency_hz": natural_frequency_hz,
                       "damping_ratio": damping_ratio, "damping_order": damping_order,
                       "sensitivity": 1.3}, effects or {})


def random_case(seed):
    """Sensor, and noise from rest up to 0.6 of the Nyquist frequency; also for sweeps."""
    rng = np.random.default_rng([1, seed])
    sensor = draw_sensor(rng, RATE, own_axes=0.3)
    low = RATE * 10 ** rng.uniform(-3, -1)
    return sensor, rig.noise_bursts(rng, RATE, 2.0, (low, TOP), [1, 3, 2])


@pytest.mark.parametrize("seed", range(12))
def test_random_sensors_from_rest(seed):
    assert relative_error(*random_case(seed)) < REQUIRED


@pytest.mark.parametrize("order", [0.3, 1.0, 1.7])
@pytest.mark.parametrize("ratio", [0.01, 0.7])
@pytest.mark.parametrize("natural", [5.0, 150.0, 295.0])
def test_resonance_within_the_band(natural, ratio, order):
    excitation = rig.noise_bursts(np.random.default_rng(2), RATE, 2.0, (2.0, TOP), [2, 1],
                                  (1, 0, 0))
    sensor = oscillator(natural, ratio, order)
    record = rig.simulate_record(sensor, excitation)
    simulated = simulate(model_of(sensor), record.reference[:, 0], RATE, axis="x")
    error = np.std(simulated - record.sensor[:, 0]) / np.std(record.sensor[:, 0])
    assert error < REQUIRED


@pytest.mark.parametrize("cause", ["sensitivity_error", "offset", "time_delay", "ac_coupling",
                                   "low_pass_lag", "mounting_resonance", "fractional_damping",
                                   "cross_axis_sensitivity"])
def test_each_effect(cause):
    rng = np.random.default_rng(3)
    sensor = rig.draw_sensor(rng, RATE, "classical", [cause], natural_frequency=(0.1, 0.2))
    excitation = rig.noise_bursts(rng, RATE, 2.0, (2.0, TOP), [1, 2])
    assert relative_error(sensor, excitation) < REQUIRED


@pytest.mark.parametrize("order", [0.5, 1.0, 1.5])
def test_record_in_mid_motion_after_a_warm_up(order):
    """The motion before the record is unknown to `simulate`: its trace fades with the resonance."""
    natural, ratio = 60.0, 0.1
    sensor = oscillator(natural, ratio, order)
    excitation = rig.band_noise(np.random.default_rng(4), RATE, 4.0, (20.0, TOP), lead_s=2.0)
    pole = model_of(sensor).axes[0].effective_core.poles()
    warm_up_s = 12 / np.min(np.abs(pole.real))
    assert warm_up_s < 2.0
    assert relative_error(sensor, excitation, skip=int(warm_up_s * RATE)) < REQUIRED


@pytest.mark.parametrize("order", [0.4, 1.0, 1.6])
def test_steady_start_under_gravity(order):
    """A sensor that has felt gravity for ever, and then moves: known by linearity."""
    sensor = oscillator(80.0, 0.3, order, {"offset": {"offset": 0.2},
                                           "time_delay": {"delay_s": 0.0016}})
    excitation = rig.noise_bursts(np.random.default_rng(5), RATE, 2.0, (2.0, TOP), [1, 2])
    record = rig.simulate_record(sensor, excitation)
    gravity = np.array([0.0, 3.0, 9.81])
    simulated = simulate(model_of(sensor), record.reference + gravity, RATE, initial="steady")
    expected = record.sensor + 1.3 * gravity
    assert np.max(np.abs(simulated - expected)) < REQUIRED * np.std(record.sensor)


def test_gravity_does_not_pass_a_high_pass():
    sensor = oscillator(80.0, 0.3, 1.4, {"ac_coupling": {"corner_hz": 2.0}})
    still = np.tile([0.0, 0.0, 9.81], (500, 1))
    assert np.max(np.abs(simulate(model_of(sensor), still, RATE, initial="steady"))) < 1e-12


def test_early_stamps():
    """A negative delay: the value stamped t belongs to a later instant."""
    rng = np.random.default_rng(6)
    excitation = rig.noise_bursts(rng, RATE, 2.0, (2.0, TOP), [1, 2])
    late, early = (simulate(model_of(oscillator(80.0, 0.3, 1.2, {"time_delay": {"delay_s": d}})),
                            excitation.reference, RATE) for d in (0.002, -0.003))
    # five samples lie between the two
    assert np.max(np.abs(late[5:] - early[:-5])) < 1e-4 * np.std(late)


def test_long_fractional_record():
    """1e5 samples with a pole and with memory, to the last of them."""
    model = model_of(oscillator(0.05 * RATE, 0.02, 0.5))
    t = np.arange(100_000) / RATE
    f = 0.02 * RATE
    ramp = np.minimum(1, t / 0.5)**3
    reference = ramp * np.sin(2 * np.pi * f * t)
    simulated = simulate(model, reference, RATE, axis="z")
    response = model.frequency_response(f, "z")
    steady = np.abs(response) * np.sin(2 * np.pi * f * t + np.angle(response))
    late = t > 90
    assert np.max(np.abs(simulated - steady)[late]) < 1e-4 * np.abs(response)


def test_one_column_needs_its_axis_and_takes_that_axis_model():
    data = oscillator(80.0, 0.3, 1.0).to_model()
    data["axes"] = {"y": {"effects": [{"cause": "sensitivity_error", "gain": 2.0}]}}
    model = SensorModel.from_dict(data)
    reference = np.sin(np.arange(300.0) / 9)
    x, y = (simulate(model, reference, RATE, axis=axis) for axis in "xy")
    np.testing.assert_allclose(y, 2 * x, rtol=1e-12)
    with pytest.raises(FracAccelError, match="axis"):
        simulate(model, reference, RATE)


@pytest.mark.parametrize("reference, rate, message", [
    (np.empty((0, 3)), RATE, "shape"),
    (np.zeros((5, 2)), RATE, "shape"),
    (np.full((5, 3), np.nan), RATE, "sample 0 is not finite"),
    (np.zeros((5, 3)), 0.0, "sampling_rate_hz"),
    (np.zeros((5, 3)), np.nan, "sampling_rate_hz"),
    (np.zeros((5, 3)), -1.0, "sampling_rate_hz"),
])
def test_bad_records_are_named(reference, rate, message):
    with pytest.raises(FracAccelError, match=message):
        simulate(model_of(oscillator(80.0, 0.3, 1.0)), reference, rate)


def test_unknown_initial_state_or_axis():
    model = model_of(oscillator(80.0, 0.3, 1.0))
    with pytest.raises(FracAccelError, match="initial"):
        simulate(model, np.zeros((5, 3)), RATE, initial="stedy")
    with pytest.raises(FracAccelError, match="axis"):
        simulate(model, np.zeros(5), RATE, axis="w")


def test_arx_only_at_its_own_rate_or_below():
    sensor = rig.Sensor({"type": "arx", "numerator": [0.5], "denominator": [1.0, -0.5],
                         "sampling_rate_hz": RATE})
    with pytest.raises(ModelError, match="1000 Hz"):
        simulate(model_of(sensor), np.zeros((5, 3)), 2 * RATE)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_very_short_records(n):
    model = model_of(oscillator(80.0, 0.3, 0.6, {"ac_coupling": {"corner_hz": 2.0}}))
    assert np.isfinite(simulate(model, np.ones((n, 3)), RATE)).all()
