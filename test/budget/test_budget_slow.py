"""How much of what is left is slow, where that is known exactly."""

import numpy as np
import pytest

from frac_accel.budget import Division


@pytest.mark.parametrize("seed", range(4))
def test_a_zero_that_settles_is_slow(seed):
    rng = np.random.default_rng(seed)
    count = 20_000
    motion = rng.normal(size=count)
    motion = np.convolve(motion, [0.25, 0.5, 0.25], "same")
    slow = rng.uniform(0.2, 0.5) * np.exp(-np.arange(count) / count * rng.uniform(5, 12))
    noise = rng.uniform(0.01, 0.03) * rng.normal(size=count)
    truth = np.mean(slow**2) / np.mean((slow + noise)**2)
    division = Division(np.stack([motion, 0 * motion, 0 * motion], axis=1),
                        np.ones(count, bool), 100.0, 0, quick=True)
    parts = {entry["part"]: entry for entry in
             division.of(slow + noise, motion + slow + noise, motion).parts}
    assert parts["slow"]["share"] == pytest.approx(truth, abs=0.03)
