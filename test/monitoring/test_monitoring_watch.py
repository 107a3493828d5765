"""A running sensor: a change is noticed, dated and diagnosed; a healthy one gives no alarm."""

import numpy as np
import pytest
from monitoring_rig import MODEL, ChangingDrive, chunks

from frac_accel import diagnose
from frac_accel.model import SensorModel
from frac_accel.monitoring.blocks import Blocks, _directions
from frac_accel.monitoring.detector import Detector, _bet
from frac_accel.monitoring.trial import Trial
from frac_accel.monitoring.watch import ENOUGH_S, Watch


def watched(drive, model, lost_s=()):
    """A watch after a drive, and when it noticed something [s]; some chunks of 1 s are lost."""
    watch, noticed = Watch(model), None
    for number, parts in enumerate(zip(*map(chunks, drive.samples()))):
        if number in lost_s:
            continue
        for window in watch.add(*parts):
            if watch.changed is not None and noticed is None:
                noticed = drive.since_start_s(window.stop_ns)
        if watch.changed is not None and watch.excited_since_s() >= ENOUGH_S:
            break
    return watch, noticed


@pytest.fixture(scope="module")
def model():
    return SensorModel.from_dict(MODEL)


@pytest.mark.parametrize("seed, effects", [
    (3, {"offset": {"offset": 0.08}}), (4, {"low_pass_lag": {"corner_hz": 250.0}}),
    *(pytest.param(*more, marks=pytest.mark.long) for more in (
        (1, {"sensitivity_error": {"gain": 1.03}}), (2, {"time_delay": {"delay_s": 6e-4}})))])
def test_a_sudden_change_is_dated_and_named(model, seed, effects):
    at_s = 400.0 + np.random.default_rng(seed).uniform(0, 60)
    drive = ChangingDrive(seed, effects, at_s)
    watch, noticed = watched(drive, model)
    assert at_s < noticed < at_s + 70
    change = watch.changed
    assert not change.is_gradual
    assert abs(drive.since_start_s(change.ns) - at_s) < 2.0
    assert drive.since_start_s(change.low_ns) <= at_s <= drive.since_start_s(change.high_ns)
    found = diagnose(watch.to_diagnose(), model, time_limit_s=60)
    assert [finding.cause for finding in found.findings] == list(effects)
    # it wins on what was recorded afterwards, and a model that is no better does not
    trial, worse = Trial(), Trial()
    later, _ = watched(ChangingDrive(seed + 100, effects, 0.0, duration_s=120.0), model)
    for window in later._recent:
        trial.add(window.rms, later.residual_rms(found.model, window))
        worse.add(window.rms, window.rms)
    assert trial.verdict == "won" and trial.gain > 0.1
    assert worse.verdict != "won"


@pytest.mark.parametrize("seed, at_s, ramp_s, gain", [
    (5, 330.0, 200.0, 1.1),
    # it brakes just after the onset: what is level in one window is none in the next
    pytest.param(1110, 505.83, 60.0, 1.05, marks=pytest.mark.thorough)])
def test_a_growing_change_is_dated_with_an_interval_that_holds_it(
        model, seed, at_s, ramp_s, gain):
    drive = ChangingDrive(seed, {"sensitivity_error": {"gain": gain}}, at_s, ramp_s, 720.0)
    watch, noticed = watched(drive, model)
    change = watch.changed
    assert noticed > at_s and change.is_gradual
    assert drive.since_start_s(change.low_ns) <= at_s <= drive.since_start_s(change.high_ns)


