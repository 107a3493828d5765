"""The kind of excitation is recognised from the reference, noisy or not."""

import numpy as np
import pytest
import rig
import shaken
from lab_records import EXCITATIONS, RATE_HZ, X_ONLY, noise
from scipy.signal import butter, lfilter

from frac_accel.identification.response.excitation import excited_band, powerful_band
from frac_accel.identification.response.recognise import recognise


def reference(excitation, rng, noise_level):
    clean = excitation.reference[:, 0]
    return clean + noise_level * clean.std() * noise(rng, len(clean))


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_kinds(kind):
    for seed in range(3):
        rng = np.random.default_rng(20400 + seed)
        excitation = EXCITATIONS[kind](rng)
        for noise_level in (0.0, 0.03):
            found = recognise(reference(excitation, rng, noise_level), RATE_HZ)
            assert found.kind == kind, found.words


def test_dwells_are_counted_and_placed():
    for seed in range(4):
        rng = np.random.default_rng(20410 + seed)
        count = int(rng.integers(3, 12))
        frequencies = np.sort(rng.uniform(30, 700, 3 * count))[::3]
        excitation = rig.stepped_sine(RATE_HZ, 0.6 * count, rng.permutation(frequencies), X_ONLY)
        found = recognise(reference(excitation, rng, 0.01), RATE_HZ)
        assert found.kind == "stepped_sine"
        assert f"{count} dwells" in found.words
        edges = np.linspace(0, 0.6 * count * RATE_HZ, count + 1)
        middles = [(tone.start + tone.stop) / 2 for tone in found.tones]
        assert np.all(np.abs(middles - (edges[:-1] + edges[1:]) / 2) < 0.1 * RATE_HZ)
        got = np.sort([tone.frequency_hz for tone in found.tones])
        np.testing.assert_allclose(got, frequencies, atol=1.0)


def test_period_is_found_to_the_sample():
    for seed in range(6):
        rng = np.random.default_rng(20420 + seed)
        period = int(rng.integers(400, 1200))
        low = 2 * RATE_HZ / period
        excitation = rig.multisine(rng, RATE_HZ, 4.0, (low, rng.uniform(200, 900)),
                                   period / RATE_HZ, X_ONLY, lead_s=0.5)
        found = recognise(reference(excitation, rng, 0.1), RATE_HZ)
        assert (found.kind, found.period_samples) == ("multisine", period)


def test_a_period_of_no_whole_number_of_samples_is_noise():
    for seed in range(6):
        rng = np.random.default_rng(20430 + seed)
        # long enough for no multiple within half the record to be a whole number either
        period_s = (int(rng.integers(1400, 1900)) + rng.uniform(0.2, 0.4)) / RATE_HZ
        lines = np.arange(3, int(500 * period_s)) / period_s
        phases = 2 * np.pi * rng.random(len(lines))
        times = np.arange(8000) / RATE_HZ
        values = np.sin(2 * np.pi * np.outer(times, lines) + phases).sum(axis=1)
        assert recognise(values, RATE_HZ).kind == "noise"


def test_one_sine():
    found = recognise(rig.sines(RATE_HZ, 4.0, [300.0], [0.0], X_ONLY, lead_s=1.0).reference[:, 0],
                      RATE_HZ)
    assert (found.kind, found.words) == ("sine", "sine at 300 Hz")


def test_narrow_noise_and_bursts_are_noise():
    rng = np.random.default_rng(20440)
    for excitation in (rig.band_noise(rng, RATE_HZ, 5.0, (290.0, 310.0), X_ONLY, lead_s=1.0),
                       rig.noise_bursts(rng, RATE_HZ, 5.0, (5.0, 700.0), (1, 2, 4), X_ONLY)):
        assert recognise(excitation.reference[:, 0], RATE_HZ).kind == "noise"


@pytest.mark.parametrize("rate, first, last, evenly, words", [
    (50_000.0, 30.0, 15_000.0, "octaves", "logarithmically swept sine from"),
    (50_000.0, 15_000.0, 30.0, "octaves", "logarithmically swept sine from"),
    (2000.0, 5.0, 600.0, "octaves", "logarithmically swept sine from"),
    (2000.0, 5.0, 600.0, "Hz", "swept sine from")])
def test_a_fast_sweep_is_one_and_says_how_it_goes(rate, first, last, evenly, words):
    """In half a second: no stretch of it has a straight phase."""
    rng = np.random.default_rng(20450)
    motion = shaken.sweep(rate, 24_000, first, last, evenly)[::shaken.OVERSAMPLING]
    found = recognise(motion + 0.01 * rng.standard_normal(len(motion)), rate)
    assert found.kind == "sweep" and found.words.startswith(words)
    np.testing.assert_allclose(found.band_hz, sorted([first, last]), rtol=0.1,
                               atol=0.01 * last if evenly == "Hz" else 0.0)


@pytest.mark.parametrize("band", [(5.0, 150.0), (40.0, 250.0)])
def test_the_excited_band_is_the_references_own(band):
    """Though the sensor follows it in a part of it only."""
    rng = np.random.default_rng(20451)
    rate, n = 600.0, 6000
    moving = rig.band_noise(rng, rate, n / rate, band, X_ONLY, lead_s=1.0).reference[:, 0]
    moving = moving + 1e-3 * rng.standard_normal(n)
    np.testing.assert_allclose(powerful_band(moving, rate), band, atol=1.0)
    half = lfilter(*butter(4, band[1] / 2, fs=rate), moving)
    followed = excited_band(moving, half + 0.1 * rng.standard_normal(n), rate)
    assert 0.5 * band[1] < followed[1] < 0.8 * band[1]


def test_slow_motion_of_a_sensor_that_answers_for_long_is_followed():
    """Its decay lasts as long as a short segment of the record."""
    rng = np.random.default_rng(20452)
    rate, n = 100.0, 6000
    spectrum = np.zeros(n + 1, complex)
    frequency = np.fft.rfftfreq(2 * n, 1 / rate)
    inside = (frequency > 0.02) & (frequency < 1.5)
    spectrum[inside] = np.exp(2j * np.pi * rng.random(inside.sum()))
    s = 2j * np.pi * frequency
    moving, answer = (np.fft.irfft(spectrum * response, 2 * n)[:n]
                      for response in (1.0, 1 / (s / (2 * np.pi * 0.1) + 1)**2))
    low, high = excited_band(moving, answer + 1e-3 * answer.std() * rng.standard_normal(n), rate)
    assert low <= 0.3 and high == pytest.approx(1.5, abs=0.3)
