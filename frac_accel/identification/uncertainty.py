"""Uncertainty of least-squares parameters when the residual is not white."""

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

# Padding of the spectra, in roots of the record.
_REACH = 12


def sandwich(jacobian, residual, used):
    r"""Covariance :math:`(J^T J)^{-1} J^T \Gamma J (J^T J)^{-1}`.

    The residual's autocovariance :math:`\Gamma` comes from its smoothed spectrum (L. Ljung, *System
    Identification*, 2nd ed., equation (9.42)).

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
    residual : ndarray, shape (m,)
    used : ndarray of bool, shape (n,)
        Where the m rows stand in the record.

    Returns
    -------
    ndarray, shape (p, p)
        Huge, not small, for what the data leave open.
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scaled = (jacobian / scale).T
    full = np.zeros((len(scaled) + 1, len(used)))
    full[:-1, used] = scaled
    full[-1, used] = residual
    # the smoothed spectrum reaches over lags of a few times the root of the record
    length = next_fast_len(len(used) + int(_REACH * np.sqrt(len(used))), real=True)
    spectra = rfft(full, length, axis=1)
    power = (spectra[-1].real**2 + spectra[-1].imag**2) / len(residual)
    width = max(5, int(len(power) / np.sqrt(len(used))))
    smooth = uniform_filter1d(power, width, mode="reflect")
    twice = np.full(len(power), 2.0)
    twice[0] = 1.0
    if length % 2 == 0:
        twice[-1] = 1.0
    weighted = (spectra[:-1] * np.sqrt(twice * smooth)).view(float)
    meat = weighted @ weighted.T / length
    values, vectors = np.linalg.eigh(scaled @ scaled.T)
    bread = (vectors / np.maximum(values, 1e-14 * values[-1])) @ vectors.T
    # as a square, so that rounding makes no variance negative
    strengths, directions = np.linalg.eigh(meat)
    root = bread @ (directions * np.sqrt(np.maximum(strengths, 0))) / scale[:, None]
    freedom = len(residual) / max(len(residual) - len(scaled), 1)
    return freedom * root @ root.T


def white_noise(residual):
    """White part of the residual: what is left above half the Nyquist frequency, spread evenly.

    Below, the residual also holds what the model gets wrong, which is not noise.
    """
    clean = np.nan_to_num(residual)
    taper = np.hanning(len(clean))
    power = np.abs(rfft(clean * taper))**2
    window = taper @ taper
    # the median of a chi-squared of two degrees is ln 2 of its mean
    return float(np.sqrt(np.median(power[len(power) // 2:]) / np.log(2) / window))
