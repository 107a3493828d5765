"""Causes of measured records are simulated as accurately as the first ones."""

import numpy as np
import pytest
import rig
from rig.logger import Logger
from rig.oscillator import integrate
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

REQUIRED = 5e-4  # of the signal's RMS, both as in test_rig_accuracy.py
MEASURED = 2e-5
RATE = 1000.0


def relative_rms(error, signal):
    return np.sqrt(np.mean(np.square(error)) / np.mean(np.square(signal)))


def flat(effects=None, sensitivity=1.0):
    return rig.Sensor({"type": "gain", "sensitivity": sensitivity}, effects or {})


def noise(seed=0, lead_s=0.0, amplitude=1.0):
    return rig.band_noise(np.random.default_rng(seed), RATE, 3.0, (2, 300), amplitude, lead_s)


def steady_sine(frequency_hz, amplitude=1.0, rate_hz=RATE):
    """Sine with phase 0.3 at the record's start, long after its ramp."""
    return rig.sines(rate_hz, 3.0, [frequency_hz], [0.3], amplitude, lead_s=2.0)


def times(excitation):
    return np.arange(excitation.samples) / excitation.rate_hz


FILTERS = [("linear_phase_filter", {"length_s": 2.017e-3, "order": order}) for order in (1, 2, 4)]
FILTERS += [("low_pass_filter", {"corner_hz": corner, "order": order, "family": family})
            for family in ("butterworth", "bessel")
            for order, corner in ((2, 44.0), (3, 200.0), (5, 90.0), (8, 300.0))]
FILTERS += [("second_resonance", {"frequency_hz": 120.0, "damping_ratio": 0.01, "share": share})
            for share in (-0.2, 0.05)]


@pytest.mark.parametrize("cause, parameters", FILTERS)
def test_linear_causes_against_their_closed_form(cause, parameters):
    cores = ({"type": "gain", "sensitivity": 0.7},
             {"type": "oscillator", "natural_frequency_hz": 150.0, "damping_ratio": 0.1,
              "damping_order": 1.0, "sensitivity": 1.3})
    excitation = rig.noise_bursts(np.random.default_rng(1), RATE, 3.0, (2, 300), [1, 3, 2],
                                  (1, 0, 0))
    for core in cores:
        sensor = rig.Sensor(core, {cause: parameters})
        exact = rig.exact_output(sensor, "x", excitation)
        assert relative_rms(rig.simulate_record(sensor, excitation).sensor[:, 0] - exact,
                            exact) < MEASURED < REQUIRED


def test_filters_are_what_their_names_say():
    s = 2j * np.pi * np.geomspace(1, 400, 100)
    for order in range(2, 9):
        for family in ("butterworth", "bessel"):
            sensor = flat({"low_pass_filter": {"corner_hz": 50.0, "order": order,
                                               "family": family}})
            corner = rig.transfer_function(sensor, "x", 2j * np.pi * 50.0)
            assert abs(corner) ** 2 == pytest.approx(0.5, rel=1e-9)
            response = rig.transfer_function(sensor, "x", s)
            if family == "butterworth":
                power = 1 / (1 + (np.abs(s) / (2 * np.pi * 50.0)) ** (2 * order))
                assert np.allclose(np.abs(response) ** 2, power, rtol=1e-9)
            else:  # delays all of its band alike: that of 1 % of the corner and of half of it
                delay = [-np.angle(rig.transfer_function(sensor, "x", 2j * np.pi * f)) / f
                         for f in (0.5, 5.0, 10.0)]
                assert np.ptp(delay) < (0.03 if order == 2 else 0.003) * delay[0]
    boxcars = rig.transfer_function(
        flat({"linear_phase_filter": {"length_s": 2e-3, "order": 3}}), "x", s)
    f = s.imag / (2 * np.pi)
    expected = np.sinc(2e-3 * f) ** 3 * np.exp(-2j * np.pi * f * 3e-3)
    assert np.allclose(boxcars, expected, atol=1e-12)


def test_flat_core_gives_the_reference_back():
    record = rig.simulate_record(flat(sensitivity=1.7), noise())
    assert np.allclose(record.sensor, 1.7 * record.reference, atol=1e-12)


