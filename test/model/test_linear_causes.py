"""Filters and modes behind and before a sensor: simulated, inverted and found, against exact sines.

The answers are built from scipy's analogue prototypes and numpy's sinc at the frequency of each
sine, so that no simulation has a part in them.
"""

import numpy as np
import pytest
import real_records
from exact_sines import RATE, oscillator, record, samples
from scipy import signal

from frac_accel import Corrector, diagnose, simulate
from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model.effects import known_effects

GAIN = {"type": "gain", "sensitivity": 1.3}


def moving_averages(s, length_s, order):
    frequency = s.imag / (2 * np.pi)
    return (np.sinc(length_s * frequency) * np.exp(-s * length_s / 2))**order


def low_pass(s, corner_hz, order, family):
    zeros, poles, gain = (signal.buttap(order) if family == "butterworth"
                          else signal.besselap(order, norm="mag"))
    corner = 2 * np.pi * corner_hz
    return signal.freqs(*signal.zpk2tf(zeros, poles * corner, gain * corner**order), s.imag)[1]


def with_mode(s, frequency_hz, damping_ratio, share):
    return 1 - share + share * oscillator(s, frequency_hz, damping_ratio)


def low_pass_lag(s, corner_hz):
    return 1 / (1 + s / (2 * np.pi * corner_hz))


def time_delay(s, delay_s):
    return np.exp(-s * delay_s)


DRAWS = {
    "linear_phase_filter": (moving_averages, lambda rng: {
        "length_s": rng.uniform(1e-3, 4e-3), "order": int(rng.integers(1, 4))}),
    "low_pass_filter": (low_pass, lambda rng: {
        "corner_hz": rng.uniform(60, 250), "order": int(rng.integers(2, 7)),
        "family": str(rng.choice(["butterworth", "bessel"]))}),
    "second_resonance": (with_mode, lambda rng: {
        "frequency_hz": rng.uniform(60, 350), "damping_ratio": rng.uniform(0.01, 0.1),
        "share": float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.2))}),
    "low_pass_lag": (low_pass_lag, lambda rng: {"corner_hz": rng.uniform(60, 400)}),
    "time_delay": (time_delay, lambda rng: {"delay_s": rng.uniform(3e-4, 3e-3)}),
}
NEW = ("linear_phase_filter", "low_pass_filter", "second_resonance")


def model(core, effects=()):
    return SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": core,
                                  "effects": list(effects)})


def drawn(cause, seed, **options):
    """Core, parameters of the cause, and the exact record."""
    rng = np.random.default_rng([seed, 31])
    link, draw = DRAWS[cause]
    parameters = draw(rng)
    if rng.random() < 0.5:
        core, own = {"type": "gain", "sensitivity": 1.3}, np.ones_like
    else:
        core = {"natural_frequency_hz": rng.uniform(120, 350),
                "damping_ratio": rng.uniform(0.05, 0.7), "sensitivity": 1.3}

        def own(s):
            return oscillator(s, core["natural_frequency_hz"], core["damping_ratio"])
    return core, parameters, record(rng, lambda s: 1.3 * own(s) * link(s, **parameters), **options)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("cause", NEW)
def test_simulated_as_exactly(cause, seed):
    """Away from both ends, where the record does not tell what was before and after it."""
    core, parameters, (reference, sensor) = drawn(cause, seed, noise=0, band=(1.0, 300.0))
    simulated = simulate(model(core, [{"cause": cause, **parameters}]), reference, RATE, axis="x",
                         initial="steady")
    middle = slice(2000, -500)
    assert np.std((simulated - sensor)[middle]) < 2e-4 * np.std(sensor)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("cause", NEW)
def test_correction_gives_back_the_reference(cause, seed):
    core, parameters, _ = drawn(cause, seed)
    whole = model(core, [{"cause": cause, **parameters}])
    top = Corrector(whole, sampling_rate_hz=RATE).design.axes[0].band_hz[1]
    _, _, (reference, sensor) = drawn(cause, seed, noise=0, band=(1.0, 0.9 * top))
    corrector = Corrector(whole, sampling_rate_hz=RATE)
    raw = samples(reference, sensor)[1]
    parts = corrector.process(*raw[:3]), corrector.finish()
    stamps, values = (np.concatenate([getattr(part, name) for part in parts])
                      for name in ("stamps_ns", "values"))
    from scipy.interpolate import CubicSpline
    # the corrected samples lie between those of the reference
    fine = signal.resample_poly(reference, 16, 1)
    truth = CubicSpline(np.arange(len(fine)) / (16 * RATE), fine)(1e-9 * stamps)
    middle = slice(2500, -2500)
    assert np.std((values[:, 0] - truth)[middle]) < 5e-3 * np.std(truth)


def test_a_linear_phase_filters_delay_leaves_the_stamps():
    corrector = Corrector(model(GAIN, [{"cause": "linear_phase_filter", "length_s": 2.01e-3,
                                        "order": 1}, {"cause": "time_delay", "delay_s": 506e-6}]),
                          sampling_rate_hz=RATE)
    assert corrector.design.sensor_delay_ns == pytest.approx(1_511_000, abs=1)


