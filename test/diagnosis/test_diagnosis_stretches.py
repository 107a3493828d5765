"""A very long record is fitted by stretches, and judged as a whole; here "very long" is short."""

import numpy as np
import pytest
from rig.road import draw_drive, drive_on_road

import frac_accel
from frac_accel.diagnosis import engine, stretches
from frac_accel.diagnosis.problem import Problem
from frac_accel.model.core import Gain, Oscillator
from frac_accel.model.effects import known_effects
from frac_accel.record import Record
from frac_accel.record.sources import pair_of

RATE, NOISE = 100.0, 0.006


@pytest.fixture(autouse=True)
def a_short_record_is_long(monkeypatch):
    for module, name, value in ((stretches, "MOST", 10_000), (stretches, "_LENGTH", 2000),
                                (engine, "LONG", 4000)):
        monkeypatch.setattr(module, name, value)


def drive(seed):
    rng = np.random.default_rng(seed)
    motion = drive_on_road(rng, RATE, 240.0, draw_drive(rng)).reference[:, 0]
    return rng, motion, np.arange(len(motion)) / RATE


def diagnosed(rng, motion, output, noise=NOISE):
    sensor = output + noise * np.std(motion) * rng.standard_normal(len(output))
    return frac_accel.diagnose((motion, sensor), frac_accel.SensorModel(Gain(1.0)),
                               sampling_rate_hz=RATE)


@pytest.mark.parametrize("seed", [3401, 3402])
def test_a_step_between_the_stretches_is_found_and_dated(seed):
    rng, motion, time = drive(seed)
    at_s, ratio = rng.uniform(0.3, 0.7) * time[-1], rng.uniform(0.85, 0.95)
    found = diagnosed(rng, motion, np.where(time < at_s, motion, ratio * motion))
    (finding,) = found.findings
    assert finding.cause == "gain_step"
    assert abs(finding.effect.ratio - ratio) < 5 * finding.std["ratio"]
    assert abs(finding.effect.at_s - at_s) < 5 * finding.std["at_s"] < 2.0


@pytest.mark.parametrize("seed", [3411, 3412])
def test_what_no_stretch_shows_counts_for_the_verdict(seed):
    rng, motion, time = drive(seed)
    record = Record.of(*pair_of((motion, motion), RATE, "x", "", ""), "x", None)
    seen = np.zeros(len(motion), bool)
    for rows in stretches.stretches_of(record, 0):
        seen[rows] = True
    assert 0.3 < seen.mean() < 0.6
    healthy = diagnosed(rng, motion, motion)
    assert healthy.verdict == "consistent"
    noisy = motion + ~seen * 0.2 * np.std(motion) * rng.standard_normal(len(motion))
    found = diagnosed(rng, motion, noisy)
    assert found.verdict == "undecided"
    assert not found.findings


@pytest.mark.parametrize("seed", [3421, 3422])
def test_stretches_are_simulated_as_the_whole_record_is(seed):
    rng, motion, _ = drive(seed)
    pair = pair_of((motion, motion), RATE, "x", "", "")
    record = Record.of(*pair, "x", None)
    own = frac_accel.SensorModel(
        Oscillator(rng.uniform(8, 20), rng.uniform(0.4, 0.8), sensitivity=1.0))
    used = np.ones(len(record), bool)
    whole = Problem(record, 0, own, used)
    parts = stretches.Stretches(record, 0, own, used, None, stretches.stretches_of(record, 0))
    effects = {cause: known_effects()[cause](**values) for cause, values in (
        ("cubic_stiffness", {"alpha3": 1e-4}), ("gain_drift", {"rate_per_s": 1e-3}),
        ("clock_skew", {"skew_ppm": 40.0}))}
    expected, simulated = whole.simulate(effects), parts.simulate(effects)
    assert np.allclose(np.diff(parts.time)[:1000], 1 / RATE)
    error = (parts.taken(expected) - simulated)[parts.used & (np.abs(parts.taken(motion)) < 1e9)]
    # what was before each stretch is over after a second
    later = np.concatenate([np.arange(len(part)) > RATE for part in
                            parts._split(simulated)])[parts.used]
    assert np.sqrt(np.mean(error[later]**2)) < 2e-3 * np.std(expected)
