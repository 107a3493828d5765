"""The filter behind all streaming is `scipy.signal.lfilter` to the last bit, without its import."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.signal

from frac_accel import linear_filter


@pytest.mark.parametrize("order", [(30, 2), (1, 2), (3, 3), (2, 6)])
@pytest.mark.parametrize("transposed", [False, True])
def test_it_is_lfilter(order, transposed):
    rng = np.random.default_rng(order)
    b, a = rng.normal(size=order[0]), np.r_[1.0, 0.3 * rng.normal(size=order[1] - 1) / order[1]]
    values = rng.normal(size=(50, 3)).T if transposed else rng.normal(size=(3, 50))
    state = rng.normal(size=(3, max(order) - 1))
    expected = scipy.signal.lfilter(b, a, values, zi=state)
    for function in (linear_filter._linear_filter, linear_filter._documented()):
        for found, wanted in zip(function(b, a, values, -1, state), expected):
            np.testing.assert_array_equal(found, wanted)


def test_nothing_in_nothing_out():
    output, state = linear_filter.run_filter(np.ones(3), np.array([1.0, 0.0]), np.empty((3, 0)),
                                             np.ones((3, 2)))
    assert output.shape == (3, 0)
    np.testing.assert_array_equal(state, 1.0)


@pytest.mark.parametrize("first", ["frac_accel.linear_filter", "scipy.signal"])
def test_the_package_can_be_imported_before_and_after(first):
    code = (f"import {first}, sys, frac_accel.linear_filter as ours\n"
            "assert ours._linear_filter.__name__ == '_linear_filter'\n"
            "import numpy, scipy.signal\n"
            "print(scipy.signal.lfilter([1.0], [1.0, -0.5], [1.0, 0.0])[1])\n")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "0.5", done.stderr
