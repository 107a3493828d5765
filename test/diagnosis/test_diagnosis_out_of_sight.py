"""What lies beyond all that is compared, or hides in a fit, must not lend its doings to a name."""

from types import SimpleNamespace

import numpy as np
import pytest
import rig
from exact_sines import samples
from rig.excitation import band_noise
from rig.oscillator import integrate
from rig.record import simulate_record
from rig.sensor import Sensor
from scipy.optimize import brentq
from scipy.signal import butter, cont2discrete, lfilter, sosfilt
from shaken import OVERSAMPLING, measured, shocks

import frac_accel
from frac_accel import SensorModel
from frac_accel.diagnosis.doubts.out_of_sight import _another_core, _corner_hz
from frac_accel.diagnosis.problem import Problem
from frac_accel.io.samples import Samples
from frac_accel.model.core import Gain, Oscillator
from frac_accel.model.effects import known_effects
from frac_accel.record import Record


def random_motion(rng, rate, n, low_hz, high_hz):
    return sosfilt(butter(4, [low_hz, high_hz], "band", fs=rate * OVERSAMPLING, output="sos"),
                   rng.normal(size=n * OVERSAMPLING))


def shaken_by_pulses(rng, rate, n, *pulses):
    """Pulses on a bench that never quite stands still."""
    motion = shocks(rng, rate, n, *pulses)
    background = random_motion(rng, rate, n, 0.01 * rate, 0.1 * rate)
    return motion + 0.02 * motion.std() * background / background.std()


def sampled(rng, signals, noise):
    """Every sixteenth sample, with white noise of a share of each one's RMS."""
    return tuple(values[::OVERSAMPLING] + share * values.std() * rng.normal(
        size=len(values) // OVERSAMPLING) for values, share in zip(signals, noise))


@pytest.mark.parametrize("seed", [2, 1])
def test_a_core_beyond_the_nyquist_frequency_is_no_filter_and_no_mode(seed):
    rng = np.random.default_rng(seed)
    motion = shaken_by_pulses(rng, 10_000.0, 40_000, 9, 2e-3, 400.0)
    pair = measured(rng, motion, 10_000.0, rng.uniform(9000, 12_000), rng.uniform(0.5, 0.7), 50, 40)
    found = frac_accel.diagnose(pair, sampling_rate_hz=10_000.0, time_limit_s=60.0)
    assert not {f.cause for f in found.findings} - {"time_delay", "reference_noise"}
    assert found.verdict in ("consistent", "explained")


@pytest.mark.parametrize("seed", [3, 4])
def test_a_sharp_mount_is_named_beside_a_late_reference(seed):
    rng, rate, n = np.random.default_rng(seed), 2000.0, 40_000
    motion = random_motion(rng, rate, n, 4.0, 700.0)
    omega, zeta = 2 * np.pi * rng.uniform(300, 600), rng.uniform(0.05, 0.12)
    top, bottom, _ = cont2discrete(([2 * zeta * omega, omega**2], [1, 2 * zeta * omega, omega**2]),
                                   1 / (rate * OVERSAMPLING), "foh")
    late = int(rng.integers(6, 40))  # of 1/32 ms, shorter than a sampling interval or longer
    output = lfilter(top[0], bottom, motion)
    pair = sampled(rng, (np.roll(motion, late), output), (0.004, 0.003))
    found = frac_accel.diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=rate,
                                time_limit_s=60.0)
    effects = {f.cause: f.effect for f in found.findings}
    assert effects.keys() == {"mounting_resonance", "reference_delay"}
    assert abs(effects["mounting_resonance"].frequency_hz / (omega / 2 / np.pi) - 1) < 1e-3
    assert abs(effects["reference_delay"].delay_s * rate * OVERSAMPLING - late) < 0.1


@pytest.mark.parametrize("seed", [5, 6])
def test_noise_of_the_reference_that_a_filter_keeps_off_is_no_evidence_for_it(seed):
    # slow pulses, in which a delay and a low-pass are nearly the same, and white noise
    rng, rate, n = np.random.default_rng(seed), 2000.0, 40_000
    motion = shaken_by_pulses(rng, rate, n, 6, 0.1, 150.0)
    delay = rng.uniform(0.6e-3, 1.4e-3)
    late = int(round(delay * rate * OVERSAMPLING))
    pair = sampled(rng, (motion, np.roll(motion, late)), (0.006, 0.004))
    found = frac_accel.diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=rate,
                                time_limit_s=60.0)
    assert [f.cause for f in found.findings] == ["time_delay"]
    finding = found.findings[0]
    assert abs(finding.effect.delay_s - late / (rate * OVERSAMPLING)) < 4 * finding.std["delay_s"]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [7, 8])
