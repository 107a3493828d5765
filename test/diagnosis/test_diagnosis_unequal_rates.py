"""Drives of the rig with unequal rates, losses, scattering stamps and a noisy reference."""

import numpy as np
import pytest
from blind.plan import GROUPS, plan
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

import frac_accel
from frac_accel import Samples, SensorModel
from frac_accel.model.core import Gain

TRIALS = {trial.name: trial for trial in plan(62, GROUPS)}
TRIALS["clipped"] = next(trial for trial in plan(61, GROUPS)
                         if trial.name == "road_single/clipping/0")
# What is hidden, and what is named besides since it is there, too.
EXACT = {
    "road_single/reference_noise/0": {"reference_noise"},
    "road_single/cross_axis_sensitivity/0": {
        "cross_axis_sensitivity", "dropped_samples", "quantization", "reference_noise"},
    "clipped": {"clipping"},
    "road_single/second_resonance/0": {"second_resonance", "quantization", "reference_noise"},
    # the scatter of its stamps leaves a delay open, which does much the same
    "road_single/reference_low_pass/0": {
        "reference_low_pass", "clock_skew", "dropped_samples", "timestamp_jitter"},
    "road_single/ac_coupling/1": {
        "ac_coupling", "clock_skew", "dropped_samples", "reference_noise", "timestamp_jitter"},
    "road_single/dead_zone/0": {"dead_zone", "quantization"},
}


def diagnosed(name):
    case = TRIALS[name].case()
    reference, sensor, temperature = case.samples()
    return case, frac_accel.diagnose((reference, sensor), case.model(), temperature=temperature)


@pytest.mark.parametrize("name, causes", EXACT.items())
def test_what_is_hidden_is_named_and_nothing_else(name, causes):
    case, found = diagnosed(name)
    assert (found.verdict, {f.cause for f in found.findings}) == ("explained", causes)
    true = {**case.truth, **case.besides}
    for finding in found.findings:
        for parameter, value in true[finding.cause].items():
            if isinstance(value, float) and finding.std.get(parameter):
                near = max(4 * finding.std[parameter], 0.02 * abs(value))
                if parameter == "rms_s":  # of the drawn ones, as the fraction, which has few
                    near = 0.1 * value
                assert abs(getattr(finding.effect, parameter) - value) < near, parameter


@pytest.mark.parametrize("name, besides", [
    ("road_single/low_pass_filter/0", set()), ("road_outside/wrong_model/0", set()),
    ("road_single/linear_phase_filter/0",
     {"dropped_samples", "quantization", "timestamp_jitter"})])
def test_a_filter_that_the_record_does_not_tell_from_others_has_no_name(name, besides):
    # a low-pass that is much like a moving average there; the model in use has a low-pass too many;
    # two moving averages that a Bessel filter of fourth order is as near to as the lattice
    _, found = diagnosed(name)
    # scatter of the stamps by a hundredth of the interval gains about as little as counts at all
    # (0.5 %): rounding of the processor decides
    named = {finding.cause for finding in found.findings}
    assert besides - {"timestamp_jitter"} <= named <= besides and found.suspects


@pytest.mark.parametrize("seed", [3451, 3452, 3453])
def test_a_tone_is_as_strong_as_before_what_filters_both_to_the_slower_band(seed):
    """Compared up to 40 Hz, of a tone at 37.8 Hz a tenth is left: that was its amplitude."""
    rng = np.random.default_rng(seed)
    seconds, finer = 40, 2000.0
    time = np.arange(seconds * finer) / finer
    motion = CubicSpline(time, sosfiltfilt(butter(2, [0.5, 20], "band", fs=finer, output="sos"),
                                           rng.standard_normal(len(time))))
    own, other = np.arange(0, seconds - 1, 0.01) + rng.uniform(0, 0.01), \
        np.arange(0, seconds - 1, 0.005)
    frequency, amplitude = rng.uniform(36.5, 38.0), rng.uniform(0.2, 0.4) * motion(own).std()
    tone = amplitude * np.sin(2 * np.pi * frequency * own + rng.uniform(0, 6))
    noise = 0.01 * motion(own).std() * rng.standard_normal(len(own))
    found = frac_accel.diagnose(tuple(
        Samples.of(np.round(1e9 * at).astype(np.int64), np.c_[values, 0 * values, 0 * values])
        for at, values in ((other, motion(other)), (own, motion(own) + tone + noise))),
        SensorModel(Gain(1.0)))
    named, = found.findings
    assert named.cause == "tone_interference"
    assert abs(named.effect.amplitude - amplitude) < 4 * named.std["amplitude"]
    assert named.std["amplitude"] < 0.05 * amplitude
