"""Single samples that stand far out of their neighbours while the reference does not move."""

import numpy as np
from scipy.ndimage import maximum_filter1d

from ..shown import several

# Samples on either side that a spike may reach to.
_REACH = 3
# Samples on either side that say how far one may stand out here, and times that a spike stands
# farther out than the farthest of them (2.4 standard deviations, where it is noise).
_AROUND = 30
_TIMES = 5.0
# Steps of a lattice up to which a value is rounded, and nothing more.
_ROUNDED = 1.5
# Share of the samples above which they are no exception.
_RARE = 0.02


def spikes(sensor, reference, step=None):
    """Mask of the sensor's isolated spikes, empty where so much stands out that it is no exception.

    Parameters
    ----------
    sensor, reference : ndarray, shape (n,)
    step : float, optional
        Of the sensor's values: at rest, one alone may be rounded the other way.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    found = _stands_out(sensor, _ROUNDED * (step or 0.0)) & ~_stands_out(reference)
    return found if found.mean() <= _RARE else np.zeros(len(sensor), bool)


def spikes_words(count):
    """What is said of so many spikes: a band-limited reference cannot follow a shock, either, and
    where values are coarse and were filtered afterwards, no lattice shows."""
    return (f"{several(count, 'sample stands', 'samples stand')} far out, alone, while the "
            "reference does not: spikes, single steps of values coarser than the motion there, or "
            "shocks that the reference cannot follow, which count in no fit")


def _stands_out(values, least=0.0):
    """Samples that a cubic through the second and third neighbours misses by far, and by more than
    the least."""
    padded = np.pad(values, _REACH, mode="reflect", reflect_type="odd")
    n = len(values)
    at = {k: padded[_REACH + k:_REACH + k + n] for k in (-3, -2, 2, 3)}
    # Lagrange's polynomial through -3, -2, 2, 3 at 0
    off = np.abs(values - (0.9 * (at[-2] + at[2]) - 0.4 * (at[-3] + at[3])))
    # the largest around, but for what the spike itself has spoiled
    size = _AROUND - 2 * _REACH
    side = maximum_filter1d(np.pad(off, _AROUND, mode="reflect"), size)
    shift = _AROUND - size // 2
    around = np.maximum(side[_AROUND - shift:_AROUND - shift + n],
                        side[_AROUND + shift:_AROUND + shift + n])
    return off > np.maximum(_TIMES * np.maximum(around, 1e-9 * np.max(np.abs(values))), least)
