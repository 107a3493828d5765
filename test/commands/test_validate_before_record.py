"""What the time before a record has left, and what only one of two rates can show, is no error of a
model: `validate` agrees with what `diagnose` claims."""

import numpy as np
import pytest
from exact_sines import record, samples

from frac_accel import SensorModel, validate
from frac_accel.io.samples import Samples
from frac_accel.model.core import Gain
from frac_accel.model.effects import effect_of
from frac_accel.validation import whole_nrmse

RATE = 100.0


@pytest.mark.parametrize("seed", range(3))
def test_a_slow_high_pass_may_have_begun_in_mid_motion(seed):
    rng = np.random.default_rng(seed)
    corner = rng.uniform(0.01, 0.03)
    turn = 2 * np.pi * corner
    reference, sensor = record(rng, lambda s: 0.6 * s / (s + turn), band=(0.02, 5.0), n=6000,
                               rate=RATE, sines=80)
    own = SensorModel(Gain(0.6), [effect_of("ac_coupling")(corner)])
    # a constant that the high-pass has taken away long ago, and not at the record's start
    pair = samples(reference + 5.0, sensor, RATE)
    # 0.2 % of noise and half as much of resampling
    assert whole_nrmse(pair, own) < 4e-3
    # another corner is still wrong
    other = SensorModel(Gain(0.6), [effect_of("ac_coupling")(2 * corner)])
    assert whole_nrmse(pair, other) > 1.5e-2


def test_noise_that_the_slower_topic_cannot_show_is_no_error():
    rng = np.random.default_rng(5)
    reference, sensor = record(rng, lambda s: 0.8 + 0 * s, band=(0.2, 5.0), n=12_000, rate=RATE,
                               sines=200)
    time = np.arange(len(sensor)) / RATE
    pair = samples(reference, sensor + 0.3 * np.sin(2 * np.pi * 30.0 * time), RATE)
    slow = Samples.of(pair[0].stamps_ns[::4], pair[0].values[::4])  # 25 Hz
    judged = validate((slow, pair[1]), SensorModel(Gain(0.8)))
    assert judged.whole_hz == pytest.approx(10.0)
    assert judged.whole_nrmse < 1e-2
    assert judged.as_dict()["whole_hz"] == judged.whole_hz
    # with both at the same rate it is one
    judged = validate(pair, SensorModel(Gain(0.8)))
    assert judged.whole_hz is None and judged.whole_nrmse > 0.2
