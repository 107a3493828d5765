"""Delays and memories that are too long for the record."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ..core import Oscillator
from ..errors import IdentificationError

# The search for a delay goes no further than this share of the record.
_LONGEST_DELAY = 0.25
# Correlation beyond that reach, and how much better than within it, that two topics have which
# belong together; standard deviations of what chance does.
_FAR_CORRELATION = 0.5
_FAR_GAIN = 1.5
_CHANCE = 5
_FEWEST_SHARED = 64
# Least energy that both ends must have, of what is usual.
_ENERGY = 1e-2
_KNOWN = 0.2


def require_time_to_answer(fit, pair):
    """Refuse fits whose delay or memory is too long for the record.

    Parameters
    ----------
    fit : Fit
    pair : Pair

    Raises
    ------
    IdentificationError
        If the delay is at the quarter of the record that it is searched in, or a well determined
        free motion decays more slowly than the record lasts.
    """
    duration = len(pair) / pair.sampling_rate_hz
    if abs(fit["delay_s"]) > 0.99 * _LONGEST_DELAY * duration:
        raise _too_late(fit["delay_s"], duration)
    if "natural_frequency_hz" in fit.names:
        _require_memory(fit, duration)


def far_apart(reference, sensor, pair):
    """Error of two topics that belong together at a longer delay than is searched for, or None.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    pair : Pair

    Returns
    -------
    IdentificationError or None
    """
    n = len(reference)
    if n < 2 * _FEWEST_SHARED:
        return None
    x, y = (np.where(pair.valid, values - values[pair.valid].mean(), 0.0)
            for values in (reference, sensor))
    size = next_fast_len(2 * n, real=True)
    shared = irfft(np.conj(rfft(x, size)) * rfft(y, size), size)
    energy_x, energy_y = (np.r_[0, np.cumsum(values**2)] for values in (x, y))
    lags = np.arange(-(n - _FEWEST_SHARED), n - _FEWEST_SHARED + 1)
    overlap = n - np.abs(lags)
    first_x, first_y = np.maximum(-lags, 0), np.maximum(lags, 0)
    product = (energy_x[first_x + overlap] - energy_x[first_x]) \
        * (energy_y[first_y + overlap] - energy_y[first_y])
    # what little energy two ends have is alike by chance
    enough = product > _ENERGY * energy_x[-1] * energy_y[-1] * (overlap / n)**2
    alike = np.where(enough, np.abs(shared[lags]) / np.sqrt(np.maximum(product, 1e-300)), 0.0)
    near = np.abs(lags) <= _LONGEST_DELAY * n
    # correlation of a record without relation: as large as the square root of its length is short
    chance = _CHANCE / np.sqrt(_independent(x, y) * overlap / n)
    alike = np.where(alike > chance, alike, 0.0)
    best = int(np.argmax(np.where(near, 0.0, alike)))
    if alike[best] < max(_FAR_CORRELATION, _FAR_GAIN * np.max(alike[near])):
        return None
    return _too_late(lags[best] / pair.sampling_rate_hz, n / pair.sampling_rate_hz)


def _independent(x, y):
    shared = np.abs(rfft(x))**2 * np.abs(rfft(y))**2
    return np.sum(shared)**2 / np.sum(shared**2)


def _require_memory(fit, duration):
    """Refuse a record that ends before the sensor has forgotten how it began."""
    for name in ("natural_frequency_hz", "damping_ratio"):
        if fit.std[fit.names.index(name)] > _KNOWN * abs(fit[name]):
            return
    frequency, ratio = fit["natural_frequency_hz"], fit["damping_ratio"]
    order = fit["damping_order"] if "damping_order" in fit.names else 1.0
    slowest = max((pole.real for pole in Oscillator(frequency, ratio, order).poles()),
                  default=-np.inf)
    memory = -1 / slowest
    if memory > duration:
        raise IdentificationError(
            f"the record lasts {duration:.3g} s, but the sensor's free motion takes {memory:.3g} s "
            f"to decay to 1/e (natural frequency {frequency:.4g} Hz, damping ratio {ratio:.3g}): "
            f"record at least {3 * memory:.3g} s")


def _too_late(delay_s, duration_s):
    later = "later" if delay_s > 0 else "earlier"
    return IdentificationError(
        f"the sensor is {abs(delay_s):.4g} s {later} than the reference in a record of "
        f"{duration_s:.4g} s, expected less than a quarter of it: the stamps of one topic are "
        "wrong, or the record is too short")