def test_blocks_about_the_centres_of_their_windows_are_turned_to_one():
    rng = np.random.default_rng(9)
    output, others, residual = rng.normal(2.0, 1.0, 300), rng.normal(0.5, 1.0, (300, 2)), \
        rng.normal(size=300)

    def sums(centres):
        """Of three blocks, each about a centre of its own."""
        parts = []
        for rows, centre in zip(np.split(np.arange(300), 3), centres):
            x = _directions(output - centre[0], others - centre[1:], 100.0)[rows]
            parts.append((0, len(rows), x.T @ x, x.T @ residual[rows],
                          residual[rows] @ residual[rows], centre))
        return Blocks(*map(np.array, zip(*parts)), 1.0)

    centres = rng.normal(size=(3, 3))
    turned, direct = sums(centres).about_one_centre(), sums(centres[[2, 2, 2]])
    for name in ("gram", "shared", "centre"):
        np.testing.assert_allclose(getattr(turned, name), getattr(direct, name), rtol=1e-9,
                                   atol=1e-8)


def test_a_healthy_drive_gives_no_alarm_and_costs_little(model):
    import time
    drive = ChangingDrive(6, {})
    began = time.process_time()
    # nor do gaps, over which nobody knows how the motion went on
    watch, noticed = watched(drive, model, [200, *range(300, 325), 401, 402])
    assert noticed is None and not watch.learning and watch.windows > 50
    assert watch.detector.statistic < watch.detector.threshold / 100
    # of a core, with the making of the chunks
    assert (time.process_time() - began) / 600 < 0.02
    reference, sensor = watch.to_diagnose()
    assert 20 < np.ptp(sensor.stamps_ns) * 1e-9 < 70


def test_bets_on_uniform_p_values_are_fair():
    p_values = (np.arange(2_000_000) + 0.5) / 2_000_000
    # the tail below the first point holds 1 / ln of it
    assert np.mean(_bet(p_values)) == pytest.approx(1 - 1 / np.log(2_000_000), abs=0.02)


class Scored:
    """Blocks' stand-in: the scores themselves, of noise that remembers and is not normal."""

    def __init__(self, rng, learnt=None):
        self.power = np.ones(1)
        self.rng = rng

    def scores(self, merged):
        return np.abs(self.rng.standard_t(3, (1, 9)))


@pytest.mark.parametrize("hours", [0.1, pytest.param(1.0, marks=pytest.mark.long)])
def test_false_alarms_are_as_rare_as_stated(hours):
    """Mean time to an alarm at thresholds that can be waited for; the theorem says at least."""
    rng, times = np.random.default_rng(7), []
    for seed in range(30):
        detector = Detector(hours, seed)
        detector.learnt = Scored(rng)
        limit, count = 10 * detector.threshold, 0
        while count < limit:
            count += 1
            if detector.add(detector.learnt):
                break
        times.append(count)
    mean, error = np.mean(times), np.std(times) / np.sqrt(len(times))
    # an alarm counts from the first sample; the mean is at least the threshold
    assert mean + 2 * error > detector.threshold, (mean, detector.threshold)


def test_a_trial_is_rarely_won_by_a_model_that_is_no_better():
    rng, won = np.random.default_rng(8), 0
    for _ in range(500):
        trial = Trial()
        while trial.verdict == "open":
            trial.add(1.0, np.exp(0.05 * rng.normal()))
        won += trial.verdict == "won"
    assert won == 0


@pytest.mark.parametrize("seed, effects", [
    (1019, {"tone_interference": {"frequency_hz": 31.0, "amplitude": 0.1}}),
    (1018, {"dead_zone": {"half_width": 0.05}})])
def test_a_growing_change_that_no_direction_shows_is_dated_by_its_size(model, seed, effects):
    """Its power grows with the square of time: it shows late, and began before."""
    at_s = 400.0 + np.random.default_rng(seed).uniform(0, 60)
    drive = ChangingDrive(seed, effects, at_s, 60.0)
    watch, noticed = watched(drive, model)
    assert at_s < noticed < at_s + 70
    change = watch.changed
    assert change.is_gradual
    assert drive.since_start_s(change.low_ns) <= at_s <= drive.since_start_s(change.high_ns)
    assert change.high_ns - change.low_ns < 10e9
