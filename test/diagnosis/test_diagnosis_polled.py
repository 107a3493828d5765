"""Beside values that are polled, all else is found as if each had come at its own instant."""

import numpy as np
import pytest

from frac_accel import Samples, diagnose
from frac_accel.model import SensorModel
from frac_accel.model.core import Gain

RATE, COUNT, NOISE = 400.0, 10_000, 0.003


def polled(rng, response, reference_hz=RATE, interval_s=None):
    """Values [(n,), (m,)] of reference and sensor at stamps [s]: a sum of sines, exact at any
    instant, behind a `response` (of frequencies [Hz]), sampled every so often and read at the
    stamps; these; and the interval [s]."""
    hz = rng.uniform(0.5, 70.0, 120)
    lines = (rng.normal(size=120) + 1j * rng.normal(size=120)) / np.sqrt(120)
    stamps = np.arange(COUNT) / RATE
    others = np.arange(COUNT * reference_hz // RATE) / reference_hz
    interval_s = interval_s or rng.uniform(1.4e-3, 2.7e-3)
    taken = stamps - (stamps + rng.uniform(0, interval_s)) % interval_s

    def at(instants, lines):
        return np.real(np.exp(2j * np.pi * np.outer(instants, hz)) @ lines)
    sensor = at(taken, lines * response(hz)) + NOISE * rng.normal(size=COUNT)
    return (at(others, lines), sensor), (others, stamps), interval_s


@pytest.mark.parametrize("seed", range(3))
def test_polled_values_are_explained(seed):
    """A delay was suspected, and the verdict was that no cause explains the rest."""
    rng = np.random.default_rng([61, seed])
    pair, _, interval_s = polled(rng, np.ones_like)
    found = diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=RATE, time_limit_s=100)
    assert found.verdict == "explained"
    finding, = found.findings
    assert finding.cause == "polled_readout"
    assert abs(finding.effect.interval_s - interval_s) < 4 * finding.std["interval_s"]
    # the model can only have the mean age of a value
    effects = {effect.cause: effect for effect in found.model.axis("x").effects}
    assert effects["time_delay"].delay_s == pytest.approx(interval_s / 2, rel=0.01)
    left = pair[1] - np.interp(np.arange(COUNT) / RATE - interval_s / 2,
                               np.arange(COUNT) / RATE, pair[0])
    assert found.extended["rmse"] == pytest.approx(np.std(left), rel=0.2)


@pytest.mark.parametrize("readings", [1, 2])
@pytest.mark.parametrize("seed", range(2))
def test_clocks_of_almost_the_same_rate_beat_slowly(seed, readings):
    """Two clocks of 400 Hz: a sample is lost, or comes twice, every other second."""
    rng = np.random.default_rng([64, seed])
    beat_hz = rng.uniform(0.7, 1.5)
    interval_s = 1 / (readings * RATE + rng.choice([-1, 1]) * beat_hz)
    pair, _, _ = polled(rng, np.ones_like, interval_s=interval_s)
    found = diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=RATE, time_limit_s=100)
    finding, = found.findings
    assert finding.cause == "polled_readout"
    assert finding.effect.interval_s == pytest.approx(interval_s, rel=1e-5)
    assert finding.effect.beat_hz == pytest.approx(beat_hz, rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_low_pass_beside_polled_values(seed):
    """The lag of their ages hid it."""
    rng = np.random.default_rng([62, seed])
    corner_hz = rng.uniform(60, 120)

    def butterworth(hz):
        u = 1j * hz / corner_hz
        return 1 / (u**2 + np.sqrt(2) * u + 1)
    pair, _, interval_s = polled(rng, butterworth)
    found = diagnose(pair, SensorModel(Gain(1.0)), sampling_rate_hz=RATE, time_limit_s=100)
    findings = {finding.cause: finding for finding in found.findings}
    assert findings.keys() == {"polled_readout", "low_pass_filter"}
    filtered = findings["low_pass_filter"]
    assert filtered.effect.order == 2 and filtered.effect.family == "butterworth"
    assert abs(filtered.effect.corner_hz - corner_hz) < 4 * filtered.std["corner_hz"] \
        < 0.02 * corner_hz


@pytest.mark.parametrize("reference_hz", [260.0, 600.0])
@pytest.mark.parametrize("seed", range(2))
def test_polled_values_beside_a_reference_of_another_rate(seed, reference_hz):
    """They were looked at as they are at the instants of the comparison, where they have no age."""
    rng = np.random.default_rng([66, seed])
    values, stamps, interval_s = polled(rng, lambda hz: np.full_like(hz, 1.1), reference_hz)
    pair = [Samples.of(np.round(1e9 * each), np.outer(signal, [1.0, 0.0, 0.0]))
            for each, signal in zip(stamps, values)]
    found = diagnose(tuple(pair), SensorModel(Gain(1.0)), time_limit_s=100)
    findings = {finding.cause: finding for finding in found.findings}
    assert findings.keys() == {"polled_readout", "sensitivity_error"}
    assert findings["polled_readout"].effect.interval_s == pytest.approx(interval_s, rel=0.01)
    assert findings["sensitivity_error"].effect.gain == pytest.approx(1.1, rel=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_polled_values_of_which_some_are_lost(seed):
    """One lost message, or stamps off by microseconds, and no age was looked for."""
    rng = np.random.default_rng([67, seed])
    values, (others, stamps), interval_s = polled(rng, lambda hz: np.full_like(hz, 1.1), 600.0)
    kept = np.sort(rng.permutation(COUNT)[20:])
    stamps = stamps + rng.normal(0, 5e-6, COUNT)
    pair = [Samples.of(np.round(1e9 * each), np.outer(signal, [1.0, 0.0, 0.0]))
            for each, signal in ((others, values[0]), (stamps[kept], values[1][kept]))]
    found = diagnose(tuple(pair), SensorModel(Gain(1.0)), time_limit_s=100)
    findings = {finding.cause: finding for finding in found.findings}
    true = {"polled_readout", "sensitivity_error", "dropped_samples"}
    assert true <= findings.keys() <= true | {"timestamp_jitter"}
    assert findings["polled_readout"].effect.interval_s == pytest.approx(interval_s, rel=0.01)
    assert findings["sensitivity_error"].effect.gain == pytest.approx(1.1, rel=1e-3)
    if "timestamp_jitter" in findings:
        assert findings["timestamp_jitter"].effect.rms_s == pytest.approx(5e-6, rel=0.1)
