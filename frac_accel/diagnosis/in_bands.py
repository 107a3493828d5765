"""Whether what a cause adds is as large as it should be at all frequencies."""

import itertools

import numpy as np
from scipy.fft import rfft

from ..model.effects.base import OFFSET

# Bands of equal power of what a cause adds; by how much of its size it may differ between two of
# them, and how surely [standard uncertainties] it must.
_BANDS = 4
_APART = 0.1
_SURE = 6.0
# Fewest bands, and standard uncertainty of the size in each, by which a cause acts alike in all.
_FEWEST, _KNOWN = 3, 0.03
# Lines over which a band's power must be spread for its scatter to say how sure that is.
_LINES = 8


def otherwise_in_bands(engine, best, added):
    """Causes that change gain, time or dynamics along the record, and whose size in one band of
    frequencies is not that in another: what changes there is something else.

    Parameters
    ----------
    engine : Engine
    best : Fitted
    added : dict of str to ndarray, shape (n,)
        What each cause adds to the output.

    Returns
    -------
    dict of str to str
        Words by cause.
    """
    found = {}
    for cause, values in added.items():
        effect = best.effects[cause]
        if not effect.shows_with_time or effect.stage >= OFFSET:
            continue
        sizes = _sizes(engine, best, values)
        apart = [(low, high) for (low, one), (high, other) in itertools.permutations(sizes, 2)
                 if high - low > max(_APART, _SURE * np.hypot(one, other))]
        if apart:
            low, high = max(apart, key=lambda pair: pair[1] - pair[0])
            found[cause] = f"at some frequencies it is {low:.2f} of its size, at others " \
                           f"{high:.2f}: what changes with time is something else"
    return found


def alike_in_bands(engine, best, added):
    """Whether what a cause adds, shape (n,), has the same size at all frequencies: of a delay, that
    its phase is a straight line through zero."""
    sizes = _sizes(engine, best, added)
    return len(sizes) >= _FEWEST and all(
        std < _KNOWN and abs(size - 1) < _APART for size, std in sizes)


def _sizes(engine, best, added):
    """Pairs of size and standard uncertainty of what is added and left, over what is added, in
    bands of equal power, but those of a few lines."""
    one, other = (rfft(np.where(engine.problem.used, values, 0.0))
                  for values in (added, best.residual))
    power = np.abs(one)**2
    reached = np.cumsum(power) / max(power.sum(), np.finfo(float).tiny)
    edges = [0, *np.searchsorted(reached, np.arange(1, _BANDS) / _BANDS), len(power)]
    sizes = []
    for low, high in itertools.pairwise(edges):
        total = power[low:high].sum()
        if total**2 > _LINES * np.sum(power[low:high]**2):
            slope = np.sum((one[low:high].conj() * other[low:high]).real) / total
            rest = np.abs(other[low:high] - slope * one[low:high])**2
            sizes.append((1 + float(slope),
                          float(np.sqrt(0.5 * np.sum(power[low:high] * rest)) / total)))
    return sizes
