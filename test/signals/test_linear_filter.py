"""The filters behind all streaming are those of `scipy.signal` to the last bit, not imported."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.signal

from frac_accel.signals import linear_filter


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


@pytest.mark.parametrize("count", [1, 2, 7])
def test_sections_in_series_are_sosfilt(count):
    rng = np.random.default_rng(count)
    sections = rng.normal(size=(count, 6))
    sections[:, 3], sections[:, 4:] = 1.0, 0.3 * sections[:, 4:]
    values, before = rng.normal(size=(50, 3)).T, rng.normal(size=(3, count, 2))
    expected, after = scipy.signal.sosfilt(sections, values, zi=before.transpose(1, 0, 2))
    for function in (linear_filter._section_filter, linear_filter._documented_sections()):
        output, state = values.copy(order="C"), before.copy()
        function(sections, output, state)
        np.testing.assert_array_equal(output, expected)
        np.testing.assert_array_equal(state, after.transpose(1, 0, 2))


def test_nothing_in_nothing_out():
    output, state = linear_filter.run_filter(np.ones(3), np.array([1.0, 0.0]), np.empty((3, 0)),
                                             np.ones((3, 2)))
    assert output.shape == (3, 0)
    np.testing.assert_array_equal(state, 1.0)


@pytest.mark.parametrize("first", ["frac_accel.signals.linear_filter", "scipy.signal"])
def test_the_package_can_be_imported_before_and_after(first):
    code = (f"import {first}, sys, frac_accel.signals.linear_filter as ours\n"
            "assert ours._linear_filter.__name__ == '_linear_filter'\n"
            "assert ours._section_filter.__name__ == '_sosfilt'\n"
            "import numpy, scipy.signal\n"
            "print(scipy.signal.lfilter([1.0], [1.0, -0.5], [1.0, 0.0])[1])\n")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "0.5", done.stderr
