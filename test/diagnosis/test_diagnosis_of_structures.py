"""Two places of one structure: the second is no sensor of the first, and nothing has a name."""

import numpy as np
import pytest
import scipy.signal as sig
from rig.oscillator import integrate

import frac_accel
from frac_accel.diagnosis.leftover import leftover
from frac_accel.diagnosis.problem import Problem
from frac_accel.diagnosis.search import Search
from frac_accel.model.core import Gain
from frac_accel.model.effects import known_effects
from frac_accel.record import Record
from frac_accel.record.sources import pair_of

RATE = 200.0


def mode(drive, frequency_hz, damping=0.05):
    pole = np.exp(2 * np.pi * frequency_hz / RATE * (-damping + 1j * np.sqrt(1 - damping**2)))
    values = sig.lfilter([1.0], np.real(np.poly([pole, pole.conj()])), drive)
    return values / np.std(values)


def column(rng, n, later):
    """Base and top of a column that the deck moves, as traffic does, and a quake only a little; the
    base follows some samples later."""
    time = np.arange(n + later) / RATE
    burst = 0.1 + np.exp(-((time - 12) / 4)**2)
    traffic, quake = burst * rng.normal(size=(2, n + later))
    top = mode(traffic, 3.3) + 0.5 * mode(traffic, 9.0) + 0.3 * mode(quake, 3.3)
    ground = sig.lfilter(*sig.butter(2, [0.02, 0.3], "bandpass"), quake)
    base = 0.5 * np.roll(top, later) + ground / 0.75
    return base[later:], top[later:]


def test_a_model_that_answers_before_the_motion_says_so():
    found = frac_accel.diagnose(column(np.random.default_rng([1, 5]), 6000, 20),
                                sampling_rate_hz=RATE)
    assert found.verdict == "unexplained" and not found.findings
    assert "it answers 0.1 s before the reference moves, which no sensor does" in found.reason
    assert "another place of a structure" in found.reason


def test_a_sensor_that_answers_after_the_motion_is_not_said_to_be_early():
    found = frac_accel.diagnose(column(np.random.default_rng([1, 5]), 6000, 20)[::-1],
                                sampling_rate_hz=RATE)
    assert "before the reference moves" not in found.reason


def test_a_gain_that_no_motion_shows_does_not_end_at_exactly_none():
    """Beside a gain of none nothing else has a derivative, and no cause has a scale."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 4000))
    y -= x * (x @ y) / (x @ x) + 6e-3 * x
    record = Record.of(*pair_of((x, y), RATE, "x", "", ""), "x", None)
    problem = Problem(record, 0, frac_accel.SensorModel(Gain(1.0)), np.ones(4000, bool))
    fit = problem.fit({"sensitivity_error": known_effects()["sensitivity_error"](1.0)})
    assert 0 < abs(fit.effects["sensitivity_error"].gain) < 0.1 and np.std(fit.simulated) > 0


def test_a_fit_that_ended_at_a_gain_of_none_has_a_scale_and_is_followed_by_nothing():
    """As where the time limit ends it there."""
    x, y = np.random.default_rng(0).normal(size=(2, 4000))
    record = Record.of(*pair_of((x, y), RATE, "x", "", ""), "x", None)
    problem = Problem(record, 0, frac_accel.SensorModel(Gain(1.0)), np.ones(4000, bool))
    fit = problem.fit({"sensitivity_error": known_effects()["sensitivity_error"](0.0)}, 0)
    assert Search(problem).view(fit).level == problem.scales.level > 0
    assert leftover(fit.residual, fit.simulated, problem.used).share == 0


def test_a_search_that_was_cut_still_gets_its_description():
    rng = np.random.default_rng(0)
    x = rng.normal(size=8000)
    y = sig.lfilter(*sig.cheby1(5, 1, 0.3), x) + 0.01 * rng.normal(size=8000)
    found = frac_accel.diagnose((x, y), frac_accel.SensorModel(Gain(1.0)), sampling_rate_hz=RATE,
                                time_limit_s=1e-3)
    assert "a fitted filter" in found.reason and "was cut" in found.cut_off
    assert found.extended["nrmse"] < 0.03 and not found.findings


def test_it_says_that_an_event_was_too_short_for_a_filter():
    rng = np.random.default_rng(3)
    x = rng.normal(size=6000) * (0.01 + np.exp(-((np.arange(6000) - 3000) / 60.0)**2))
    found = frac_accel.diagnose((x, 0.9 * x + 0.01 * rng.normal(size=6000)),
                                frac_accel.SensorModel(Gain(1.0)), sampling_rate_hz=RATE,
                                time_limit_s=1e-3)
    assert any("could be judged on other data" in words for words in found.integrity.words)


@pytest.mark.parametrize("seed", [2, 3])
@pytest.mark.parametrize("softening", [0.0, 2e-3])
def test_a_part_that_rings_is_a_second_resonance_while_it_is_linear(seed, softening):
    rng, fine, n = np.random.default_rng([23, seed]), 16, 12_000
    base = sig.sosfilt(sig.butter(2, [1.0, 20.0], "band", fs=RATE * fine, output="sos"),
                       rng.normal(size=n * fine))
    base *= np.clip(np.arange(n * fine) / (RATE * fine), 0, 1) / base.std()
    frequency_hz, share = rng.uniform(7, 10), rng.uniform(0.03, 0.05)
    part = integrate(np.append(base, base[-1]), 1 / (RATE * fine), frequency_hz, 0.03,
                     alpha3=-softening).q[:n * fine]
    pair = tuple(values[::fine] + 0.0015 * values.std() * rng.standard_normal(n)
                 for values in (base, (1 - share) * base + share * part))
    found = frac_accel.diagnose(pair, frac_accel.SensorModel(Gain(1.0)), sampling_rate_hz=RATE)
    if softening:
        assert not found.findings and found.verdict == "unexplained"
        assert "lies at its resonance" in found.suspects[0]["reason"]
    else:
        assert [finding.cause for finding in found.findings] == ["second_resonance"]
