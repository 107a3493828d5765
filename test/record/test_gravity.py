"""A sensor that shows no gravity beside one that does is told."""

import numpy as np
import pytest

from frac_accel import Samples
from frac_accel.record import Record

COUNT = 4000


def words(reference, sensor):
    topics = [Samples.of(np.arange(COUNT) * 10_000_000, values) for values in (reference, sensor)]
    return [said for said in Record.of(*topics).integrity(0).words if "gravity" in said]


@pytest.mark.parametrize("seed", range(5))
def test_gravity_that_one_lacks_is_told(seed):
    rng = np.random.default_rng([771, seed])
    motion = np.cumsum(rng.normal(size=(COUNT, 3)), axis=0) * 0.05
    motion = 0.5 * (motion - motion.mean(axis=0)) / motion.std(axis=0) + rng.normal(
        0, 0.3, (COUNT, 3))
    down = rng.normal(size=3)
    down *= 9.81 / np.linalg.norm(down)
    gain = rng.uniform(0.8, 1.2)
    said, = words(motion + down, gain * motion)
    assert said.startswith("the reference shows gravity and the sensor does not")
    said, = words(motion, gain * motion + down)
    assert said.startswith("the sensor shows gravity and the reference does not")
    assert words(motion + down, gain * (motion + down)) == []
    assert words(motion, gain * motion) == []
    # in other units nobody can tell
    assert words(motion + down, 200 * motion) == []
