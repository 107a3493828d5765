"""A gain or a zero that drifts along a course that follows no law: what a simulated road knows."""

from unittest import mock

import numpy as np
import pytest
from rig.hidden import draw_case
from sampled_pair import sampled_pair
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt
from searched import searched

from frac_accel import SensorModel, diagnose, validate
from frac_accel.diagnosis.courses import course_of
from frac_accel.errors import FracAccelError
from frac_accel.model.core import Gain
from frac_accel.report.diagnosis import diagnosis_page

RATE, FINER, DURATION_S = 100.0, 4, 240.0


def course(rng, periods):
    """A course of few waves of any phase, without a mean, of unit standard deviation."""
    sizes, turns = rng.normal(size=3), rng.uniform(0, 2 * np.pi, 3)
    waves = rng.uniform(0.3, periods, 3)
    place = np.linspace(0, 1, round(RATE * FINER * DURATION_S))
    values = sum(size * np.sin(2 * np.pi * wave * place + turn)
                 for size, wave, turn in zip(sizes, waves, turns)) + rng.normal() * place
    return (values - values.mean()) / values.std()


def pair(seed, sensor, motion_hz=(0.3, 20.0)):
    """Reference and sensor, as (motion, fine time, fine rate) makes it, with noise of 0.5 %."""
    rng = np.random.default_rng(seed)
    fine = FINER * RATE
    motion = sosfiltfilt(butter(4, motion_hz, "band", fs=fine, output="sos"),
                         rng.normal(size=round(fine * DURATION_S)))
    motion /= motion.std()
    return sampled_pair(rng, (motion, sensor(rng, motion, fine)), FINER, RATE, 0.005)


def drifting_zero(rng, motion, rate):
    return 1.02 * motion + rng.uniform(0.05, 0.5) * course(rng, 3)


def drifting_gain(rng, motion, rate):
    return motion * (1 + rng.uniform(0.03, 0.15) * course(rng, 2)) + 0.05


@pytest.mark.parametrize(("sensor", "cause"), [(drifting_zero, "offset_drift"),
                                               (drifting_gain, "gain_drift")])
@pytest.mark.parametrize("seed", range(2))
def test_a_course_is_found_and_what_is_written_does_what_is_claimed(sensor, cause, seed, tmp_path):
    record = pair(seed, sensor)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert found.verdict == "explained"
    assert cause in [finding.cause for finding in found.findings]
    assert {finding.cause for finding in found.findings} <= {cause, "offset", "sensitivity_error"}
    assert found.extended["nrmse"] < 0.01
    found.model.save(tmp_path / "model.yaml")
    validated = validate(record, SensorModel.load(tmp_path / "model.yaml"))
    assert cause in diagnosis_page(found).html()
    assert validated.whole_nrmse == pytest.approx(found.extended["nrmse"], rel=0.2)


def lagging(rng, motion, rate):
    frequency = np.fft.rfftfreq(len(motion), 1 / rate)
    low = np.fft.irfft(np.fft.rfft(motion) / (1 + 1j * frequency / 12.0), len(motion))
    return low + 0.8 * course(rng, 3)


def test_all_else_is_found_beside_a_zero_that_drifts():
    found = diagnose(pair(7, lagging), SensorModel(Gain(1.0)), time_limit_s=60)
    effects = {finding.cause: finding for finding in found.findings}
    assert effects.keys() == {"offset_drift", "low_pass_lag"}
    lag = effects["low_pass_lag"]
    assert abs(lag.effect.corner_hz - 12.0) < 4 * lag.std["corner_hz"] + 0.02
    assert found.extended["nrmse"] < 0.01


def slow_high_pass(rng, motion, rate):
    """Of second order, which no cause says."""
    return sosfilt(butter(2, 0.02, "high", fs=rate, output="sos"), motion)


def wandering_delay(rng, motion, rate):
    time = np.arange(len(motion)) / rate
    return np.interp(time - 0.004 * course(rng, 2), time, motion)


@pytest.mark.parametrize(("sensor", "motion_hz"), [
    (slow_high_pass, (0.004, 20.0)), (wandering_delay, (0.3, 20.0))])
@pytest.mark.parametrize("seed", range(2))
def test_what_only_looks_like_a_course_has_no_such_name(sensor, motion_hz, seed):
    found = diagnose(pair(seed, sensor, motion_hz), SensorModel(Gain(1.0)), time_limit_s=60)
    assert not {finding.cause for finding in found.findings} & {"offset_drift", "gain_drift"}


