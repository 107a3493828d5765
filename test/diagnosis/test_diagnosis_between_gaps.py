"""A slower sensor with a clock of its own: stamps that scatter, messages lost in runs, instants
that scatter though the stamps do not."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

import frac_accel

FINE = 3200.0


def motion(rng, seconds, highest_hz):
    """Spline of random motion between 0.5 Hz and a highest frequency."""
    values = sosfiltfilt(butter(4, [0.5, highest_hz], "band", fs=FINE, output="sos"),
                         rng.normal(size=int(FINE * seconds)))
    return CubicSpline(np.arange(len(values)) / FINE, 1.4 * values / values.std())


def sampled(rng, signal, instants, stamps, noise):
    values = signal(instants) + noise * rng.normal(size=len(instants))
    return frac_accel.Samples.of(np.round(1e9 * (100 + stamps)), np.outer(values, [1.0, 0, 0]))


def kept_of(rng, count, lost, mean_run):
    """Mask of the messages that arrive; the others are lost in runs."""
    kept = np.ones(count, bool)
    while np.mean(~kept) < lost:
        start, run = rng.integers(5, count - 40), rng.geometric(1 / mean_run)
        kept[start:start + run] = False
    return kept


@pytest.mark.parametrize("seed", [2, 1])
def test_a_clock_of_its_own_is_found_beside_losses_in_runs(seed):
    rng = np.random.default_rng(seed)
    seconds, rate = 200.0, 100.0
    signal = motion(rng, seconds, 30.0)
    skew, delay = rng.choice([-1, 1]) * rng.uniform(15, 60), rng.uniform(0.02, 0.12)
    scatter, lost = rng.uniform(0.05, 0.2) / rate, rng.uniform(0.01, 0.03)
    fast = np.arange(1.0, seconds - 1, 0.005)
    slow = np.arange(1.3, seconds - 2, 1 / rate)
    slow = slow[kept_of(rng, len(slow), lost, 3)]
    stamps = np.maximum.accumulate(slow + scatter * rng.normal(size=len(slow)))
    topics = (sampled(rng, signal, fast, fast, 0.008),
              sampled(rng, signal, slow + 1e-6 * skew * (slow - 1.3) - delay, stamps, 0.017))
    found = frac_accel.diagnose(topics, time_limit_s=60.0)
    assert found.verdict == "explained" and found.extended["nrmse"] < 0.03
    effects = {finding.cause: finding for finding in found.findings}
    assert effects.keys() == {"clock_skew", "time_delay", "dropped_samples", "timestamp_jitter"}
    for cause, name, true in (("clock_skew", "skew_ppm", skew), ("time_delay", "delay_s", delay)):
        finding = effects[cause]
        assert abs(getattr(finding.effect, name) - true) < 4 * finding.std[name], name


@pytest.mark.parametrize("seed", [3, 4])
def test_instants_that_scatter_are_found_where_the_reference_is_faster(seed):
    rng = np.random.default_rng(seed)
    seconds, rate = 40.0, 500.0
    signal = motion(rng, seconds, 140.0)
    scatter = rng.uniform(1e-4, 3e-4)
    fast = np.arange(0.5, seconds - 0.5, 0.001)
    slow = np.arange(0.7003, seconds - 0.7, 1 / rate)
    topics = (sampled(rng, signal, fast, fast, 0.005),
              sampled(rng, signal, slow + scatter * rng.normal(size=len(slow)), slow, 0.01))
    found = frac_accel.diagnose(topics, time_limit_s=60.0)
    assert [finding.cause for finding in found.findings] == ["sampling_jitter"]
    value, std = found.findings[0].effect.rms_s, found.findings[0].std["rms_s"]
    # of the drawn ones, which scatter by themselves
    assert abs(value / scatter - 1) < 0.02 and std < 0.02 * scatter
