"""The beat of a polled read-out has the frequency that the whole record determines."""

import numpy as np
import pytest

from frac_accel.model.effects.polled_readout import Beat
from frac_accel.model.effects.steady_beat import Start, SteadyBeat

COUNT, RATE = 12_000, 200.0
TIME = np.arange(COUNT) / RATE


def polled(rng, noise, wander_s=0.0, interval=None, fastest_hz=45.0):
    """What a sensor says that another clock reads, the motion that late on average, and the
    interval of the sensor's clock."""
    frequency = rng.uniform(0.5, fastest_hz, 60)
    size, phase = rng.normal(size=60) / np.sqrt(60), rng.uniform(0, 2 * np.pi, 60)

    def motion(t):
        return sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(size, frequency, phase))
    interval = interval or 1 / (RATE * rng.integers(1, 4)
                                + rng.choice([-1, 1]) * rng.uniform(15, 70))
    ticks = (TIME + wander_s * np.sin(0.4 * TIME)) / interval + rng.random()
    values = motion(TIME - interval * (ticks % 1))
    values += noise * values.std() * rng.normal(size=COUNT)
    return values, motion(TIME - interval / 2), interval


def told(rng, noise, wander_s=0.0):
    """The beat, and how far its frequency and interval are off, in standard uncertainties."""
    values, output, interval = polled(rng, noise, wander_s)
    beat = Beat.of(values, output, np.ones(COUNT, bool))
    if beat is None:
        return None
    turns = 1 / (interval * RATE) % 1
    return beat, (beat.frequency - min(turns, 1 - turns)) / beat.frequency_std, (
        1 / beat.own_rate - interval * RATE) / beat.std


def test_uncertainties_cover_what_they_should():
    rng = np.random.default_rng(71)
    found = [told(rng, 10**rng.uniform(-2.5, -0.7)) for _ in range(60)]
    found = [entry for entry in found if entry is not None]
    assert len(found) > 45
    for off in np.array([entry[1:] for entry in found]).T:
        assert 0.5 < np.sqrt(np.mean(off**2)) < 1.3
        assert np.mean(abs(off) < 2) > 0.9
    # a thousandth of a turn over the record
    assert np.median([beat.frequency_std for beat, *_ in found]) < 0.001 / COUNT


def test_little_is_left_beside_it():
    left = []
    for seed in range(10):
        values, output, _ = polled(np.random.default_rng([72, seed]), 0.01)
        beat = Beat.of(values, output, np.ones(COUNT, bool))
        if beat is not None:  # where the motion has a line at the beat, none is told
            left.append(np.std(values - output - beat.added) / np.std(values))
    assert len(left) > 7 and np.median(left) < 0.015 and max(left) < 0.1


def test_a_clock_slower_than_its_reader_is_told_up_to_the_fastest_motion():
    rates = []
    for seed in range(12):
        rng = np.random.default_rng([73, seed])
        interval = 1 / (RATE * rng.uniform(0.52, 0.94))
        values, output, _ = polled(rng, 0.01, interval=interval, fastest_hz=90.0)
        beat = Beat.of(values, output, np.ones(COUNT, bool))
        if beat is not None:
            rates.append(beat.own_rate * interval * RATE)
    assert len(rates) > 9 and np.max(np.abs(np.array(rates) - 1)) < 1e-6


@pytest.mark.parametrize("turns", [0.01, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_a_phase_that_wanders_has_no_false_precision(turns, seed):
    interval = polled(np.random.default_rng([73, seed]), 0.03)[2]
    beat, off, _ = told(np.random.default_rng([73, seed]), 0.03, turns * interval)
    assert "wanders" in beat.steadiness and abs(off) < 3
    assert beat.frequency_std * COUNT > turns


def phone(rng, lag, noise):
    """A half minute of values at 100 Hz that are as old as a `lag` (of seconds) says [s], of motion
    that is far louder at times, and the motion late by the mean of that."""
    t = np.arange(3500) / 100
    frequency = rng.uniform(0.3, 8.0, 40)
    size, phase = rng.normal(size=40) / np.sqrt(40), rng.uniform(0, 2 * np.pi, 40)
    louder = rng.uniform(8, 25)

    def motion(t):
        return (0.1 + np.exp(-((t - louder) / 5)**2)) * sum(
            a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(size, frequency, phase))
    age = lag(t)
    values = motion(t - age)
    return values + noise * values.std() * rng.normal(size=len(t)), motion(t - age.mean())


@pytest.mark.parametrize("seed", range(8))
def test_a_slow_beat_in_a_short_record(seed):
    """As of two phones on a shaking table; it was looked for in stretches that are too short."""
    rng = np.random.default_rng([73, seed])
    interval, start = 1 / (100 + rng.uniform(1.2, 4.0)), rng.random()
    values, output = phone(rng, lambda t: interval * ((t / interval + start) % 1),
                           rng.uniform(0.02, 0.05))
    beat = Beat.of(values, output, np.ones(len(values), bool))
    assert beat.own_rate == pytest.approx(1 / (100 * interval), abs=4 * beat.frequency_std)
    assert abs(beat.interval - 100 * interval) < 4 * beat.std + 0.1 * 100 * interval


@pytest.mark.parametrize("seed", range(8))
def test_a_lag_that_swings_and_noise_are_no_beat(seed):
    rng = np.random.default_rng([74, seed])
    swing = 2 * np.pi * rng.uniform(1.2, 4.0)
    for lag in (lambda t: 0.005 * np.sin(swing * t), np.zeros_like,
                lambda t: 0.003 * np.cumsum(rng.normal(size=len(t))) / np.sqrt(len(t))):
        values, output = phone(rng, lag, rng.uniform(0.01, 0.05))
        assert Beat.of(values, output, np.ones(len(values), bool)) is None


def test_without_a_sample_near_a_jump_nothing_is_fitted():
    values, output, interval = polled(np.random.default_rng(75), 0.01)
    turn = TIME / interval % 1
    start = Start((1 / (interval * RATE)) % 1, -0.5, 1.0)
    assert SteadyBeat.of(values, output, abs(turn - 0.5) < 0.1, start, interval * RATE) is None