def test_damping_that_grows_with_speed_brings_no_fractional_order(seed):
    rng, rate, n = np.random.default_rng(seed), 500.0, 20_000
    base = random_motion(rng, rate, n, 1.0, 60.0) * np.clip(
        np.arange(n * OVERSAMPLING) / (rate * OVERSAMPLING), 0, 1)
    base *= 3.0 / base.std()
    coefficient = rng.uniform(0.05, 0.15)
    motion = integrate(np.append(base, base[-1]), 1 / (rate * OVERSAMPLING), rng.uniform(35, 60),
                       rng.uniform(0.05, 0.15), quadratic_damping=coefficient).q[:len(base)]
    pair = sampled(rng, (base, motion), (0.003, 0.002))
    found = frac_accel.diagnose(pair, sampling_rate_hz=rate, time_limit_s=60.0)
    assert [f.cause for f in found.findings] == ["quadratic_damping"]
    assert abs(found.findings[0].effect.coefficient / coefficient - 1) < 0.01


@pytest.mark.parametrize("seed, scatter", [(7, 0.0), (8, 0.0), (8, 0.02), (9, 0.03)])
def test_what_an_identified_sensor_shows_too_early_is_the_references_doing(seed, scatter):
    rng, rate = np.random.default_rng([seed, 1]), 200.0
    core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(20, 35),
            "damping_ratio": rng.uniform(0.05, 0.15), "damping_order": 1.0, "sensitivity": 1.0}
    late = rng.uniform(3, 8) / rate
    excitation = rig.band_noise(rng, rate, 40.0, (0.5, 60.0), 3.0, 1.0)
    made = rig.simulate_record(rig.Sensor(core, {"reference_delay": {"delay_s": late}}), excitation)
    values = made.clean + 0.01 * made.clean.std(axis=0) * rng.normal(size=made.clean.shape)
    stamps = made.sensor_stamps_ns + np.round(
        1e9 * scatter / rate * rng.normal(size=len(values))).astype(int)
    found = frac_accel.diagnose((Samples.of(made.stamps_ns, made.reference),
                                 Samples.of(stamps, values)))
    [finding] = [f for f in found.findings if not f.effect.read_off]
    assert finding.cause == "reference_delay"
    assert abs(finding.effect.delay_s - late) < 4 * finding.std["delay_s"] < 2e-3
    assert found.model.reference_faults == (finding.effect,)


@pytest.mark.parametrize("stated_hz, found_hz, doubted", [
    (20e3, 67.0, True), (20e3, 50.0, False), (90.0, 67.0, False)])
def test_a_core_that_moves_far_to_beyond_what_is_compared_has_no_name(stated_hz, found_hz, doubted):
    """A delay of half a sample was a natural frequency of 67 Hz for the 20 kHz of the model, beside
    a named resonance; up to 64 Hz were compared."""
    cause = "core_parameter_shift"
    found = known_effects()[cause](natural_frequency_hz=found_hz, damping_ratio=0.8)
    stated = SensorModel(Oscillator(stated_hz, 0.7, 1.0, 1.0))
    pair = np.zeros((2, 4000)) + np.random.default_rng(1).normal(size=4000)
    problem = Problem(Record.of(*samples(*pair, rate=128.0), "x"), 0, stated, np.ones(4000, bool))
    engine = SimpleNamespace(problem=problem, loose={})
    assert (cause in _another_core(engine, SimpleNamespace(effects={cause: found}))) is doubted


@pytest.mark.long  # a minute of processor time each
@pytest.mark.parametrize("seed", [9, 10])
def test_two_filters_above_the_motion_have_no_name(seed):
    # a viscoelastic mount was told as these two: below them many filters do the same
    rng = np.random.default_rng(seed)
    core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(480, 560),
            "damping_ratio": 0.13, "damping_order": 1.0, "sensitivity": 1.0}
    record = simulate_record(Sensor(core, {
        "mounting_resonance": {"frequency_hz": rng.uniform(270, 310), "damping_ratio": 0.054},
        "fractional_damping": {"damping_order": 1.2, "damping_ratio": 0.48}}),
        band_noise(rng, 500.0, 40.0, (1.0, 160.0)), rng, snr_db=rng.uniform(33, 36))
    found = frac_accel.diagnose(
        (Samples.of(record.stamps_ns, record.reference),
         Samples.of(record.sensor_stamps_ns, record.sensor)),
        SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core}))
    assert not found.findings
    assert any("many filters do the same" in suspect["reason"] for suspect in found.suspects)


@pytest.mark.parametrize("order", [1, 3, 16])
def test_the_corner_of_an_average_of_the_reference_is_where_half_the_power_is_left(order):
    """One of 96 Hz was named where 90 Hz were compared: with a delay, it did what a lag of the
    reference does."""
    length_s, edge_hz = 1.2e-3, 90.0
    corner = brentq(lambda hz: np.sinc(length_s * hz)**(2 * order) - 0.5, 1.0, 0.9 / length_s)
    average = known_effects()["reference_smoothing"](length_s, order)
    assert _corner_hz(average, edge_hz) == pytest.approx(corner, abs=0.4)
    assert _corner_hz(average, corner / 10) == np.inf
    # of the sensor it has a delay besides, which tells it
    assert _corner_hz(known_effects()["linear_phase_filter"](length_s, order), edge_hz) == 0.0
