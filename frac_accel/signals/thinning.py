"""Long signals in few numbers: what of them a figure shows."""

import numpy as np

from .averaged_spectra import power_of, segment_spectra

# Points of a signal after `envelope`: more than a screen has columns, twice.
MOST_POINTS = 4000
# Significant digits of what is only drawn.
_DIGITS = 6
# Periods of the reference's mean frequency in a close-up.
_PERIODS = 25


def envelope(x, values, most=MOST_POINTS):
    """Thin a long signal to the smallest and largest value of each of many short stretches.

    Parameters
    ----------
    x, values : ndarray, shape (n,)
    most : int
        Largest number of points.

    Returns
    -------
    x, values : ndarray, shape (m,)
        Those points in their order; all of a signal of at most `most`. A stretch of NaN alone
        leaves one.
    """
    n = len(values)
    if n <= most:
        return x, values
    size = -(-2 * n // most)
    starts = np.arange(0, n, size)
    padded = np.full(len(starts) * size, np.nan)
    padded[:n] = values
    stretches = padded.reshape(-1, size)
    missing = np.isnan(stretches)
    ends = np.stack([np.argmin(np.where(missing, np.inf, stretches), axis=1),
                     np.argmax(np.where(missing, -np.inf, stretches), axis=1)], axis=1)
    # a stretch without spread, or without any value, is one point
    chosen = np.unique(np.sort(ends, axis=1) + starts[:, None])
    return np.asarray(x)[chosen], np.asarray(values)[chosen]


def legible(values):
    """Values with so many digits as can be seen."""
    size = np.where((values == 0) | ~np.isfinite(values), 1.0, np.abs(values))
    unit = 10.0**(np.floor(np.log10(size)) - _DIGITS + 1)
    # divided by a power of ten, a whole number is written without a tail of nines
    return np.where(unit < 1, np.round(values / unit) / np.maximum(np.round(1 / unit), 1),
                    np.round(values / unit) * unit)


def thinned(x, values, most=MOST_POINTS):
    """`envelope` with so many digits as can be seen."""
    return tuple(map(legible, envelope(x, values, most)))


def close_up(reference):
    """Number of samples in which single oscillations can be seen."""
    length = segment(len(reference))
    frequency, power = np.fft.rfftfreq(length), power_of(segment_spectra(reference, "hann", length))
    return int(_PERIODS * power.sum() / (power @ frequency))


def segment(samples, most=8192):
    """Length of the segments of a spectrum, at most `most`: enough of them to average."""
    return min(samples, max(256, min(samples // 8, most)))
