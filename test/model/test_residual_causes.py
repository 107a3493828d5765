"""What shows in the residual's power alone: scattering instants, bursts, rounded noise."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt
from second_set_bench import RATE, Multisine, model, samples, times

from frac_accel import Corrector
from frac_accel.diagnosis import diagnose
from frac_accel.model import SensorModel
from frac_accel.model.core import Gain

N, NOISE, POLLED_S = 8000, 0.01, 6.11e-4


def bursts(rng, share):
    """Stretches of 5 to 60 samples."""
    inside = np.zeros(N, bool)
    while inside.mean() < share:
        start = rng.integers(1, N)
        inside[start:start + rng.integers(5, 61)] = True
    return inside


def record(kind, seed, share=0.03):
    """Instants, reference and what the sensor says; bursts take a share of the time."""
    rng = np.random.default_rng(seed)
    t, sine = times(N / RATE), Multisine(rng)
    scatter = 0.0
    if kind == "sampling_jitter":
        scatter = 2e-4 * rng.normal(size=N)
    elif kind == "polled_readout":
        # the motion at the last tick of another clock, whose oscillator wanders
        count = (t + 1e-5 * np.sin(t)) / POLLED_S + rng.random()
        scatter = POLLED_S * (0.5 - count % 1)
    elif kind == "sine in time":
        scatter = 3e-4 * np.sin(2 * np.pi * 87.3 * t)
    values = sine.motion(t + scatter) + NOISE * rng.normal(size=N)
    if kind == "interference_bursts":
        values += 0.3 * bursts(rng, share) * rng.normal(size=N)
    elif kind == "quantization":
        values = 0.153 * np.round((values + 0.018 * rng.normal(size=N)) / 0.153)
    elif kind == "spikes":
        values[rng.integers(0, N, 8)] += 0.5
    elif kind == "gain noise":
        values *= 1 + 0.05 * rng.normal(size=N)
    elif kind == "gain with a beat":
        values *= 1 + 0.05 * ((87.3 * t) % 1 - 0.5)
    elif kind == "moving delay":
        values = sine.motion(t + 3e-4 * np.sin(2 * np.pi * 1.3 * t)) + NOISE * rng.normal(size=N)
    elif kind == "loose contact":
        values *= ~bursts(rng, 0.02)
    elif kind == "filter that begins anew":
        for at in rng.choice(np.arange(200, N - 200, 200), 8, replace=False):
            values[at:at + 200] += 0.5 * rng.choice([-1, 1]) * np.exp(-np.arange(200) / 20)
    elif kind == "heavy tails":
        values += NOISE * rng.standard_t(3, size=N)
    return t, sine.acceleration(t), values


def found(kind, seed, share=0.03):
    t, reference, values = record(kind, seed, share)
    return {f.cause: f for f in diagnose((samples(t, reference), samples(t, values)), model(),
                                         "x").findings}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cause, truth", [
    ("sampling_jitter", {"rms_s": 2e-4}), ("interference_bursts", {"share": 0.03, "rms": 0.3}),
    ("quantization", {"step": 0.153}), ("polled_readout", {"interval_s": POLLED_S})])
def test_recognised_and_nothing_else(cause, truth, seed):
    findings = found(cause, seed)
    assert set(findings) == {cause}
    for name, value in truth.items():
        # the last of the stretches takes the share beyond what was wanted
        assert abs(getattr(findings[cause].effect, name) / value - 1) < (
            0.3 if name == "share" else 0.15)
    assert findings[cause].gain.reduction > 0.1


@pytest.mark.parametrize("seed", [1, 3, 0, 2, 4])
def test_instants_that_scatter_by_a_fifth_of_an_interval(seed):
    """What the next order takes from the slope's power left less than none of some samples'."""
    rng, t = np.random.default_rng([61, seed]), times(12.0)
    sine, rms_s = Multisine(rng, band_hz=(1.0, 200.0)), rng.uniform(0.15, 0.25) / RATE
    values = sine.motion(t + rms_s * rng.normal(size=len(t))) + 5e-4 * rng.normal(size=len(t))
    named = diagnose((samples(t, sine.acceleration(t)), samples(t, values)), model()).findings
    assert [finding.cause for finding in named] == ["sampling_jitter"]
    assert abs(named[0].effect.rms_s - rms_s) < 4 * named[0].std["rms_s"] < 0.2 * rms_s


@pytest.mark.parametrize("seed", range(3))
def test_bursts_keep_what_a_filter_to_a_band_takes(seed):
    """Beside a reference of another rate they had 0.72 to 0.80 of their RMS, by 8 to 12 standard
    uncertainties."""
    rng = np.random.default_rng([61, seed])
    t, sine = times(N / RATE), Multisine(rng)
    finer = np.arange(round(1.25 * N)) / (1.25 * RATE)
    values = sine.motion(t) + NOISE * rng.normal(size=N)
    values += 0.3 * bursts(rng, 0.05) * rng.normal(size=N)
    findings = {f.cause: f for f in diagnose(
        (samples(finer, sine.acceleration(finer)), samples(t, values)), model(), "x").findings}
    assert set(findings) == {"interference_bursts"}
    finding = findings["interference_bursts"]
    assert abs(finding.effect.rms - 0.3) < 3 * finding.std["rms"] < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_is_stuck_now_and_then_has_no_bursts_beside_another_rate(seed):
    """On the reference's instants nothing repeats, and it was noise from elsewhere."""
    rng = np.random.default_rng([62, seed])
    fine = sosfiltfilt(butter(2, [1, 12], "band", fs=4 * RATE, output="sos"),
                       rng.normal(size=4 * N))
    motion = CubicSpline(np.arange(4 * N) / (4 * RATE), fine / fine.std())
    t, slower = np.arange(N - 20) / RATE, np.arange(round(0.85 * (N - 20))) / (0.85 * RATE)
    values = motion(t) + 0.1 * NOISE * rng.normal(size=len(t))
    for start in rng.choice(np.arange(200, N - 200, 120), 12, replace=False):
        values[start:start + rng.integers(10, 20)] = values[start]
    found = diagnose((samples(slower, motion(slower)), samples(t, values)),
                     SensorModel(Gain(1.0)), "x")
    assert not found.findings


