"""Pairs of sensors on structures: narrow bands, one short event, drifts, a silent start."""

import numpy as np
import scipy.signal as sig

from frac_accel.budget import Division, error_budget, established_noise, left_by
from frac_accel.io.samples import Samples

RATE = 100.0


def of_arrays(reference, sensor, rate=RATE):
    """`Left` of one axis."""
    stamps = np.round(np.arange(len(reference)) / rate * 1e9).astype(np.int64) + 10**18
    return left_by(*(Samples.of(stamps, np.stack([values, 0 * values, 0 * values], axis=1))
                     for values in (reference, sensor)))


def mode(rng, n, frequency_hz, damping=0.02):
    """A structure's mode that noise excites."""
    pole = np.exp(2 * np.pi * frequency_hz / RATE * (-damping + 1j * np.sqrt(1 - damping**2)))
    values = sig.lfilter([1.0], np.real(np.poly([pole, pole.conj()])), rng.normal(size=n + 2000))
    return values[2000:] / np.std(values[2000:])


def shifts(pairs):
    return ["sample(s)" in of_arrays(*pair).model for pair in pairs]


def test_a_delay_is_not_the_lag_at_which_chance_agrees_best():
    """Two places that share a narrow band, or next to nothing, and no delay."""
    draws = [np.random.default_rng([seed, 7]) for seed in range(6)]
    shared = [(mode(rng, 6000, 3.7), rng) for rng in draws]
    assert not any(shifts((x + 0.7 * mode(rng, 6000, 3.7), x + 0.7 * mode(rng, 6000, 3.7))
                          for x, rng in shared))
    assert not any(shifts((mode(rng, 6000, 1.0), mode(rng, 6000, 1.2)) for rng in draws))


def test_a_delay_in_a_steady_record_or_in_one_shock_is_found():
    rng = np.random.default_rng(1)
    noise, time = rng.normal(size=1003), np.arange(1003)
    shock = np.exp(-((time - 500) / 8.0)**2)
    for x, sigma in ((noise, 0.5), (shock, 1e-3)):
        late = x[:-3] + sigma * rng.normal(size=1000)
        assert "3 sample(s) later" in of_arrays(x[3:], late).model


def test_a_settling_zero_beside_one_strike_is_no_even_distortion():
    """The level of a ring-down and a zero that settles are the same slow course."""
    rate, n = 1280.0, 4096
    rng, time = np.random.default_rng(0), np.arange(n) / rate
    x = 2e-3 / 22 * sig.lfilter([1.0], [1.0, -0.999], rng.normal(size=n))
    x[:4] += [0.03, 0.07, 0.07, 0.01]
    y = 4 * np.exp(-1.2 * time) * np.sin(2 * np.pi * 212 * time)
    left = np.exp(-time / 0.6) + 0.1 * rng.normal(size=n)
    left -= left.mean()
    found = error_budget(left, y + left, y, np.stack([x, 0 * x, 0 * x], axis=1),
                         np.ones(n, bool), rate, 0)
    assert found.share("even") < 0.2 and found.share("slow") > 0.5


def test_motion_before_a_silent_stretch_is_not_its_noise():
    """The stretch begins while the sensor's answer to something earlier fades."""
    rng, n = np.random.default_rng(2), 20_000
    x = rng.normal(size=n) * (np.arange(n) > 1200)
    noise = 2e-4 * rng.normal(size=n)
    sensor = x + noise + 0.5 * np.exp(-np.arange(n) / 40.0)
    found = established_noise(0.1 * x, sensor, np.stack([x, 0 * x, 0 * x], axis=1),
                              np.ones(n, bool), 50e3)
    assert found.by == "rest" and abs(found.rms / 2e-4 - 1) < 0.1


def test_it_says_that_an_event_was_too_short_for_a_filter():
    rng, n = np.random.default_rng(3), 6000
    strong = np.exp(-((np.arange(n) - 3000) / 60.0)**2)
    steady = rng.normal(size=n)
    words = [Division(np.stack([x, 0 * x, 0 * x], axis=1), np.ones(n, bool), RATE, 0).words
             for x in (steady, steady * (0.01 + strong))]
    assert words[0] == [] and "could be judged on other data" in words[1][0]
    left = of_arrays(steady * (0.01 + strong), 0.9 * steady * (0.01 + strong) + 0.01 * steady)
    assert words[1][0] in left.words


def test_it_says_that_an_answer_rings_for_longer_than_a_filter():
    rate, n = 1280.0, 4096
    rng, time = np.random.default_rng(4), np.arange(n) / rate
    strike = 1e-4 * rng.normal(size=n)
    strike[:4] += [0.03, 0.07, 0.07, 0.01]
    ring = np.exp(-1.2 * time) * np.sin(2 * np.pi * 212 * time) + 0.05 * rng.normal(size=n)
    words = of_arrays(strike, ring, rate).words
    assert any("within 6.7 Hz of 211.9 Hz: an answer that rings there for longer than 0.075 s" in w
               for w in words)
    assert not any("rings" in w for w in of_arrays(rng.normal(size=n), rng.normal(size=n)).words)
