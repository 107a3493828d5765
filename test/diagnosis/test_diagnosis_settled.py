"""A zero that is right long before the record ends, where its end is what is judged by."""

from types import SimpleNamespace

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import butter, sosfiltfilt

from frac_accel import Samples, SensorModel, diagnose
from frac_accel.diagnosis.doubts import left_open
from frac_accel.diagnosis.naming import moved
from frac_accel.diagnosis.verdict import _kept
from frac_accel.model.core import Gain
from frac_accel.model.effects import effect_of
from frac_accel.validation import validate

RATE, FINER, DURATION_S = 100.0, 4, 240.0


def settling(seed, constant_s=(8.0, 20.0), quiet_s=0.0):
    """Reference and sensor with a zero that settles within a sixth of the record, on 0; its law.

    The motion may be less at the start, for so long.
    """
    rng = np.random.default_rng(seed)
    fine = FINER * RATE
    motion = sosfiltfilt(butter(4, [0.3, 20.0], "band", fs=fine, output="sos"),
                         rng.normal(size=round(fine * DURATION_S)))
    motion /= motion.std()
    motion[:round(fine * quiet_s)] *= 0.5
    size, constant_s = rng.choice([-1, 1]) * rng.uniform(0.1, 0.4), rng.uniform(*constant_s)
    time = np.arange(len(motion)) / fine
    sensor = motion + size * np.exp(-time / constant_s)
    return sampled_pair(rng, (motion, sensor), FINER, RATE, 0.005), -size, constant_s


@pytest.mark.parametrize("seed", range(4))
def test_a_zero_that_has_settled_is_named(seed):
    record, size, constant_s = settling(seed)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert found.verdict == "explained"
    named = {finding.cause: finding for finding in found.findings}
    assert named.keys() == {"warm_up_drift"}
    settled = named["warm_up_drift"]
    assert settled.effect.settles_at == "zero"
    assert abs(settled.effect.size + size) < 4 * settled.std["size"]
    assert abs(settled.effect.time_constant_s - constant_s) < 4 * settled.std["time_constant_s"]
    assert found.extended["nrmse"] < 0.01


@pytest.mark.parametrize("seed", [6, 7])
def test_it_is_named_beside_what_does_far_more_where_it_is_judged(seed):
    """There it has settled: it might "mend what a delay lacks", it was said."""
    (reference, sensor), *_ = settling(seed, (8.0, 14.0))
    late = Samples.of(sensor.stamps_ns + 20_000_000, sensor.values)
    found = diagnose((reference, late), SensorModel(Gain(1.0)), time_limit_s=60)
    assert {finding.cause for finding in found.findings} == {"warm_up_drift", "time_delay"}


@pytest.mark.parametrize("seed", [4, 5])
def test_one_quiet_instant_at_the_start_makes_no_course_of_the_motions_level(seed):
    """That warmed something up in just such a course, it was said: no name."""
    record, size, constant_s = settling(seed, (60.0, 80.0), 2.5)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert {finding.cause for finding in found.findings} == {"warm_up_drift"}


@pytest.mark.parametrize("follows", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_a_drift_in_time_is_told_from_a_level_that_rises_with_it(follows):
    """The two correlate by 0.96 and more, and one of them describes the record far better."""
    rng = np.random.default_rng(11)
    fine = FINER * RATE
    time = np.arange(round(fine * DURATION_S)) / (fine * DURATION_S)
    level = 0.6 + time + 0.1 * np.sin(2 * np.pi * (2.3 * time + rng.random()))
    motion = level * sosfiltfilt(butter(4, [0.3, 20.0], "band", fs=fine, output="sos"),
                                 rng.normal(size=len(time)))
    assert np.corrcoef(level, time)[0, 1] > 0.96
    zero = 0.1 * (level if follows else time)
    record = sampled_pair(rng, (motion / motion.std(), motion / motion.std() + zero), FINER, RATE,
                          0.005)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert ("offset_drift" in {finding.cause for finding in found.findings}) != follows
    # without a name it is described: 0.0052 is noise
    assert found.extended["nrmse"] < 0.012 < 0.03 < found.baseline["nrmse"]
    assert found.extended["nrmse"] == pytest.approx(
        validate(record, found.model).whole_nrmse, rel=0.2)


def test_a_zero_that_settles_with_a_measured_temperature_may_follow_either():
    """A thermometer's own noise made the law in time the better one by some variances of the
    noise, and it was named. What both describe stays in the model."""
    record, size, constant_s = settling(21, (30.0, 40.0))
    rng = np.random.default_rng(22)
    stamps, time = record[0].stamps_ns[::100], np.arange(0.0, DURATION_S)
    celsius = 25 + 8 * np.exp(-time / constant_s) + rng.normal(0, 0.03, len(time))
    found = diagnose(record, SensorModel(Gain(1.0)), temperature=(stamps, celsius),
                     time_limit_s=60)
    assert "warm_up_drift" not in {finding.cause for finding in found.findings}
    assert found.extended["nrmse"] < 0.012 < 0.03 < found.baseline["nrmse"]


@pytest.mark.parametrize("is_written", [True, False])
def test_what_a_free_motion_describes_is_in_no_model_file(is_written, monkeypatch):
    """1.0 % was claimed of a scan, and the file left 61 %: a high-pass with a motion of its own."""
    monkeypatch.setattr("frac_accel.diagnosis.verdict.left_open", lambda *given: {})
    rng = np.random.default_rng(31)
    measured = np.cumsum(rng.normal(size=4000))
    described = measured + 0.1 * rng.normal(size=4000)
    high_pass = effect_of("ac_coupling")(0.01)
    fitted = SimpleNamespace(effects={}, causes=set(), output=0 * measured, simulated=0 * measured)
    wider = SimpleNamespace(effects={"ac_coupling": high_pass}, causes={"ac_coupling"},
                            output=described, simulated=described if is_written else -measured)
    engine = SimpleNamespace(
        problem=SimpleNamespace(recorded=measured,
                                limit=SimpleNamespace(ends_judging=lambda words: False)),
        held_out_rows=np.arange(4000) % 1000 > 700, learnt=lambda fit: fit,
        search=SimpleNamespace(fit=lambda effects: wider, to_its_best=lambda fit: fit),
        hollow=lambda fit: False, uncertainties=lambda fit: {})
    kept = _kept(engine, SimpleNamespace(fitted=fitted, findings=[]), wider, measured.std(), {})
    assert (kept is not None) == is_written


def test_what_was_open_and_gave_way_to_another_cause_has_not_moved():
    engine = SimpleNamespace(loose={"sensitivity_error": None})
    assert moved(engine, SimpleNamespace(effects={}), {}, "") == ([], {})


def test_what_the_record_shows_by_itself_is_not_open():
    """It has no unknown in a fit, and no uncertainty there; that was a traceback."""
    noise = effect_of("reference_noise")(0.1, (0.0, 1.0), (1.0, 0.0))
    problem = SimpleNamespace(baseline=SensorModel(Gain(1.0)), axis=0, time=np.arange(9.0))
    fitted = SimpleNamespace(unknowns=(), theta=(), effects={noise.cause: noise})
    assert left_open(SimpleNamespace(problem=problem), fitted, {}, {noise.cause}) == {}
