"""Delays and memories that are too long for the record."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ...errors import IdentificationError
from ...model.core import Oscillator
from ...model.effects import longest_identified
from ..fit.output_error import LONGEST_DELAY, fit_output_error, longest_delay
from ..fit.structures import OscillatorStructure

# Samples that two topics far apart must share, and the residual, of the output, that a sensor has
# there if they belong together.
_FEWEST_SHARED = 256
_RELATED = 0.3
_UNCERTAINTIES = 2
# A fit that ends at the least damping of the search has found none.
_LEAST_DAMPING = 1.01e-4
_KNOWN = 0.2
# Power of the free motion, of the output, that is much of it.
_FREE = 0.3


def require_time_to_answer(fit, pair):
    """Refuse fits whose delay or memory is too long for the record.

    Parameters
    ----------
    fit : Fit
    pair : Record

    Raises
    ------
    IdentificationError
        If the delay is at the quarter of the record that it is searched in, or the
        sensor's free motion decays more slowly than the record lasts.
    """
    duration = len(pair) / pair.sampling_rate_hz
    if abs(fit["delay_s"]) > 0.99 * LONGEST_DELAY * duration:
        raise _too_late(fit["delay_s"], duration)
    if "natural_frequency_hz" in fit.names:
        _require_memory(fit, duration)


def far_apart(reference, sensor, pair):
    """Error of two topics that belong together at a longer delay than is searched for, or None.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    pair : Record

    Returns
    -------
    IdentificationError or None
    """
    n, valid = len(reference), pair.valid
    x, y = (np.where(valid, values - values[valid].mean(), 0.0) for values in (reference, sensor))
    size = next_fast_len(2 * n, real=True)
    shared = np.abs(irfft(np.conj(rfft(x, size)) * rfft(y, size), size))
    nearest = int(longest_delay(n, pair.sampling_rate_hz)) + 1
    lags = np.arange(nearest, n - _FEWEST_SHARED + 1)
    if not len(lags):
        return None
    lags = np.r_[lags, -lags]
    # what chance does grows with the root of what is shared
    lag = int(lags[np.argmax(shared[lags] / np.sqrt(n - np.abs(lags)))])
    first, second = (slice(start, start + n - abs(lag)) for start in (max(-lag, 0), max(lag, 0)))
    both = valid[first] & valid[second]
    try:
        fit = fit_output_error(OscillatorStructure(), reference[first], sensor[second],
                               pair.sampling_rate_hz, both)
    except IdentificationError:
        return None
    if fit.rmse > _RELATED * np.std(sensor[second][both]):
        return None
    return _too_late(lag / pair.sampling_rate_hz + fit["delay_s"], n / pair.sampling_rate_hz)


def _require_memory(fit, duration):
    """Refuse a record that ends before the sensor has forgotten how it began."""
    std = dict(zip(fit.names, fit.std))
    frequency, ratio = fit["natural_frequency_hz"], fit["damping_ratio"]
    known = std["natural_frequency_hz"] <= _KNOWN * frequency and ratio >= _LEAST_DAMPING
    if known:
        # a damping that is too small to show in the record has an upper limit at least
        ratio += _UNCERTAINTIES * std["damping_ratio"]
        order = fit["damping_order"] if "damping_order" in fit.names else 1.0
        slowest = max((pole.real for pole in Oscillator(frequency, ratio, order).poles()),
                      default=-np.inf)
        memory = -1 / slowest
        if memory > duration:
            raise IdentificationError(
                f"the record lasts {duration:.3g} s, but the sensor's free motion takes at least "
                f"{memory:.3g} s to decay to 1/e (natural frequency {frequency:.4g} Hz, damping "
                f"ratio at most {ratio:.3g}): record at least {3 * memory:.3g} s")
    # of a free order, the decay is known better than the parameters that it is made of
    if fit.free_share > _FREE and not (known and fit.fastest_decay * duration > 1):
        raise IdentificationError(
            f"the sensor still rings at {frequency:.4g} Hz from before the record, which with "
            f"{duration:.3g} s is too short to tell how this decays: record several times longer "
            "than the sensor rings")


def _too_late(delay_s, duration_s):
    later = "later" if delay_s > 0 else "earlier"
    longest_s = longest_identified("delay_s")
    expected, why = ("less than a quarter of it", ", or the record is too short") \
        if LONGEST_DELAY * duration_s < longest_s else (f"at most {longest_s:g} s", "")
    return IdentificationError(
        f"the sensor is {abs(delay_s):.4g} s {later} than the reference in a record of "
        f"{duration_s:.4g} s, expected {expected}: the stamps of one topic are wrong{why}")