@pytest.mark.parametrize("length_s", [2.01e-3, 20e-3])
def test_a_band_ends_below_the_first_notch(length_s):
    corrector = Corrector(model(GAIN, [{"cause": "linear_phase_filter", "length_s": length_s,
                                        "order": 2}]), sampling_rate_hz=RATE)
    assert 0.3 / length_s < corrector.design.axes[0].band_hz[1] < 1 / length_s


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cause", DRAWS)
def test_found_and_not_mistaken_for_each_other(cause, seed):
    core, parameters, pair = drawn(cause, seed)
    found = diagnose(samples(*pair), model(core))
    assert [finding.cause for finding in found.findings] == [cause]
    for name, entry in found.findings[0].as_dict()["parameters"].items():
        if entry["std"]:
            assert abs(entry["value"] - parameters[name]) < 5 * entry["std"]
        else:
            assert entry["value"] == parameters[name]


def test_where_the_band_does_not_tell_nothing_else_is_named():
    """Far below the corner every low-pass is a delay."""
    rng = np.random.default_rng(5)
    pair = record(rng, lambda s: low_pass(s, 300.0, 2, "butterworth"), band=(0.5, 5.0), noise=3e-3)
    found = diagnose(samples(*pair), model({"type": "gain"}))
    assert not {finding.cause for finding in found.findings} - {"time_delay"}


@pytest.mark.parametrize("effect, words", [
    ({"cause": "low_pass_filter", "corner_hz": 50, "order": 3, "family": "besel"},
     r"family: 'besel' given, expected butterworth or bessel; did you mean 'bessel'\?"),
    ({"cause": "low_pass_filter", "corner_hz": 50, "order": 3},
     "family: missing, expected butterworth or bessel"),
    ({"cause": "low_pass_filter", "corner_hz": 50, "order": 2.5, "family": "bessel"},
     "order: 2.5 given, expected a whole number at least 2 and at most 8"),
    ({"cause": "low_pass_filter", "corner_hz": 50, "order": 1, "family": "bessel"},
     "order: 1 given, expected a whole number at least 2"),
    ({"cause": "linear_phase_filter", "length_s": 1e-3, "order": 1.5},
     "order: 1.5 given, expected a whole number"),
    ({"cause": "second_resonance", "frequency_hz": 50, "damping_ratio": 0.1, "share": 1},
     "share: 1 given, expected a number above -1 and below 1"),
    ({"cause": "coulomb_friction", "level": 1e-3},
     "coulomb_friction given with a core of type gain, expected an oscillator"),
])
def test_errors_say_what_was_expected(effect, words):
    with pytest.raises(ModelError, match=words):
        model(GAIN, [effect])


def test_a_model_file_keeps_orders_and_words():
    effects = [{"cause": "linear_phase_filter", "length_s": 1e-3, "order": 2},
               {"cause": "low_pass_filter", "corner_hz": 50.0, "order": 3, "family": "bessel"}]
    written = model(GAIN, effects).to_dict()
    assert {tuple(effect.items()) for effect in written["effects"]} \
        == {tuple(effect.items()) for effect in effects}
    assert written["core"] == GAIN


@pytest.mark.parametrize("cause", NEW)
def test_alternatives_are_of_the_same_cause_and_end(cause):
    """From any of them all others can be reached, one step at a time."""
    effect = known_effects()[cause](
        **DRAWS[cause][1](np.random.default_rng(0)))
    seen, to_come = set(), [effect]
    while to_come:
        one = to_come.pop()
        kind = getattr(one, "order", None), getattr(one, "family", None)
        if kind not in seen:
            seen.add(kind)
            to_come += one.alternatives()
    assert len(seen) == {"linear_phase_filter": 4, "low_pass_filter": 14,
                         "second_resonance": 1}[cause]


@pytest.mark.parametrize("given", [True, False])
def test_a_delay_does_not_hide_the_filter(given):
    """A delay takes the filter's own delay at first, and has to give it back."""
    pair = record(np.random.default_rng(11), lambda s: 1.02 * moving_averages(s, 2.01e-3, 1)
                  * time_delay(s, 5.06e-4), band=(2.0, 250.0), noise=2e-3)
    in_use = model({"type": "gain", "sensitivity": 1.02}) if given else None
    found = diagnose(samples(*pair), in_use)
    assert {finding.cause for finding in found.findings} == {"time_delay", "linear_phase_filter"}
    own = found.model.axis("x")
    assert own.delay_s == pytest.approx(1.511e-3, abs=2e-6)
    assert {effect.cause: effect for effect in own.effects}["linear_phase_filter"].length_s \
        == pytest.approx(2.01e-3, rel=2e-3)


@pytest.mark.real_data
@pytest.mark.skipif(not real_records.FOLDER.is_dir(), reason="no measured records here")
def test_a_measured_digital_filter_is_named_and_nothing_else():
    found = diagnose(real_records.FOLDER / "mpu9250_response.mcap")
    assert {finding.cause for finding in found.findings} == {"time_delay", "linear_phase_filter"}
    own = found.model.axis("x")
    assert own.delay_s == pytest.approx(1.511e-3, abs=1e-5)
    assert {effect.cause: effect for effect in own.effects}["linear_phase_filter"].length_s \
        == pytest.approx(2.01e-3, rel=1e-2)
