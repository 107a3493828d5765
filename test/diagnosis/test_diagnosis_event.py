"""A knock or two that only one of the signals shows do not hide a small error; a shock is none."""

import numpy as np
import pytest
from rig.hidden import draw_case

from frac_accel import Samples, diagnose
from frac_accel.diagnosis.event import event


@pytest.mark.thorough
@pytest.mark.parametrize("seed, cause, knocks", [
    (9100, "sensitivity_error", 1), (9101, "low_pass_lag", 2), (9102, "cross_axis_sensitivity", 1)])
def test_a_knock_hides_nothing(seed, cause, knocks):
    case = draw_case(seed, [cause])
    reference, sensor, temperature = case.samples()
    rng = np.random.default_rng(seed)
    values = sensor.values.copy()
    ring = np.exp(-np.arange(40) / 8) * np.cos(np.arange(40))
    for place in rng.uniform(0.2, 0.8, knocks):
        begin = int(place * len(values))
        values[begin:begin + 40, 0] += 200 * case.effect_rms[cause] * ring
    found = diagnose((reference, Samples.of(sensor.stamps_ns, values)), case.model(),
                     temperature=temperature)
    assert {finding.cause for finding in found.findings} == {cause}
    assert "a short and strong error drowns all else there" in found.reason


def test_a_place_is_one_only_where_the_motion_is_not():
    rng = np.random.default_rng(1)
    n = 20_000
    used, motion, noise = np.ones(n, bool), rng.normal(size=n), 0.01 * rng.normal(size=n)
    assert not event(noise, motion, used).any()
    once, often = noise.copy(), noise.copy()
    once[5000:5030] += rng.normal(size=30)
    for begin in range(1000, 19_000, 2000):
        often[begin:begin + 30] += rng.normal(size=30)
    found = event(once, motion, used)
    assert found[5000:5030].all() and found.sum() <= 3 * 64
    assert not event(often, motion, used).any()
    shock = 0.01 * rng.normal(size=n)
    shock[5000:5030] += 10 * rng.normal(size=30)
    assert not event(noise + 0.1 * shock, shock, used).any()
