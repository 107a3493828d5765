"""Recursive filtering of blocks: `scipy.signal.lfilter` without what it costs around the filtering.

Importing `scipy.signal` takes most of a second, for the statistics and optimisation that it brings
along, and each call of `lfilter` spends five times as long on checks as on one sample. The compiled
function behind it needs neither. It is not documented; where it cannot be had, `lfilter` is used.
"""

import importlib.util
import sys
from importlib.machinery import PathFinder
from pathlib import Path

import numpy as np

_NAME = "scipy.signal._sigtools"


def run_filter(b, a, values, state):
    """Filter along the last axis.

    Parameters
    ----------
    b, a : ndarray of float, shape (q,) and (p,)
        Numerator and denominator in ascending powers of the delay, a[0] = 1; p at least 2.
    values : ndarray of float, shape (k, n)
    state : ndarray of float, shape (k, max(p, q) - 1)

    Returns
    -------
    output : ndarray, shape (k, n)
    state : ndarray
        To go on with.
    """
    if not values.size:
        return np.empty_like(values), state
    return _linear_filter(b, a, values, -1, state)


def _compiled():
    """The compiled function, without importing the package around it."""
    module = sys.modules.get(_NAME)
    if module is None:
        scipy = importlib.util.find_spec("scipy")
        spec = PathFinder.find_spec(_NAME, [str(Path(scipy.origin).parent / "signal")])
        module = importlib.util.module_from_spec(spec)
        sys.modules[_NAME] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[_NAME]
            raise
    return module._linear_filter


def _documented():
    from scipy.signal import lfilter
    return lambda b, a, values, axis, state: lfilter(b, a, values, axis, state)


try:
    _linear_filter = _compiled()
except (ImportError, AttributeError, OSError):
    _linear_filter = _documented()
