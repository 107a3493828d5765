"""Spectra averaged over overlapping segments (Welch), without the overhead of a general tool."""

import functools

import numpy as np
from scipy.fft import rfft

# Cosines that windows are sums of.
_COSINES = {"hann": (0.5, 0.5), "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168)}


def segment_spectra(values, window, length, weighted_mean=False):
    """Spectra of segments that overlap by half, each without its mean.

    Parameters
    ----------
    values : ndarray, shape (n,)
    window : str
        "hann" or "blackmanharris", as `scipy.signal.get_window` makes them.
    length : int
        Of a segment, at most n.
    weighted_mean : bool
        Whether the mean is that under the window, which leaves nothing in the lowest lines. With
        the plain one, a sine that does not fill a segment with whole periods leaks into them.

    Returns
    -------
    ndarray of complex, shape (segments, length // 2 + 1)
        Of a scale with which the mean of the squares is what `scipy.signal.welch` gives at a
        sampling rate of one.
    """
    segments = np.lib.stride_tricks.sliding_window_view(values, length)[::length - length // 2]
    taper = _taper(window, length)
    mean = segments @ taper / taper.sum() if weighted_mean else segments.mean(axis=1)
    spectra = rfft((segments - mean[:, None]) * taper, axis=1)
    # each other line stands for its conjugate as well
    spectra[:, 1:(length + 1) // 2] *= np.sqrt(2)
    return spectra


def power_of(spectra):
    """Mean power of segments, shape (lines,)."""
    return np.mean(spectra.real**2 + spectra.imag**2, axis=0)


def coherence_of(first, second):
    """Squared coherence of the segments of two signals, shape (lines,); 0 where one is silent."""
    product = power_of(first) * power_of(second)
    shared = np.abs(np.mean(np.conj(first) * second, axis=0))**2
    return np.divide(shared, product, out=np.zeros(len(product)), where=product > 0)


@functools.lru_cache(maxsize=32)
def _taper(window, length):
    turn = np.linspace(-np.pi, np.pi, length + 1)[:-1]
    taper = sum(share * np.cos(order * turn) for order, share in enumerate(_COSINES[window]))
    return taper / np.sqrt(np.sum(taper**2))
