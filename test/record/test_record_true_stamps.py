"""Whether samples were taken where their scattering stamps say, or at uniform instants: a topic
tells by itself, and is put on uniform instants then."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from frac_accel import Record, Samples, diagnose
from frac_accel.record.clock import Clock

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


@pytest.mark.parametrize("seed", [31, 32])
def test_limits_and_lattice_stay_those_of_what_was_published(seed):
    rng = np.random.default_rng(seed)
    (reference, sensor), _ = pair(seed, (200.0, 200.0), 0.05 / 200, true=True, gravity=0.0)
    step, limit = rng.uniform(0.02, 0.1), rng.uniform(1.2, 1.8)
    most = step * np.floor(limit / step)
    rounded = np.clip(step * np.round(sensor.values / step), -most, most)
    record = Record.of(reference, Samples.of(sensor.stamps_ns, rounded), "z")
    assert record.topics[1].is_moved
    assert record.step("sensor", 2) == pytest.approx(step, rel=1e-6)
    found = record.integrity(2)
    # the values themselves lie on no lattice any more
    assert found.step is None
    assert found.upper == pytest.approx(most) and found.lower == pytest.approx(-most)
    at_limit = np.abs(rounded[:, 2]) > most - step / 2
    assert np.all(np.abs(record.topics[1].values[at_limit, 2]) == pytest.approx(most))
    diagnosed = diagnose((reference, Samples.of(sensor.stamps_ns, rounded)), axis="z",
                         time_limit_s=60)
    causes = {f.cause: f.effect for f in diagnosed.findings}
    assert causes["clipping"].upper == pytest.approx(most)
    assert causes.keys() <= {"clipping", "quantization", "reference_noise"}


@pytest.mark.parametrize("seed", [41, 42, 43])
@pytest.mark.parametrize("share", [0.15, 0.22, 0.27])
def test_stamps_that_scatter_by_a_quarter_of_the_interval_are_a_clocks(seed, share):
    rng = np.random.default_rng(seed)
    rate, count = rng.uniform(50, 2000), 20_000
    scatter = np.clip(share * rng.normal(size=count), -0.48, 0.48)
    clock = Clock.of(np.round(1e9 * (np.arange(count) + scatter) / rate).astype(np.int64))
    assert clock.kind == "regular"
    # of a line through stamps that scatter by so much
    assert clock.rate_hz == pytest.approx(rate, rel=5 * share * np.sqrt(12) / count**1.5)
    assert clock.scatter_s * rate == pytest.approx(np.std(scatter), rel=0.02)
    assert np.array_equal(np.diff(clock.slot), np.ones(count - 1))


def test_a_third_of_the_samples_lost_is_no_clock_that_scatters():
    rng = np.random.default_rng(5)
    kept = np.sort(rng.choice(30_000, 20_000, replace=False))
    clock = Clock.of(np.round(1e7 * (kept + 0.02 * rng.normal(size=20_000))).astype(np.int64))
    assert clock.rate_hz == pytest.approx(100.0, rel=1e-5)