def test_misalignment_turns_the_motion_into_the_sensors_axes():
    record = rig.simulate_record(flat({"misalignment": {
        "roll_deg": 10.0, "pitch_deg": -25.0, "yaw_deg": 70.0}}), noise())
    turn = Rotation.from_euler("xyz", [10.0, -25.0, 70.0], degrees=True)  # about fixed axes
    assert np.allclose(record.sensor, turn.inv().apply(record.reference), atol=1e-12)
    exchanged = rig.simulate_record(flat({"misalignment": {
        "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 90.0}}), noise())
    assert np.allclose(exchanged.sensor[:, 0], exchanged.reference[:, 1], atol=1e-12)


STATIC = {
    "thermal_offset": ({"coefficient_per_k": 0.02}, lambda a, t, c: a + 0.02 * (c - 25)),
    "offset_drift": ({"rate_per_s": -0.1}, lambda a, t, c: a - 0.1 * t),
    "warm_up_drift": ({"size": 0.4, "time_constant_s": 0.7},
                lambda a, t, c: a + 0.4 * (1 - np.exp(-t / 0.7))),
    "offset_step": ({"at_s": 1.2, "step": 0.5}, lambda a, t, c: a + 0.5 * (t >= 1.2)),
    "gain_step": ({"at_s": 1.2, "ratio": 0.9}, lambda a, t, c: a * np.where(t >= 1.2, 0.9, 1.0)),
}


@pytest.mark.parametrize("cause", STATIC)
def test_what_acts_on_values_alone(cause):
    parameters, expected = STATIC[cause]
    excitation = noise()
    record = rig.simulate_record(flat({cause: parameters}), excitation)
    t, course = times(excitation)[:, None], record.temperature_c[:, None]
    assert np.ptp(course) == (30 if cause == "thermal_offset" else 0)
    assert np.allclose(record.sensor, expected(record.reference, t, course), atol=1e-12)


def test_time_step_reads_the_sine_earlier_from_then_on():
    for step_s in (0.7e-3, -2.3e-3):
        excitation = steady_sine(37.0)
        record = rig.simulate_record(flat({"time_step": {"at_s": 1.5, "step_s": step_s}}),
                                     excitation)
        t = times(excitation)
        exact = np.sin(2 * np.pi * 37.0 * (t - step_s * (t >= 1.5)) + 0.3)
        assert relative_rms(record.sensor[:, 0] - exact, exact) < 1e-9


def steep_lags(effects):
    """Record of a steady sine with something wrong with its instants; by how much they are, where
    the sine is steep."""
    excitation = steady_sine(37.0)
    record = rig.simulate_record(flat(effects), excitation, np.random.default_rng(2), noise_std=0)
    t = times(excitation)
    slope = 2 * np.pi * 37.0 * np.cos(2 * np.pi * 37.0 * t + 0.3)
    steep = np.abs(slope) > 0.7 * slope.max()
    # exact inverse of the sine on its branch
    value = np.clip(record.sensor[:, 0], -1, 1)
    branch = np.where(slope > 0, np.arcsin(value), np.pi - np.arcsin(value))
    lags = np.angle(np.exp(1j * (branch - 2 * np.pi * 37.0 * t - 0.3))) / (2 * np.pi * 37.0)
    return record, lags[steep]


def test_sampling_jitter_moves_the_instants_of_all_axes_together():
    record, scatter = steep_lags({"sampling_jitter": {"rms_s": 4e-4}})
    assert abs(scatter.std() / 4e-4 - 1) < 0.06
    assert abs(scatter.mean()) < 5e-5
    assert np.array_equal(record.sensor[:, 0], record.sensor[:, 1])
    assert np.array_equal(record.stamps_ns, record.sensor_stamps_ns)
    assert np.allclose(record.clean, record.reference, atol=1e-9)


def test_a_polled_value_is_up_to_one_interval_old():
    record, lags = steep_lags({"polled_readout": {"interval_s": 4.3e-4}})
    # as often at any age
    assert np.allclose(np.quantile(lags, [0.005, 0.5, 0.995]), 4.3e-4 * np.array(
        [-0.495, 0, 0.495]), atol=2e-5)
    assert np.allclose(record.clean, record.reference, atol=1e-9)


def test_bursts_take_their_share_at_their_level():
    excitation = rig.band_noise(np.random.default_rng(0), RATE, 60.0, (2, 300))
    record = rig.simulate_record(flat({"interference_bursts": {"share": 0.1, "rms": 3.0}}),
                                 excitation, np.random.default_rng(3), noise_std=0)
    added = (record.sensor - record.clean)[:, 0]
    hit = added != 0
    assert 0.1 <= hit.mean() < 0.102
    assert abs(added[hit].std() / 3.0 - 1) < 0.03
    assert np.allclose(record.clean, record.reference, atol=1e-12)


def adaptive(right_side, t):
    return solve_ivp(right_side, (0, t[-1]), [0.0, 0.0], "DOP853", t[::64], rtol=1e-10,
                     atol=1e-12, max_step=1e-3).y[0]


def base(t):
    return 2 * np.tanh(20 * t) ** 6 * np.sin(2 * np.pi * 13.0 * t)


def test_quadratic_damping_against_an_adaptive_solver():
    w, ratio, coefficient = 2 * np.pi * 20.0, 0.05, 0.4

    def right_side(t, x):
        bracket = x[0] + coefficient * x[1] * abs(x[1]) / w ** 2
        return [x[1], w ** 2 * (base(t) - bracket) - 2 * ratio * w * x[1]]

    t = np.arange(12801) / 25600
    q = integrate(base(t), t[1], 20.0, ratio, quadratic_damping=coefficient).q
    exact = adaptive(right_side, t)
    assert relative_rms(integrate(base(t), t[1], 20.0, ratio).q[::64] - exact, exact) > 0.05
    assert relative_rms(q[::64] - exact, exact) < 1e-6


def test_stiffness_drift_against_an_adaptive_solver():
    """With a cubic spring too, and from before the record's start."""
    rate, begin = 0.8, -0.1

    def right_side(t, x):
        w = 2 * np.pi * 20.0 * (1 + rate * (t + begin))
        return [x[1], w ** 2 * (base(t) - x[0] - 0.02 * x[0] ** 3) - 2 * 0.05 * w * x[1]]

    t = np.arange(12801) / 25600
    q = integrate(base(t), t[1], 20.0, 0.05, alpha3=0.02, drift=(rate, begin)).q
    exact = adaptive(right_side, t)
    constant = integrate(base(t), t[1], 20.0, 0.05, alpha3=0.02).q[::64]
    assert relative_rms(constant - exact, exact) > 0.05
    assert relative_rms(q[::64] - exact, exact) < 1e-6


def test_hysteresis_whose_branches_bend_upwards_against_an_adaptive_solver():
    w, strength, beta, gamma = 2 * np.pi * 20.0, 0.4, 0.5, -0.8

    def right_side(t, x):
        q, v, z = x
        return [v, w ** 2 * (base(t) - q - strength * z) - 0.2 * w * v,
                v - beta * abs(v) * z - gamma * v * abs(z)]

    t = np.arange(12801) / 25600
    q = integrate(base(t), t[1], 20.0, 0.1, hysteresis=(strength, beta, gamma)).q
    exact = solve_ivp(right_side, (0, t[-1]), [0, 0, 0], "LSODA", t[::64], rtol=1e-9,
                      atol=1e-11, max_step=1e-3).y[0]
    assert relative_rms(q[::64] - exact, exact) < 1e-5


def test_impact_stop_acts_on_the_gaps_side_only():
    core = {"type": "oscillator", "natural_frequency_hz": 100.0, "damping_ratio": 0.3,
            "damping_order": 1.0, "sensitivity": 1.0}
    excitation = noise(amplitude=(1, 0, 0))
    free = rig.simulate_record(rig.Sensor(core), excitation).sensor[:, 0]
    for gap in (0.8, -0.5):
        stopped = rig.simulate_record(rig.Sensor(core, {
            "impact_stop": {"gap": gap, "stiffness": 100.0}}), excitation).sensor[:, 0]
        beyond = np.sign(gap) * stopped - abs(gap)
        assert beyond.max() < 0.2 * (np.sign(gap) * free - abs(gap)).max()
        assert (-np.sign(gap) * stopped).max() > 0.9 * (-np.sign(gap) * free).max()
        twin = (-np.inf, gap, 100.0) if gap > 0 else (gap, np.inf, 100.0)
        direct = integrate(excitation.acceleration[0], excitation.step_s, 100.0, 0.3, stop=twin).q
        assert np.allclose(direct[excitation.start::64][:len(stopped)], stopped, atol=1e-9)


def test_backlash_of_a_sine_in_its_closed_form():
    gap, excitation = 0.5, steady_sine(11.0)
    record = rig.simulate_record(flat({"backlash": {"gap": gap}}), excitation)
    x = np.sin(2 * np.pi * 11.0 * times(excitation) + 0.3)
    rising = np.cos(2 * np.pi * 11.0 * times(excitation) + 0.3) > 0
    # behind the play, but no less than half of it inside the last turn
    exact = np.where(rising, np.maximum(x - gap / 2, -1 + gap / 2),
                     np.minimum(x + gap / 2, 1 - gap / 2))
    assert relative_rms(record.sensor[:, 0] - exact, exact) < MEASURED


TWINS = {  # what the reference's fault is as a fault of a flat sensor
    "reference_ac_coupling": ({"corner_hz": 3.0}, {"ac_coupling": {"corner_hz": 3.0}}),
    "reference_low_pass": ({"corner_hz": 120.0}, {"low_pass_lag": {"corner_hz": 120.0}}),
    "reference_smoothing": ({"length_s": 1.9e-3, "order": 3},
                            {"linear_phase_filter": {"length_s": 1.9e-3, "order": 3},
                             "time_delay": {"delay_s": -1.5 * 1.9e-3}}),
    "reference_delay": ({"delay_s": 1.37e-3}, {"time_delay": {"delay_s": 1.37e-3}}),
}


@pytest.mark.parametrize("fault", TWINS)
def test_a_fault_of_the_reference_changes_the_reference_alone(fault):
    parameters, twins = TWINS[fault]
    excitation = noise()
    record = rig.simulate_record(flat({fault: parameters}), excitation)
    bare = rig.simulate_record(flat(), excitation)
    assert np.array_equal(record.sensor, bare.sensor)
    exact = rig.exact_output(flat(twins), "x", excitation)
    assert relative_rms(record.reference[:, 0] - exact, exact) < MEASURED
    model = flat({fault: parameters}).to_model()
    assert model["effects"] == []  # it is no part of the sensor


def test_noise_of_the_reference_is_white_and_its_own():
    excitation = rig.band_noise(np.random.default_rng(0), RATE, 30.0, (2, 300))
    record = rig.simulate_record(flat({"reference_noise": {"std": 0.2}}), excitation,
                                 np.random.default_rng(3), noise_std=0.1)
    bare = rig.simulate_record(flat(), excitation, np.random.default_rng(3), noise_std=0.1)
    assert np.array_equal(record.sensor, bare.sensor)
    added = record.reference - excitation.reference
    assert np.allclose(added.std(axis=0), 0.2, rtol=0.03)
    assert np.all(np.abs(np.sum(added[1:] * added[:-1], axis=0) / np.sum(added ** 2, axis=0))
                  < 0.03)


def test_topics_at_rates_of_their_own_hold_the_same_motion():
    excitation = steady_sine(7.0, rate_hz=200.0)
    logger = Logger(reference_rate_hz=50.0, sensor_rate_hz=193.7, sensor_start_s=0.0123,
                    reference_lost=0.1)
    record = rig.simulate_record(
        flat({"clock_skew": {"skew_ppm": 300.0}, "time_delay": {"delay_s": 0.02}}), excitation,
        np.random.default_rng(5), noise_std=0, logger=logger)
    start = record.stamps_ns[0]
    t, reference_t = ((stamps - start) * 1e-9
                      for stamps in (record.sensor_stamps_ns, record.stamps_ns))
    assert np.allclose(np.diff(t), 1 / 193.7, atol=2e-9) and t[0] == pytest.approx(0.0123)
    assert 0.8 < len(reference_t) / 150 < 0.97
    true_instants = t * (1 + 3e-4) - 0.02
    assert np.allclose(record.sensor[:, 0], np.sin(14 * np.pi * true_instants + 0.3), atol=1e-7)
    assert np.allclose(record.reference[:, 0], np.sin(14 * np.pi * reference_t + 0.3), atol=1e-7)


def test_spikes_hit_their_share():
    record = rig.simulate_record(flat(), noise(), np.random.default_rng(5), noise_std=0,
                                 spikes=(0.02, 10.0))
    hit = np.abs(record.sensor - record.clean)
    assert 0.015 < np.mean(hit > 4) < 0.025 and not np.any((hit > 0) & (hit < 5))


def test_an_effect_of_a_spring_on_a_flat_core_is_refused():
    with pytest.raises(ValueError, match="need an oscillator"):
        rig.simulate_record(flat({"cubic_stiffness": {"alpha3": 0.1}}), noise())


def test_what_the_rig_cannot_do_together_is_refused():
    with pytest.raises(ValueError, match="drifting"):
        integrate(np.zeros(101), 1e-4, 20.0, 0.1, 0.8, drift=(0.1, 0.0))
