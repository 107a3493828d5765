"""A value held at an extreme is no limit, as others are held as long; a true limit is one."""

import numpy as np
import pytest

from frac_accel.record.clipping import certain, pile_up


def held(rng, step):
    """A slow signal whose values stay for three to twelve samples."""
    slow = np.cumsum(rng.normal(size=1500))
    slow -= np.linspace(slow[0], slow[-1], len(slow))
    values = np.repeat(slow, rng.integers(3, 13, len(slow)))
    return step * np.round(values / step) if step else values


@pytest.mark.parametrize("step", [None, 0.005])
@pytest.mark.parametrize("seed", range(6))
def test_a_held_extreme_is_no_limit(seed, step):
    rng = np.random.default_rng([141, seed])
    values = held(rng, step)
    # the greatest is held for longer than those next to it
    top = values.max() + 1
    values = np.r_[values, np.repeat([top - 0.5, top - 0.25, top, top - 0.25], [4, 3, 11, 3])]
    assert pile_up(values)
    assert certain(pile_up(values), step) is None


@pytest.mark.parametrize("step", [None, 0.005])
@pytest.mark.parametrize("seed", range(6))
def test_a_limit_of_held_values_is_one(seed, step):
    rng = np.random.default_rng([142, seed])
    values = held(rng, step)
    limit = float(np.quantile(values, 0.9))
    assert certain(pile_up(np.minimum(values, limit)), step) == limit


@pytest.mark.parametrize("runs", [[3], [4], [1, 1, 1], [2, 1]])
def test_few_equal_extremes_are_a_limit_where_no_other_value_comes_twice(runs):
    rng = np.random.default_rng([143, *runs])
    values = rng.normal(size=8000)
    at = 1000 * np.arange(1, 1 + len(runs))
    clipped = np.concatenate([place + np.arange(run) for place, run in zip(at, runs)])
    values[clipped] = 5.0
    assert certain(pile_up(values), None) == 5.0
    values[[17, 4711]] = values[42]  # here values do come twice
    assert pile_up(values) is None
    assert pile_up(np.r_[rng.normal(size=8000), 5.0, 5.0]) is None
