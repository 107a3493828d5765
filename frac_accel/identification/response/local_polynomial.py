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
    edges = _edges(len(x), unknowns + _SPARE)
    middle = edges.sum(axis=1) / 2 - 0.5
    response, variance, factor, power = np.empty((4, len(edges)), complex)
    widths = np.diff(edges)[:, 0]
    for width in np.unique(widths):
        alike = np.flatnonzero(widths == width)
        place = edges[alike, :1] + np.arange(width)
        response[alike], variance[alike], factor[alike], power[alike] = \
            _bands(x[place], y[place], unknowns)
    # noise is smooth over frequency: neighbours make its variance surer
    pooled = np.abs(uniform_filter1d(variance.real, _NEIGHBOURS, mode="nearest"))
    std = np.sqrt(pooled * factor.real / 2)
    power = power.real
    frequency = middle * sampling_rate_hz / n
    std = std / np.maximum(np.abs(response), 1e-300)
    good = (power > _FLOOR * power.max()) & (power > 0) & (std < _WORST)
    shift = np.exp(-2j * np.pi * frequency * delay / sampling_rate_hz)
    return frequency[good], (response * shift)[good], std[good]


def _edges(count, fewest):
    """First and last (exclusive) bin of each band, from just above zero frequency, shape (m, 2)."""
    edges, first = [], 1
    while first + fewest <= count:
        width = max(fewest, int(_WIDTH * first))
        # three leading binary digits: bands of few different widths are worked on together
        width &= -1 << max(width.bit_length() - 3, 0)
        last = min(first + max(fewest, width), count)
        edges.append((first, last))
        first = last
    return np.array(edges, int).reshape(-1, 2)


def _bands(x, y, unknowns):
    """Of bands, shape (m, bins): response in the middle, variance of the noise, that of the
    response over it, and power.
    """
    place = np.linspace(-1, 1, x.shape[1])
    powers = (place[:, None] ** np.arange(_ORDER + 1)).astype(complex)
    level = np.sqrt(np.mean(np.abs(x)**2, axis=1))
    scale = np.where(level > 0, level, 1.0)
    columns = (x / scale[:, None])[:, :, None] * powers
    if unknowns > _ORDER + 1:
        columns = np.concatenate([columns, np.broadcast_to(powers, columns.shape)], axis=2)
    across = np.conj(columns.transpose(0, 2, 1))
    gram = across @ columns
    gram[level == 0] = np.eye(unknowns)
    # enough to invert what is singular, too little to change what is not
    gram += 1e-14 * x.shape[1] * np.eye(unknowns)
    inverse = np.linalg.inv(gram)
    # squared condition numbers up to 1e8 leave the normal equations half of their digits
    condition = np.linalg.norm(gram, axis=(1, 2)) * np.linalg.norm(inverse, axis=(1, 2))
    known = (condition <= _DEPENDENT**2) & (level > 0)
    found = inverse @ (across @ y[:, :, None])
    residual = y - (columns @ found)[:, :, 0]
    variance = np.sum(np.abs(residual)**2, axis=1) / (x.shape[1] - unknowns)
    return [np.where(known, values, 0.0) for values in
            (found[:, 0, 0] / scale, variance, inverse[:, 0, 0].real / scale**2, level**2)]
