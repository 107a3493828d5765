"""Signals that both end far below the Nyquist frequency, as those of a gravimeter in an aircraft:
most lines of a spectrum are empty, and what is left is slow as well."""

import numpy as np
import pytest
from exact_sines import samples
from scipy.signal import fftconvolve, firwin

import frac_accel
from frac_accel import SensorModel
from frac_accel.diagnosis.doubts.peaks import nothing_at_its_peak
from frac_accel.diagnosis.engine import Engine
from frac_accel.model.core import Gain
from frac_accel.model.effects import effect_of
from frac_accel.record import Record

RATE, COUNT, TOP, GRAVITY = 2.0, 1640, 0.19, 9.8


def slow(rng):
    """Noise of one below the end of the band, and nothing beyond."""
    taps = firwin(121, TOP, fs=RATE, window=("kaiser", 10))
    values = fftconvolve(rng.standard_normal(COUNT + len(taps) - 1), taps, "valid")
    return values / values.std()


def flight(seed):
    """Generator, acceleration that comes and goes, and noise of both."""
    rng = np.random.default_rng(seed)
    air = 1 + 1.5 * np.abs(np.interp(np.arange(COUNT), np.linspace(0, COUNT, 40),
                                     rng.standard_normal(40)))
    motion = 0.3 * air * slow(rng)
    return rng, motion, slow(rng) * motion.std()


def centred(values, share):
    """A mean of three samples, which delays nothing."""
    return values + share * (np.roll(values, 1) + np.roll(values, -1) - 2 * values)


def diagnosed(motion, sensor):
    return frac_accel.diagnose((motion, sensor + GRAVITY), sampling_rate_hz=RATE)


def named(found):
    return {finding.cause for finding in found.findings}


@pytest.mark.parametrize("seed", [3421, 3422, 3423])
def test_a_gain_that_jumps_is_seen_beside_gravity_that_one_of_both_shows(seed):
    """The jump was looked for in the constant: a drift with a course of its own was named."""
    rng, motion, noise = flight(seed)
    at, ratio = rng.integers(int(0.35 * COUNT), int(0.65 * COUNT)), rng.uniform(1.15, 1.3)
    sensor = motion * np.where(np.arange(COUNT) >= at, ratio, 1.0) + 0.006 * noise
    found = diagnosed(motion, sensor)
    assert named(found) - {"offset"} == {"gain_step"}
    step, = (finding for finding in found.findings if finding.cause == "gain_step")
    assert abs(step.effect.ratio - ratio) < 4 * step.std["ratio"]
    assert abs(step.effect.at_s - at / RATE) < 10.0


@pytest.mark.parametrize("share, seed", [(-0.5, 3431), (-0.5, 3432), (0.15, 3433), (0.15, 3434),
                                         (0.4, 3437)])
def test_a_filter_that_delays_nothing_is_no_polled_readout_and_no_late_reference(share, seed):
    """What it leaves in a narrow band looked like a beat where most lines are empty, and
    an oscillator of the same gain had its own delay taken back by the reference's."""
    rng, motion, noise = flight(seed)
    jump = 0.25 * motion.std() * (np.arange(COUNT) > COUNT * rng.uniform(0.4, 0.6))
    found = diagnosed(motion, centred(motion, share) + jump + 0.002 * noise)
    assert named(found) <= {"offset", "offset_step", "reference_smoothing"}


@pytest.mark.parametrize("resonates", [False, True])
def test_a_mode_explains_something_around_its_resonance(resonates):
    rng, motion, noise = flight(3441)
    motion = motion + 1e-3 * motion.std() * rng.standard_normal(COUNT)
    mode = effect_of("second_resonance")(0.1 if resonates else 0.5, 0.02, -0.16)
    if resonates:
        turns, own = 2j * np.pi * np.fft.rfftfreq(COUNT, 1 / RATE), 0.2 * np.pi
        answer = 1 + 0.16 * turns**2 / (turns**2 + 0.04 * own * turns + own**2)
        sensor = np.fft.irfft(np.fft.rfft(motion) * answer, COUNT)
    else:
        sensor = centred(motion, 0.02)
    record = Record.of(*samples(motion, sensor + 0.002 * noise, RATE))
    engine = Engine(record, 0, SensorModel(Gain(1.0)), record.valid, {})
    fit = engine.search.fit({mode.cause: mode})
    assert set(nothing_at_its_peak(engine, fit)) == (set() if resonates else {mode.cause})
