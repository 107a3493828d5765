"""The sampling rate behind stamps that scatter, repeat or have gaps."""

import numpy as np

# Whole numbers of intervals between stamps: what they scatter by at most, and how many are tried.
_WHOLE, _MOST_PARTS = 0.1, 24
# Tick, of the median step, from which stamps are rounded to it, and to which share of that step
# stamps are exact; share of the steps that last one interval where that tells its length.
_TICK, _OFF, _SINGLE = 0.1, 1e-3, 0.3


def estimate_rate(stamps_ns):
    """Sampling rate [Hz] from stamps [ns] that may scatter, repeat or have gaps.

    Returns
    -------
    float or None
        None where fewer than two stamps follow each other.
    """
    steps = np.diff(np.asarray(stamps_ns, np.int64))
    steps = steps[steps > 0].astype(float)
    if not len(steps):
        return None
    interval, _ = interval_of(steps)
    counts = np.maximum(np.round(steps / interval), 1)
    # a gap says how often the interval fits, but a long one says it badly
    near = counts <= max(5, 2 * np.median(counts))
    return float(1e9 * counts[near].sum() / steps[near].sum())


def interval_of(steps):
    """Interval that steps [ns] are whole numbers of, and the scatter of these numbers.

    Where many samples are lost, the median step is several intervals.
    """
    median = np.median(steps)
    near = steps[steps <= 5 * median]
    # stamps that were read as text or floats are off by some nanoseconds
    digit = 10 ** np.floor(np.log10(_OFF * median))
    tick = np.gcd.reduce(np.round(near / digit).astype(np.int64)) * digit
    shortest = near.min()
    # one interval lasts the whole ticks below its length or above it
    single = near[near < shortest + 1.5 * tick]
    if _TICK * median < tick < 0.75 * shortest and len(single) > _SINGLE * len(near):
        interval = single.mean()
        counts = near / interval
        return interval, float(np.sqrt(np.mean((counts - np.maximum(np.round(counts), 1))**2)))
    fits = []
    for parts in range(1, _MOST_PARTS + 1):
        whole = np.maximum(np.round(near * parts / median), 1)
        interval = near.sum() / whole.sum()
        counts = near / interval
        fits.append(float(np.sqrt(np.mean((counts - np.maximum(np.round(counts), 1))**2))))
        if fits[-1] < _WHOLE:
            return interval, fits[-1]
    return median, fits[0]
