"""What the design of an inverse states is true for any model; what it refuses, it explains."""

import re

import numpy as np
import pytest
from random_models import draw_sensor, model_of
from scipy.signal import lfilter

from frac_accel import design_inverse
from frac_accel.correction.design import TOLERANCE, design_simulator, plateau, reference_gain
from frac_accel.errors import DesignError, FracAccelError
from frac_accel.model import SensorModel
from frac_accel.model.core import Arx
from frac_accel.signals.parallel_filter import FilterState

ZERO = 1.01e-9  # frequency, as a share of the sampling rate, that stands for zero


def run(parallel_filter, values, level=0.0):
    """One row of samples through a filter."""
    return FilterState(parallel_filter, np.array([level])).process(values[None])[0]


def oscillator(natural_frequency_hz=300.0, damping_ratio=0.1, damping_order=1.0, effects=()):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": natural_frequency_hz, "damping_ratio": damping_ratio,
                 "damping_order": damping_order},
        "effects": list(effects)})


def random_case(seed):
    """Model, sampling rate and wishes; also for sweeps over more seeds."""
    rng = np.random.default_rng([3, seed])
    rate = float(rng.choice([100.0, 2000.0, 1e6]))
    sensor = draw_sensor(rng, rate, own_axes=0.4, natural_frequency=(0.005, 0.45))
    for effects in (sensor.effects, *(own["effects"] for own in sensor.axes.values())):
        if "time_delay" in effects and rng.random() < 0.4:
            effects["time_delay"]["delay_s"] *= -1
    for core in (sensor.core, *(own["core"] for own in sensor.axes.values())):
        if core["type"] == "arx" and rng.random() < 0.3:  # not of minimum phase
            zero = rng.choice([-1, 1]) * rng.uniform(1.05, 3)
            core["numerator"] = list(np.array([1.0, -zero]) / abs(1 - zero) * core["numerator"][0])
    wishes = {}
    if rng.random() < 0.3:
        wishes["bandwidth_hz"] = rate * rng.uniform(0.02, 0.47)
    if rng.random() < 0.2:
        wishes["lowest_hz"] = rate * rng.uniform(0.0005, 0.01)
    if rng.random() < 0.3:
        wishes["max_delay_s"] = rng.uniform(0.1, 30) / rate
    return model_of(sensor), rate, wishes


def end_to_end(design, axis, frequency_hz):
    """Response from acceleration to corrected sample, at the stamp that the sample gets."""
    filtered = design.axes["xyz".index(axis)].filter.frequency_response(
        frequency_hz, design.sampling_rate_hz)
    delay_s = design.delay_samples / design.sampling_rate_hz + design.sensor_delay_ns * 1e-9
    return (design.model.frequency_response(frequency_hz, axis) * filtered
            * np.exp(2j * np.pi * frequency_hz * delay_s))


def check_statements(design):
    rate = design.sampling_rate_hz
    for name, axis in zip("xyz", design.axes):
        low, high = axis.band_hz
        frequency = np.unique(np.r_[np.linspace(low or ZERO * rate, high, 9973),
                                    np.geomspace(low or ZERO * rate, high, 5003)])
        response = end_to_end(design, name, frequency)
        # the design's own grid is coarser: its maxima may lie a little lower
        assert np.max(np.abs(np.abs(response) - 1)) <= 1.02 * axis.amplitude_error + 1e-9
        phase = np.degrees(np.max(np.abs(np.angle(response))))
        assert phase <= 1.02 * axis.phase_error_deg + 1e-7
        assert np.max(np.abs(axis.filter.poles), initial=0) < 1
        own = design.sensor_delay_ns * 1e-9 - design.model.axes["xyz".index(name)].delay_s
        assert abs(axis.delay_s - design.delay_samples / rate - own) < 2e-9


@pytest.mark.parametrize("seed", [*range(20), 40, 62, 175])  # the last cancel by eight digits
def test_taps_and_chains_are_the_stated_filter(seed):
    """In the time domain, against the sum over the poles in extended precision."""
    model, rate, wishes = random_case(seed)
    try:
        stated = design_inverse(model, rate, **wishes).axes[0].filter
    except FracAccelError:
        return
    rng = np.random.default_rng(seed)
    values = 5.0 + 0.1 * np.cumsum(rng.normal(size=3000))
    delayed = np.r_[np.full(stated.lead, values[0]), values][:len(values)].astype(np.longdouble)
    expected = np.convolve(np.r_[np.full(len(stated.taps) - 1, values[0]), delayed],
                           stated.taps.astype(np.longdouble), "valid")
    for pole, residue in zip(stated.poles.astype(np.clongdouble), stated.residues):
        output, part = delayed[0] / (1 - pole), np.empty(len(values), np.clongdouble)
        for i, value in enumerate(delayed):
            output = part[i] = pole * output + value
        expected += (residue * part).real
    error = run(stated, values, values[0]) - expected.astype(float)
    assert np.max(np.abs(error)) < 1e-5 * np.max(np.abs(expected))


