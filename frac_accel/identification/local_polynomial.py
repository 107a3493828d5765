"""Frequency response of any record, free of leakage, by local polynomials."""

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d

from .frequency_response import bulk_delay

METHOD = "local polynomial in bands"
_ORDER = 2
# Bins of a band beyond the unknowns: degrees of freedom of its variance, before its neighbours'.
_SPARE = 6
# Width of a band, of its frequency, where the record has more bins in it than are needed.
_WIDTH = 0.01
_NEIGHBOURS = 5
# Mean power of a band, of the strongest one's, and relative uncertainty that make it worth telling.
_FLOOR = 1e-6
_WORST = 0.1
# Condition number of a band's columns above which its reference tells response from transient no
# more.
_DEPENDENT = 1e4


def local_polynomial_response(reference, sensor, sampling_rate_hz, transient=True):
    r"""Response in bands side by side, each with its uncertainty.

    In each band of the spectra of the whole record,

    .. math:: Y(k) = G(k) X(k) + T(k) + V(k)

    with quadratic polynomials for the response G and the transient T (leakage: what is left of the
    motion before the record, and what comes out after it), by least squares; G in the middle of
    the band is the point. The variance of the noise V is that of the residual, which is the same
    as that from the local coherence of reference and sensor (R. Pintelon, J. Schoukens, *System
    Identification*, 2nd ed., 2012, section 7.2). Bands do not overlap, so the points are
    independent.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
        Without gaps.
    sampling_rate_hz : float
    transient : bool
        False for motion that begins and ends at rest within the record.

    Returns
    -------
    frequency_hz : ndarray, shape (m,)
    response : ndarray of complex, shape (m,)
    std : ndarray, shape (m,)
        Relative standard uncertainty of the amplitude, and that of the phase [rad].
    """
    n = len(reference)
    x, y = rfft(reference - reference.mean()), rfft(sensor - sensor.mean())
    delay = bulk_delay(reference, sensor)
    turn = np.exp(2j * np.pi * np.arange(len(x)) * delay / n)
    y = y * turn
    unknowns = (_ORDER + 1) * (2 if transient else 1)
    edges = _bands(len(x), unknowns + _SPARE)
    response, variance, factor, power = np.array(
        [_band(x[first:last], y[first:last], unknowns) for first, last in edges]).T
    middle = np.array([(first + last - 1) / 2 for first, last in edges])
    # noise is smooth over frequency: neighbours make its variance surer
    pooled = np.abs(uniform_filter1d(variance.real, _NEIGHBOURS, mode="nearest"))
    std = np.sqrt(pooled * factor.real / 2)
    power = power.real
    frequency = middle * sampling_rate_hz / n
    std = std / np.maximum(np.abs(response), 1e-300)
    good = (power > _FLOOR * power.max()) & (power > 0) & (std < _WORST)
    shift = np.exp(-2j * np.pi * frequency * delay / sampling_rate_hz)
    return frequency[good], (response * shift)[good], std[good]


def _bands(count, fewest):
    """First and last (exclusive) bin of each band, from just above zero frequency."""
    edges, first = [], 1
    while first + fewest <= count:
        last = min(first + max(fewest, int(_WIDTH * first)), count)
        edges.append((first, last))
        first = last
    return edges


def _band(x, y, unknowns):
    """Response in the middle, variance of the noise, that of the response over it, and power."""
    place = np.linspace(-1, 1, len(x))
    powers = place[:, None] ** np.arange(_ORDER + 1)
    level = np.sqrt(np.mean(np.abs(x)**2))
    if level == 0:
        return 0.0, 0.0, 0.0, 0.0
    columns = x[:, None] / level * powers
    if unknowns > _ORDER + 1:
        columns = np.concatenate([columns, powers], axis=1)
    gram = np.conj(columns.T) @ columns
    # squared condition numbers up to 1e8 leave the normal equations half of their digits
    values = np.linalg.eigvalsh(gram)
    if values[0] * _DEPENDENT**2 < values[-1]:
        return 0.0, 0.0, 0.0, 0.0
    inverse = np.linalg.inv(gram)
    found = inverse @ (np.conj(columns.T) @ y)
    residual = y - columns @ found
    variance = np.sum(np.abs(residual)**2) / (len(x) - unknowns)
    return found[0] / level, variance, inverse[0, 0].real / level**2, level**2
