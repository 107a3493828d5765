"""What repeats with the reference's period: distortion, told from noise without any model."""

import numpy as np
from scipy.fft import irfft, rfft

# Power of a line, of the strongest one's, from which it is excited.
_EXCITED = 1e-5


def repeating(target, used, period):
    """What each period shares with the others: their mean, shape (n,).

    The mean of the other periods predicts the distortion, and nothing of the noise (J. Schoukens
    and R. Pintelon, robust method: *System Identification*, 2nd ed., 2012, section 4.3.1).

    Parameters
    ----------
    target : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    period : int
        Samples.
    """
    n = len(target)
    place = np.arange(n) % period
    total = np.bincount(place, np.where(used, target, 0.0), period)
    count = np.bincount(place, used, period)
    own = np.where(used, target, 0.0)
    others = count[place] - used
    return np.where(others > 0, (total[place] - own) / np.maximum(others, 1), 0.0)


def by_parity(predicted, reference, period):
    """Prediction on even and on odd lines, or None where even lines are excited.

    With odd lines only in the reference, even distortion lies on even lines and odd distortion on
    odd ones.

    Parameters
    ----------
    predicted, reference : ndarray, shape (n,)
    period : int

    Returns
    -------
    tuple of ndarray, shape (n,), or None
    """
    count = len(reference) // period
    mean = reference[:count * period].reshape(count, period).mean(axis=0)
    power = np.abs(rfft(mean - mean.mean()))**2
    if period % 2 or np.any(np.flatnonzero(power > _EXCITED * power.max()) % 2 == 0):
        return None
    # even lines repeat after half a period, odd ones do so with the other sign
    rows = -(-len(predicted) // period) * period
    padded = np.resize(np.r_[predicted, predicted[len(predicted) - period:]], rows)
    padded[:len(predicted)] = predicted
    tail = rows - len(predicted)
    if tail:
        padded[len(predicted):] = predicted[len(predicted) - period:][:tail]
    spectra = rfft(padded.reshape(-1, period), axis=1)
    spectra[:, 1::2] = 0.0
    even = irfft(spectra, period, axis=1).ravel()[:len(predicted)]
    return even, predicted - even