@pytest.mark.parametrize("seed", range(40))
def test_random_models_true_statements_or_a_refusal_that_helps(seed):
    model, rate, wishes = random_case(seed)
    try:
        design = design_inverse(model, rate, **wishes)
    except DesignError as error:
        offers = suggestions(str(error))
        assert offers
        for offer in offers:
            design = design_inverse(model, rate, **{**wishes, **offer})
        wishes |= offer
    check_statements(design)
    tolerance = wishes.get("tolerance", TOLERANCE)
    for axis in design.axes:
        assert axis.amplitude_error <= tolerance
        assert np.radians(axis.phase_error_deg) <= tolerance
        assert axis.band_hz[1] == wishes.get("bandwidth_hz", axis.band_hz[1])
        assert axis.band_hz[0] == wishes.get("lowest_hz", axis.band_hz[0])
    if "max_delay_s" in wishes:
        assert design.delay_samples / rate <= wishes["max_delay_s"] * (1 + 1e-6)


def suggestions(message):
    """Wishes that a refusal names, each by itself."""
    needed = re.search(r"needs a delay of (\S+) s", message)
    if needed:
        return [{"max_delay_s": float(needed[1])}]
    return [{name: float(value)} for name, value in re.findall(r"(\w+)=(\S+)", message)]


@pytest.mark.parametrize("seed", range(0, 40, 8))
def test_noise_gain_by_impulse_response_and_by_monte_carlo(seed):
    model, rate, _ = random_case(seed)
    design = design_inverse(model, rate)
    rng = np.random.default_rng(seed)
    for axis in design.axes:
        settled = 40 * len(axis.filter.taps)
        ring = run(axis.filter, np.r_[1.0, np.zeros(400_000)])
        slowest = np.max(np.abs(axis.filter.poles), initial=0.0)
        energy = np.sqrt(np.sum(ring**2))
        # what rings on after the record belongs to the gain but not to the sum
        assert energy <= axis.noise_gain * (1 + 1e-6)
        if slowest**400_000 < 1e-6:
            assert abs(energy / axis.noise_gain - 1) < 1e-4
        noise = run(axis.filter, rng.normal(size=400_000))[settled:]
        if slowest**settled < 1e-3:
            assert abs(np.std(noise) / axis.noise_gain - 1) < 0.1


@pytest.mark.parametrize("seed", range(0, 40, 8))
def test_running_filter_has_the_response_that_was_designed(seed):
    """Steady sines through the recursion: rounding in it must not spoil slow poles."""
    model, rate, _ = random_case(seed)
    design = design_inverse(model, rate)
    for axis in design.axes:
        low, high = axis.band_hz
        f = rate * round(0.7 * high / rate * 1000) / 1000
        n = np.arange(300_000)
        output = run(axis.filter, np.exp(2j * np.pi * f / rate * n).real)
        last = n >= 299_000
        fit = 2 * np.mean(output[last] * np.exp(-2j * np.pi * f / rate * n[last]))
        trend = np.mean(output[last])
        expected = axis.filter.frequency_response(f, rate)
        assert abs(fit - expected) < 1e-4 * abs(expected) + 1e-2 * abs(trend)


@pytest.mark.parametrize("order", [0.4, 1.0, 1.6])
def test_level_for_ever_is_kept_to_rounding(order):
    """A constant through a filter that starts in its steady state, and its static gain."""
    design = design_inverse(oscillator(damping_order=order), 2000.0)
    level = run(design.axes[0].filter, np.full(100_000, 9.81), 9.81)
    assert np.ptp(level) < 1e-6
    assert abs(level[0] / 9.81 - design.axes[0].filter.static_gain) < 1e-6
    assert abs(design.axes[0].filter.static_gain - 1) < TOLERANCE


