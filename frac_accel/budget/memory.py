"""Inputs that remember for longer than a filter of a few lags: integrals of the motion, and its
level."""

import functools

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from .shapes import cleared, standardised

# Ratio of neighbouring times of forgetting, and the longest, as a share of the record.
_RATIO = 4.0
_LONGEST = 0.125
# Half cycles in the record of what an integral must be faster than: slower ones resemble a drift.
_DRIFTS = 8
# Samples of the shortest memory of a level, and its scatter [of its mean] from which it changes.
_SHORTEST = 8
_STEADY = 0.02


def _times(shortest, n):
    """Times of forgetting [samples], from one on; none longer than a part of the record."""
    shortest = max(shortest, 1.0)
    longer = np.log(max(_LONGEST * n / shortest, 1.0)) / np.log(_RATIO)
    return shortest * _RATIO**np.arange(int(longer) + 1)


def count(shortest, n):
    """Number of `integrals`."""
    return 1 + len(_times(shortest, n))


def integrals(x, shortest):
    """Running integrals of the motion that forget, and one that does not, each of RMS 1.

    A high-pass far below the motion makes one of them, on either side: of the sensor one that
    forgets, of the reference (whose integral is what it lacks) one that does not.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Motion without its mean.
    shortest : float
        Time of forgetting [samples] that a filter reaches.

    Returns
    -------
    list of ndarray, shape (n,)
    """
    n, every = len(x), np.ones(len(x), bool)
    sums = [np.cumsum(x) - 0.5 * x]
    for time in _times(shortest, n):
        keep = np.exp(-1 / time)
        sums.append(lfilter([0.5 * (1 + keep)], [1.0, -keep], x) - 0.5 * x)
    return [standardised(without_drift(values), every) for values in sums]


def without_drift(values):
    """Values without their slowest courses: noise sums up to such ones, too."""
    courses = _courses(len(values))
    return values - courses.T @ (courses @ values)


@functools.lru_cache(maxsize=2)
def _courses(n):
    """The slowest cosines, shape (courses, n), each of power 1 and none a part of another."""
    place = np.pi / n * (np.arange(n) + 0.5)
    waves = np.cos(np.arange(min(_DRIFTS, n))[:, None] * place)
    return waves / np.linalg.norm(waves, axis=1, keepdims=True)


def levels(motion, used):
    """The motion times its level of the recent past, and times the root of that level.

    A gain that follows the level is made of them. Each is without what a short filter of the motion
    makes of it, and of RMS 1; the roots come first. None where the level hardly changes.
    """
    y = standardised(motion, used)
    power = np.where(used, y**2, 1.0)
    cycle = max(2 * len(y) // max(int(np.sum(y[1:] * y[:-1] < 0)), 1), _SHORTEST)
    roots, squares = [], []
    for time in _times(cycle, len(y)):
        # without what it does within a cycle, which makes curves of the motion
        level = uniform_filter1d(_followed(power, time), 2 * cycle)
        if np.std(level[used]) > _STEADY * np.mean(level[used]):
            squares.append(y * level)
            roots.append(y * np.sqrt(np.maximum(level, 0.0)))
    return cleared(roots + squares, y, used)


def _followed(power, time):
    """Power of the recent past, which forgets; before the record it was the usual one."""
    keep = np.exp(-1 / time)
    return lfilter([1 - keep], [1.0, -keep], power, zi=[keep])[0]
