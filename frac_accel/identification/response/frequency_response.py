"""Averaged frequency response of a measured pair: where the search for parameters starts."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ...signals.averaged_spectra import coherence_of, power_of, segment_spectra

_SEGMENTS = 4
_MOST_BINS = 200
# Power of a line, of the strongest, whose phase counts.
_EXCITED = 1e-3
# For a share of power: few frequencies, so that chance has little of it.
_SHARE_SEGMENTS = 32


def bulk_delay(reference, sensor):
    """Whole samples by which the sensor is later than the reference: the correlation's peak."""
    n = len(reference)
    # room for the lags that are looked at
    length = next_fast_len(n + n // 4 + 1, real=True)
    return _largest(np.conj(rfft(reference - reference.mean(), length))
                    * rfft(sensor - sensor.mean(), length), length, n // 4)


def phase_delay(reference, sensor):
    """The same from the phases alone (C. Knapp, G. Carter, IEEE Trans. ASSP 24 (1976) 320-327).

    Each line where the reference has power counts alike: what still rings from before the record
    is loud, but in few of them.
    """
    n = len(reference)
    length = next_fast_len(n + n // 4 + 1, real=True)
    taper = np.hanning(n)
    moving, answer = (rfft(taper * (values - values.mean()), length)
                      for values in (reference, sensor))
    power = np.abs(moving)**2
    shared = np.where(power > _EXCITED * power.max(), np.conj(moving) * answer, 0.0)
    return _largest(shared / np.maximum(np.abs(shared), 1e-300), length, n // 4)


def _largest(spectrum, length, most):
    """Lag at which the correlation with this spectrum is largest, either way."""
    shared = np.abs(irfft(spectrum, length))
    later, earlier = int(np.argmax(shared[:most])), int(np.argmax(shared[-most:])) - most
    return later if shared[later] >= shared[earlier] else earlier


def averaged_response(reference, sensor, sampling_rate_hz, delay):
    """Response from reference to sensor, averaged over segments and neighbouring frequencies.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float
    delay : int
        Delay [samples] taken out first, so that the segments belong together.

    Returns
    -------
    frequency_hz : ndarray, shape (m,)
    response : ndarray of complex, shape (m,)
        Of the sensor without `delay`.
    weight : ndarray, shape (m,)
        The reference's power: the least-squares weight of the response.
    """
    n = len(reference) - abs(delay)
    x = reference[max(-delay, 0):][:n]
    y = sensor[max(delay, 0):][:n]
    size = next_fast_len(min(n, max(256, n // _SEGMENTS)), real=True)
    size = min(size, n)
    starts = np.arange(0, n - size + 1, max(size // 2, 1))
    window = np.hanning(size)
    place = starts[:, None] + np.arange(size)
    spectra = [rfft((v[place] - v.mean()) * window, axis=1) for v in (x, y)]
    power = np.sum(np.abs(spectra[0])**2, axis=0)
    cross = np.sum(np.conj(spectra[0]) * spectra[1], axis=0)
    frequency = np.fft.rfftfreq(size, 1 / sampling_rate_hz)
    strong = np.flatnonzero(power > 1e-6 * power.max())
    strong = strong[strong > 0]
    # neighbours are put together until few enough are left, each by its share of power
    groups = min(len(strong), _MOST_BINS)
    edges = np.unique(np.linspace(0, len(strong), groups + 1).astype(int))[:-1]

    def gathered(values):
        return np.add.reduceat(values[strong], edges)
    weight = gathered(power)
    return gathered(power * frequency) / weight, gathered(cross) / weight, weight


def linear_share(reference, residual):
    """Share of the residual's power that a linear model could still explain by the reference.

    Parameters
    ----------
    reference, residual : ndarray, shape (n,)
        Residual NaN where not known.

    Returns
    -------
    float
        Coherence averaged with the residual's power as weight; a few hundredths by chance.
    """
    known = np.nan_to_num(residual)
    size = max(16, len(reference) // _SHARE_SEGMENTS)
    moving, left = (segment_spectra(values, "hann", size) for values in (reference, known))
    power, rest = power_of(moving), power_of(left)
    explained = np.where(power > 1e-9 * power.max(), coherence_of(moving, left) * rest, 0.0)
    return float(explained.sum() / max(rest.sum(), 1e-300))
