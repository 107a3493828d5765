"""What is missing of both topics at once is a pause of the recording, no loss of the sensor's."""

import numpy as np
import pytest

import frac_accel
from frac_accel.model import SensorModel
from frac_accel.model.core import Gain
from frac_accel.record import Record

START_NS = 1_700_000_000_000_000_000


def topics(seed, lost=0, rates=(100.0, 100.0)):
    """A pair with three pauses of one to three seconds, and single samples of the sensor's lost."""
    rng = np.random.default_rng(seed)
    made = []
    sizes, phases = rng.uniform(0.2, 1, 12), rng.uniform(0, 7, 12)
    for place, rate in enumerate(rates):
        time = np.arange(int(60 * rate)) / rate
        kept = np.ones(len(time), bool)
        for begin, lasts in ((11.03, 1.0), (25.5, 2.02), (47.21, 3.0)):
            kept &= (time < begin) | (time > begin + lasts)
        paused = len(time) - kept.sum()
        if place and lost:
            kept[rng.choice(np.flatnonzero(kept)[5:-5], lost, replace=False)] = False
        moved = sum(size * np.sin(2 * np.pi * (0.7 + 0.9 * k) * time + phase)
                    for k, (size, phase) in enumerate(zip(sizes, phases)))
        values = np.zeros((kept.sum(), 3))
        values[:, 0] = moved[kept] + 1e-3 * rng.standard_normal(kept.sum())
        stamps = START_NS + np.round(1e9 * time[kept]).astype(np.int64)
        made.append(frac_accel.Samples.of(stamps, values))
    return made, paused


@pytest.mark.parametrize("rates", [(100.0, 100.0), (200.0, 50.0), (50.0, 128.0)])
@pytest.mark.parametrize("lost", [0, 40])
def test_only_what_the_sensor_alone_lacks_is_lost(lost, rates):
    pair, paused = topics(11, lost, rates)
    found = Record.of(*pair).integrity(0)
    # a lost sample beside a pause belongs to it
    assert abs(found.missing - lost) <= (2 if lost else 0)
    said, = (words for words in found.words if "paused" in words)
    assert abs(int(said.split()[0]) - paused) <= 2


def test_a_pause_is_no_finding_and_a_loss_is_one():
    names = [[f.cause for f in frac_accel.diagnose(tuple(topics(12, lost)[0]),
                                                   SensorModel(Gain(1.0))).findings]
             for lost in (0, 60)]
    assert names == [[], ["dropped_samples"]]


def test_single_samples_that_both_lack_are_lost_by_the_recording():
    (reference, sensor), paused = topics(13)
    kept = np.ones(len(sensor.stamps_ns), bool)
    kept[np.random.default_rng(13).choice(np.arange(10, 900), 20, replace=False)] = False
    both = [frac_accel.Samples.of(each.stamps_ns[kept], each.values[kept])
            for each in (reference, sensor)]
    assert Record.of(*both).integrity(0).missing == 0
    assert Record.of(reference, both[1]).integrity(0).missing == 20