@pytest.mark.parametrize("seed", range(3))
def test_bursts_of_an_eighth_of_the_time_are_no_other_noise(seed):
    """More than a tenth was not short any more, and nothing predicted it."""
    finding, = found("interference_bursts", seed, 0.125).values()
    assert finding.cause == "interference_bursts"
    assert finding.effect.share == pytest.approx(0.125, abs=0.02)
    assert finding.effect.rms == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize("kind", ["nothing", "spikes", "gain noise", "moving delay",
                                  "loose contact", "heavy tails", "sine in time",
                                  "gain with a beat", "filter that begins anew"])
def test_neither_where_it_is_something_else(kind):
    assert not {"sampling_jitter", "polled_readout", "interference_bursts",
                "quantization"} & set(found(kind, 7))


@pytest.mark.parametrize("seed", (10, 11))
@pytest.mark.parametrize("cause", ["offset_step", "sensitivity_error"])
def test_what_bursts_drown_is_found_beside_them(cause, seed):
    rng = np.random.default_rng(seed)
    t, reference, values = record("", seed)
    values = values + 0.02 * (t > rng.uniform(5, 12)) if cause == "offset_step" else 1.005 * values
    values += rng.uniform(3, 6) * values.std() * bursts(rng, 0.03) * rng.normal(size=N)
    found = diagnose((samples(t, reference), samples(t, values)), model())
    assert {finding.cause for finding in found.findings} == {cause, "interference_bursts"}
    assert found.verdict == "explained"


@pytest.mark.parametrize("seed", range(3))
def test_a_crest_that_is_cut_off_is_clipped_be_it_the_only_one(seed):
    rng = np.random.default_rng([20, seed])
    t, sine = times(N / RATE), Multisine(rng, band_hz=(0.5, 8.0))
    values = sine.motion(t) + 0.005 * rng.normal(size=N)
    limit = np.quantile(values, 1 - rng.integers(20, 40) / N)
    for sensor, names in ((values, set()), (np.minimum(values, limit), {"clipping"})):
        found = diagnose((samples(t, sine.acceleration(t)), samples(t, sensor)), model())
        assert {finding.cause for finding in found.findings} == names


def test_a_burst_may_be_anywhere_so_that_every_sample_is_worth_less():
    t, reference, values = record("interference_bursts", 1)
    made = samples(t, values)
    plain, informed = (Corrector(model(*effects), RATE, noise_std=NOISE).process(
        made.stamps_ns, made.values) for effects in (
        [], [{"cause": "interference_bursts", "share": 0.03, "rms": 0.3}]))
    assert np.array_equal(plain.values, informed.values)
    ratio = informed.variance[200:, 0] / plain.variance[200:, 0]
    np.testing.assert_allclose(ratio, 1 + 0.03 * 0.3**2 / NOISE**2, rtol=0.05)