def test_default_delay_is_within_four_periods_and_noise_near_that_of_a_brick_wall():
    for order in (0.5, 1.0, 1.5):
        model = oscillator(400.0, 0.2, order)
        design = design_inverse(model, 2000.0)
        low, high = design.axes[0].band_hz
        assert design.delay_samples <= np.ceil(4 * 2000.0 / high)
        f = np.linspace(ZERO, high, 20_001)
        ideal = np.sqrt(np.mean(1 / np.abs(model.frequency_response(f))**2) * high / 1000.0)
        assert design.axes[0].noise_gain < 1.6 * ideal


def test_shorter_delay_costs_noise_and_is_kept():
    model = oscillator(300.0, 0.1, 0.6)
    designs = [design_inverse(model, 2000.0, bandwidth_hz=400, max_delay_s=d * 1e-3)
               for d in (2, 4, 8, 16)]
    assert [d.delay_samples <= limit for d, limit in zip(designs, (4, 8, 16, 32))] == [True] * 4
    gains = [d.axes[0].noise_gain for d in designs]
    assert gains == sorted(gains, reverse=True)


def test_narrower_tolerance_is_met():
    for tolerance in (1e-2, 1e-3, 1e-4):
        design = design_inverse(oscillator(300.0, 0.05, 1.4), 2000.0, tolerance=tolerance)
        check_statements(design)
        assert design.axes[0].amplitude_error <= tolerance


def test_axes_with_different_delays_share_one_stamp():
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 300.0, "damping_ratio": 0.2},
        "axes": {name: {"effects": [{"cause": "time_delay", "delay_s": delay_s}]}
                 for name, delay_s in (("x", 0.01234567891), ("y", -0.0031), ("z", 0.0))}})
    design = design_inverse(model, 1e5, bandwidth_hz=500.0)
    assert abs(design.sensor_delay_ns - 12_345_679) <= 1
    check_statements(design)


@pytest.mark.parametrize("wishes, message", [
    ({"bandwidth_hz": 999.0}, "bandwidth_hz: 999 given, expected below 950"),
    ({"bandwidth_hz": 1e6}, "bandwidth_hz"),
    ({"bandwidth_hz": 0.0}, "bandwidth_hz: 0.0 given, expected a number above 0"),
    ({"bandwidth_hz": float("nan")}, "bandwidth_hz"),
    ({"bandwidth_hz": "wide"}, "bandwidth_hz: 'wide' given"),
    ({"max_delay_s": -1.0}, "max_delay_s: -1.0 given"),
    ({"lowest_hz": 700.0}, "the band from 700 Hz"),
    ({"tolerance": 0.0}, "tolerance: 0.0 given"),
])
def test_impossible_wishes_are_named(wishes, message):
    with pytest.raises(FracAccelError, match=message):
        design_inverse(oscillator(), 2000.0, **wishes)


@pytest.mark.parametrize("rate", [0, -5.0, float("inf"), float("nan")])
def test_bad_rates_are_named(rate):
    with pytest.raises(FracAccelError, match="sampling_rate_hz"):
        design_inverse(oscillator(), rate)


def test_a_zero_next_to_zero_hertz_is_avoided_by_a_higher_lowest_frequency():
    """As of a model that was identified in z, whose static gain is open: a bandwidth helps none."""
    model = SensorModel(Arx((-0.999, 1.0), (1.0, -0.5), 200.0))
    with pytest.raises(DesignError, match="it can with lowest_hz=") as refusal:
        design_inverse(model, 200.0, bandwidth_hz=20.0)
    assert "bandwidth_hz" not in str(refusal.value)
    offer, = suggestions(str(refusal.value))
    design_inverse(model, 200.0, bandwidth_hz=20.0, **offer)


def test_sensor_without_gain_or_band():
    with pytest.raises(DesignError, match="gain is zero"):
        design_inverse(oscillator(effects=[{"cause": "sensitivity_error", "gain": 0.0}]), 2000.0)
    with pytest.raises(DesignError, match="higher sampling rate"):
        design_inverse(oscillator(effects=[{"cause": "ac_coupling", "corner_hz": 1e5}]), 2000.0)


@pytest.mark.parametrize("seed", range(6))
def test_live_simulator_filters_are_true_too(seed):
    model, rate, _ = random_case(seed)
    design = design_simulator(model, rate)
    for name, axis in zip("xyz", design.axes):
        frequency = np.unique(np.r_[np.linspace(ZERO * rate, 0.3 * rate, 9973),
                                    np.geomspace(ZERO * rate, 0.3 * rate, 5003)])
        expected = model.frequency_response(frequency, name)
        played = (axis.filter.frequency_response(frequency, rate)
                  * np.exp(2j * np.pi * frequency * design.delay_samples / rate))
        size = np.maximum(np.abs(expected), 0.01 * reference_gain(model.axis(name)))
        assert np.max(np.abs(played - expected) / size) <= 1.02 * TOLERANCE