@pytest.mark.parametrize("seed", range(2))
def test_a_zero_that_follows_the_vibration_does_not_drift(seed):
    rng = np.random.default_rng(seed)
    fine = FINER * RATE
    level = 1 + 0.5 * course(rng, 2)
    motion = level * sosfiltfilt(butter(4, (0.5, 20.0), "band", fs=fine, output="sos"),
                                 rng.normal(size=len(level)))
    motion /= motion.std()
    output = motion + 0.1 * sosfilt(butter(1, 0.05, fs=fine, output="sos"), motion**2)
    record = sampled_pair(rng, (motion, output), FINER, RATE, 0.005)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert "offset_drift" not in {finding.cause for finding in found.findings}


@pytest.mark.parametrize("seed", range(2))
def test_a_gain_that_falls_with_the_level_does_not_drift(seed):
    """Slowly, and with what a first-order memory keeps of the slope's size."""
    rng = np.random.default_rng(seed)
    fine = FINER * RATE
    time = np.arange(round(fine * DURATION_S)) / fine
    frequency = 2 + 33 * time / time[-1]
    motion = np.sin(2 * np.pi * np.cumsum(frequency) / fine) * frequency**rng.uniform(0.5, 2)
    motion /= motion.std()
    slope = np.abs(np.gradient(motion))
    slow = sosfilt(butter(1, 0.02, fs=fine, output="sos"), slope / slope.std())
    record = sampled_pair(rng, (motion, motion / (1 + rng.uniform(0.1, 0.4) * slow)), FINER, RATE,
                          0.005)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert "gain_drift" not in {finding.cause for finding in found.findings}


@pytest.mark.parametrize("seed", range(2))
def test_an_automatic_gain_does_not_drift(seed):
    """It follows the envelope within seconds, faster than a course of few waves can."""
    rng = np.random.default_rng([64, seed])
    fine, seconds = FINER * RATE, 40.0
    count = round(fine * seconds)
    motion = sosfiltfilt(butter(2, [0.5, 25.0], "band", fs=fine, output="sos"),
                         rng.normal(size=count))
    drive = np.interp(np.arange(count) / fine, np.linspace(0, seconds, 9),
                      rng.uniform(0.4, 1.2, 9))
    motion *= drive / (motion * drive).std()
    fades = fine * rng.uniform(1.0, 5.0)
    keeps = np.exp(-1 / fades)
    before = np.mean(motion[:round(fades)]**2)
    envelope, _ = lfilter([1 - keeps], [1, -keeps], motion**2, zi=[keeps * before])
    gain = envelope**-rng.uniform(0.1, 0.4)
    record = sampled_pair(rng, (motion, motion * gain / gain.mean()), FINER, RATE, 0.003)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert found.findings == []


@pytest.mark.parametrize("fastest", [1.2e-3, 1.2e-4])
@pytest.mark.parametrize("seed", range(2))
def test_a_zero_that_settles_beside_a_gain_that_drifts(seed, fastest):
    """Beside the common causes alone, a course described it better than its law does; and it was
    judged where it had settled, as the gain drifts on."""
    rng = np.random.default_rng([63, seed])
    drift, settles_s = -fastest * rng.uniform(0.5, 1.0), rng.uniform(20.0, 35.0)

    def sensor(rng, motion, rate):
        time = np.arange(len(motion)) / rate
        return motion * (1 + drift * time) - 1.2 * np.exp(-time / settles_s)
    found = diagnose(pair([65, seed], sensor), SensorModel(Gain(1.0)), time_limit_s=60)
    findings = {finding.cause: finding for finding in found.findings}
    assert findings.keys() == {"gain_drift", "warm_up_drift"}
    settling = findings["warm_up_drift"]
    assert abs(settling.effect.time_constant_s - settles_s) \
        < 4 * settling.std["time_constant_s"] < 0.05 * settles_s


@pytest.mark.thorough
def test_a_course_is_not_sought_where_the_motion_beside_it_has_no_bound():
    """Without what changes along the record beside it, a spring may not hold its load: that ended
    the diagnosis with an error."""
    _, engine, best = searched(draw_case(0, ["offset_drift"]), time_limit_s=10)
    with mock.patch.object(engine.problem, "simulate", side_effect=FracAccelError("no bound")):
        assert course_of(engine, best) == {}


def test_a_zero_that_wanders_about_a_constant_has_both_names():
    """All of it was the drift's, whose course began and ended far from none."""
    rng = np.random.default_rng(66)
    constant = rng.uniform(0.3, 0.6)

    def sensor(rng, motion, rate):
        place = np.linspace(0, 1, len(motion))
        return motion - constant + 0.02 * np.cos(5 * np.pi * place) + 0.015 * np.cos(
            3 * np.pi * place)
    found = diagnose(pair([66, 1], sensor), SensorModel(Gain(1.0)))
    findings = {finding.cause: finding for finding in found.findings}
    assert findings.keys() == {"offset", "offset_drift"}
    assert findings["offset"].effect.offset == pytest.approx(-constant, abs=0.005)
