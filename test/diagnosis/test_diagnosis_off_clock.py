"""Samples that are lost while the stamps count on, and clocks that are off, in records without a
model: what is identified is the sensor, and the clock has the name."""

import numpy as np
import pytest
import rig

from frac_accel import diagnose
from frac_accel.io.samples import Samples
from frac_accel.validation import validate

RATE_HZ, DURATION_S = 100.0, 60.0


def made(seed, lost):
    """A sensor's record of which some samples are lost, though its stamps count on; the places of
    the first samples after each loss, and how many each has lost."""
    rng = np.random.default_rng([seed, 51])
    core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(15, 60),
            "damping_ratio": rng.uniform(0.1, 0.7), "damping_order": 1.0, "sensitivity": 1.0}
    excitation = rig.band_noise(rng, RATE_HZ, DURATION_S, (0.5, 30.0), 3.0, 1.0)
    record = rig.simulate_record(rig.Sensor(core), excitation)
    values = record.clean + 0.01 * record.clean.std(axis=0) * rng.normal(size=record.clean.shape)
    count = len(values)
    places = np.sort(rng.choice(np.arange(count // 10, 9 * count // 10, 50), lost, replace=False))
    counts = rng.integers(1, 3, lost)
    gone = np.concatenate([np.arange(at, at + many) for at, many in zip(places, counts)] or [[]])
    kept = np.delete(values, gone.astype(int), axis=0)
    pair = (Samples.of(record.stamps_ns, record.reference),
            Samples.of(record.sensor_stamps_ns[:len(kept)], kept))
    return pair, places - np.r_[0, np.cumsum(counts)[:-1]] if lost else places, counts


@pytest.mark.parametrize("seed, lost", [
    (1, 2), (2, 4), pytest.param(3, 9, marks=pytest.mark.thorough),
    pytest.param(4, 15, marks=pytest.mark.thorough)])
def test_losses_that_no_stamp_shows_are_found_where_they_are(seed, lost):
    pair, places, counts = made(seed, lost)
    found = diagnose(pair)
    assert found.verdict == "explained"
    [finding] = found.findings
    assert finding.cause == "dropped_samples"
    at_s, lost_s = (np.array(getattr(finding.effect, name)) for name in ("at_s", "lost_s"))
    # where the motion is small, the two sides of a loss are alike for a sample or two
    assert np.max(np.abs(at_s * RATE_HZ - places)) < 3
    assert np.max(np.abs(lost_s * RATE_HZ - counts)) < 1e-3
    share = counts.sum() / (len(pair[1].stamps_ns) + counts.sum())
    assert finding.effect.fraction == pytest.approx(share, rel=1e-6)
    assert found.extended["nrmse"] < 0.015 < 0.1 < found.baseline["nrmse"]
    # the model that is written does the same
    assert validate(pair, found.model).whole_nrmse < 0.03


@pytest.mark.parametrize("seed, skew_ppm", [
    (6, 100.0), pytest.param(5, 300.0, marks=pytest.mark.thorough),
    pytest.param(7, -200.0, marks=pytest.mark.thorough)])
def test_a_clock_that_is_off_does_not_bend_what_is_identified(seed, skew_ppm):
    (reference, sensor), _, _ = made(seed, 0)
    after_ns = sensor.stamps_ns - sensor.stamps_ns[0]
    stamps = sensor.stamps_ns - np.round(1e-6 * skew_ppm * after_ns).astype(int)
    found = diagnose((reference, sensor._replace(stamps_ns=stamps)), time_limit_s=60)
    assert found.verdict == "explained"
    [finding] = found.findings
    assert finding.cause == "clock_skew"
    assert abs(finding.effect.skew_ppm - skew_ppm) < 0.5
    assert found.extended["nrmse"] < 0.03


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["none", "skew", "one",
                                  pytest.param("to and fro", marks=pytest.mark.long),
                                  pytest.param("given twice", marks=pytest.mark.long)])
def test_other_clocks_lose_no_samples(kind):
    (reference, sensor), _, _ = made(5, 0)
    after_s = 1e-9 * (sensor.stamps_ns - sensor.stamps_ns[0])
    late_s = {"none": 0.0, "skew": 3e-4 * after_s, "one": 2.0 / RATE_HZ * (after_s > 31.7),
              "to and fro": 1.0 / RATE_HZ * np.sin(after_s / 4),
              # what a sample that is there twice does to all that follow
              "given twice": (np.floor(after_s / 13) / RATE_HZ)}[kind]
    sign = 1 if kind == "given twice" else -1
    stamps = sensor.stamps_ns + np.round(1e9 * sign * late_s).astype(int)
    found = diagnose((reference, sensor._replace(stamps_ns=stamps)), time_limit_s=60)
    assert not any(f.effect.at_s for f in found.findings if f.cause == "dropped_samples")