def test_recursion_alone_equals_scipy_for_a_known_filter():
    design = design_inverse(oscillator(damping_order=1.5), 2000.0)
    axis = design.axes[0]
    x = np.random.default_rng(0).normal(size=3000)
    expected = np.convolve(x, axis.filter.taps)[:3000].astype(complex)
    for pole, residue in zip(axis.filter.poles, axis.filter.residues):
        expected += lfilter([residue], [1, -pole], x)
    lead = axis.filter.lead
    expected = np.r_[np.zeros(lead), expected[:3000 - lead]]
    np.testing.assert_allclose(run(axis.filter, x), expected.real, atol=1e-8)


def test_band_is_judged_by_the_gain_where_the_model_was_identified():
    """Below its band a model in z may do anything: here it is a hundred times as large."""
    rng = np.random.default_rng(260)
    for _ in range(5):
        sensitivity = rng.choice([-1, 1]) * rng.uniform(0.2, 5.0)
        slow, zero = np.exp(-2 * np.pi * np.array([0.01, 1.0]) / 1000.0)
        core = {"type": "arx", "numerator": [sensitivity, -sensitivity * zero],
                "denominator": [1.0, -slow], "sampling_rate_hz": 1000.0}
        data = {"schema": "frac_accel/sensor_model/1", "core": core}
        axis = SensorModel.from_dict(data).axis("x")
        assert plateau(axis) == pytest.approx(sensitivity * (1 - zero) / (1 - slow), rel=1e-6)
        known = SensorModel.from_dict({**data, "band_hz": [20.0, 200.0]})
        assert plateau(axis, known.band_hz) == pytest.approx(sensitivity, rel=0.01)
        assert design_inverse(known, 1000.0).axes[0].band_hz[1] == 200.0
        # without a band the static gain stands for the plateau, and most of the band is lost
        assert design_inverse(SensorModel.from_dict(data), 1000.0).axes[0].band_hz[1] < 1.0


def test_what_was_not_identified_is_called_extrapolated():
    data = {"schema": "frac_accel/sensor_model/1",
            "core": {"type": "oscillator", "natural_frequency_hz": 150.0, "damping_ratio": 0.3,
                     "sensitivity": 1.0}}
    assert design_inverse(SensorModel.from_dict(data), 1000.0).extrapolated_below_hz == 0
    known = SensorModel.from_dict({**data, "band_hz": [20.0, 200.0]})
    assert design_inverse(known, 1000.0).extrapolated_below_hz == 20.0
    assert design_inverse(known, 1000.0, lowest_hz=21.0).extrapolated_below_hz == 0


def test_plateau_of_an_oscillator_is_its_sensitivity_in_any_band():
    for sensitivity in (-0.3, 2.0):
        model = SensorModel.from_dict({
            "schema": "frac_accel/sensor_model/1",
            "core": {"natural_frequency_hz": 300.0, "damping_ratio": 0.1,
                     "sensitivity": sensitivity}})
        assert plateau(model.axis("x"), [250.0, 600.0]) == sensitivity


def test_a_sensor_far_below_the_rate_costs_no_more_than_its_taps():
    """Taps by the ten thousand, with a spring: seconds, where all sums in full take a minute."""
    import time
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 2.0, "damping_ratio": 0.3},
        "effects": [{"cause": "cubic_stiffness", "alpha3": 1e-3}]})
    start = time.process_time()
    design = design_inverse(model, 500.0, bandwidth_hz=0.05)
    assert time.process_time() - start < 8
    assert design.warm_up_samples > 40_000


@pytest.mark.parametrize("unknowns, step", [(4, 1), (7, 2), (9, 7), (20, 150)])
def test_taps_that_vary_slowly_are_sums_of_their_kernels(unknowns, step):
    from frac_accel.correction.fitting import _SmoothTaps
    taps = _SmoothTaps(unknowns, step)
    values = np.random.default_rng(0).normal(size=unknowns)
    sparse = np.zeros((unknowns - 1) * step + 1)
    sparse[::step] = values
    whole = np.convolve(sparse, taps.kernel())
    np.testing.assert_allclose(taps.taps(values), whole, atol=1e-15)
    z = np.exp(-2j * np.pi * np.r_[0, 1e-9, np.geomspace(1e-6, 0.5, 100)])
    np.testing.assert_allclose(taps.columns(z) @ values, np.polyval(whole[::-1], z), atol=1e-12)
