"""Play behind the core: against a fine walk along the exact motion, undone, found again."""

import numpy as np
import pytest
from second_set_bench import RATE, Multisine, model, samples, times

from frac_accel import Corrector, LiveSimulator, simulate
from frac_accel.diagnosis import diagnose
from frac_accel.errors import DesignError

FINE = 64


def record(seed, gap, duration_s=12.0, top_hz=140.0):
    """Exact steady motion at 64 times the rate, and the output that is moved by either end."""
    sine = Multisine(np.random.default_rng(seed), band_hz=(1.0, top_hz))
    fine = np.arange(round(duration_s * RATE) * FINE) / (RATE * FINE)
    moved, y = [], 0.0
    for x in sine.motion(fine).tolist():
        y = min(max(y, x - gap / 2), x + gap / 2)
        moved.append(y)
    t = times(duration_s)
    return t, sine.acceleration(t), np.array(moved[::FINE])


@pytest.mark.parametrize("gap", [0.02, 0.5])
def test_simulated_as_the_play_of_the_fine_motion(gap):
    t, reference, moved = record(1, gap, 4.0)
    simulated = simulate(model({"cause": "backlash", "gap": gap}), reference, RATE, axis="x")
    # the motion from before the record has died away, and between samples the end, where the
    # reference is cut off, is far
    inside = slice(300, -800)
    assert np.std((simulated - moved)[inside]) < 1e-3 * np.std(moved)


def test_links_act_on_what_the_play_passes_on():
    """A delay of whole samples and a gain behind it: the same output, later and larger."""
    t, reference, _ = record(2, 0.3, 4.0)
    play = {"cause": "backlash", "gap": 0.3}
    plain = simulate(model(play), reference, RATE, axis="x")
    later = simulate(model(play, {"cause": "time_delay", "delay_s": 3 / RATE},
                           {"cause": "sensitivity_error", "gain": 2.0}), reference, RATE, axis="x")
    np.testing.assert_allclose(later[303:-100], 2 * plain[300:-103], atol=2e-3)


def test_corrector_tells_the_end_of_the_play_and_says_what_it_cannot_know():
    gap = 0.4
    t, reference, moved = record(3, gap, 8.0, top_hz=25.0)
    made, results = samples(t, moved), []
    with_play = model({"cause": "backlash", "gap": gap})
    for cuts in ([0, len(t)], [0, 1, 2, 700, 701, 2500, len(t)]):
        corrector = Corrector(with_play, RATE, noise_std=1e-3, bandwidth_hz=110.0)
        parts = [corrector.process(made.stamps_ns[a:b], made.values[a:b])
                 for a, b in zip(cuts, cuts[1:])]
        results.append(tuple(np.concatenate([getattr(part, name) for part in parts])
                             for name in ("index", "values", "variance")))
    assert all(np.array_equal(one, other) for one, other in zip(*results))
    index, values, variance = results[0]
    inside = slice(300, -300)
    error = (values[:, 0] - reference[index])[inside]
    plain = Corrector(model(), RATE, noise_std=1e-3, bandwidth_hz=110.0).process(
        made.stamps_ns, made.values)
    before = (plain.values[:, 0] - reference[plain.index])[inside]
    assert np.std(error) < 0.6 * np.std(before)
    # what is not known of the ends is most of the error, and is in the variance
    assert 0.3 < np.sqrt(variance[inside, 0].mean()) / np.std(error) < 3


@pytest.mark.parametrize("gap", [0.05, 0.4])
def test_found_again_and_nothing_else(gap):
    t, reference, moved = record(4, gap)
    values = moved + 0.005 * np.random.default_rng(4).normal(size=len(t))
    found = diagnose((samples(t, reference), samples(t, values)), model(), "x")
    assert [finding.cause for finding in found.findings] == ["backlash"]
    assert abs(found.findings[0].effect.gap / gap - 1) < 0.03


def test_cannot_be_played_live():
    with pytest.raises(DesignError, match="offline"):
        LiveSimulator(model({"cause": "backlash", "gap": 0.1}), RATE)
