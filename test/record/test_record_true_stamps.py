"""Whether samples were taken where their scattering stamps say, or at uniform instants: a topic
tells by itself, and is put on uniform instants then."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from frac_accel import Record, Samples, diagnose

FINE = 4000.0


def pair(seed, rates, scatter_s, true, gravity=9.81, noise=0.01, seconds=60):
    """Reference with regular stamps, and a sensor whose stamps scatter, truly or not."""
    rng = np.random.default_rng(seed)
    motion = sosfiltfilt(butter(3, [0.5, 0.2 * min(rates)], "band", fs=FINE, output="sos"),
                         rng.normal(size=int(FINE * seconds)))
    motion = motion / motion.std() + gravity
    t = np.arange(len(motion)) / FINE
    spline, topics, exact = CubicSpline(t, motion), [], []
    for rate, scatters in zip(rates, (False, True)):
        at = np.arange(0.5, seconds - 0.5, 1 / rate)
        stamps = at + scatters * scatter_s * rng.normal(size=len(at))
        taken = stamps if true else at
        values = spline(taken)
        exact.append(spline(at))
        values += noise * rng.normal(size=len(at))
        topics.append(Samples.of(np.round(1e9 * (100 + stamps)), np.outer(values, [0, 0, 1])))
    return topics, exact


@pytest.mark.parametrize("seed, rates, share", [
    (1, (100.0, 100.0), 0.02), (2, (100.0, 200.0), 0.04), (3, (400.0, 200.0), 0.1),
    (4, (50.0, 50.0), 0.1)])
def test_values_that_follow_their_stamps_are_put_on_uniform_instants(seed, rates, share):
    topics, exact = pair(seed, rates, share / rates[1], true=True)
    record = Record.of(*topics, "z")
    assert any("were taken where their stamps say" in words for words in record.words)
    topic = record.topics[1]
    assert np.ptp(np.diff(topic.stamps_ns)) <= 0.002 * 1e9 / rates[1]
    left = topic.values[50:-50, 2] - exact[1][50:-50]
    assert np.std(left) < 1.2 * 0.01
    found = diagnose(tuple(topics), axis="z", time_limit_s=60)
    # the reference has noise, which may be read off
    assert not {f.cause for f in found.findings} - {"reference_noise"}
    assert found.verdict in ("consistent", "explained")


@pytest.mark.parametrize("seed, share", [(11, 0.002), (12, 0.02), (13, 0.1)])
def test_values_at_uniform_instants_stay_as_they_are(seed, share):
    topics, _ = pair(seed, (100.0, 100.0), share / 100, true=False)
    record = Record.of(*topics, "z")
    assert not any("stamps say" in words for words in record.words)
    assert np.array_equal(record.topics[1].values, topics[1].values)
    found = diagnose(tuple(topics), axis="z", time_limit_s=60)
    # under gravity, too, the scatter of so little is none in the values
    assert {f.cause for f in found.findings} == ({"timestamp_jitter"} if share >= 0.02 else set())


def test_stamps_that_scatter_truly_by_little_are_no_finding_under_gravity():
    topics, _ = pair(21, (400.0, 400.0), 2e-5, true=True)
    assert not diagnose(tuple(topics), axis="z", time_limit_s=60).findings
