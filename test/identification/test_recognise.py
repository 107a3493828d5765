"""The kind of excitation is recognised from the reference, noisy or not."""

import numpy as np
import pytest
import rig
from lab_records import EXCITATIONS, RATE_HZ, X_ONLY, noise

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
