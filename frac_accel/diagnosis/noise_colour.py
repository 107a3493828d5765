"""Fits compared in noise of any colour."""

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

# Share of a spectrum's lines over which it is smoothed, and how many lines at least.
_SMOOTH, _LINES = 1 / 64, 5


def noise_peak(residual):
    """Largest density of a residual's smoothed spectrum, over its mean: 1 for white noise."""
    density = _density(residual)
    return float(max(density.max() / density.mean(), 1.0))


def lead(ahead, behind, used):
    """Variances of the noise by which one fit is ahead of another; below zero, behind it.

    What the better of both leaves at a frequency is the noise there: white noise as loud as the
    loudest of it would hide what is quiet. Each takes one step to the parameters that are best in
    that noise (generalised least squares), as least squares are drawn by where it is loud.

    Parameters
    ----------
    ahead, behind : Fitted
    used : ndarray of bool, shape (n,)

    Returns
    -------
    float or None
        Twice what the half of the record shows that shows less of it; None where the halves
        disagree: what happens once, as where a record starts, is all that is seen where little is
        left otherwise.
    """
    moving = np.cumsum(np.square(ahead.simulated - ahead.simulated.mean()) * used)
    first = moving < moving[-1] / 2
    halves = [_lead(ahead, behind, used & rows) for rows in (first, ~first)]
    return 2 * min(halves, key=abs) if halves[0] * halves[1] > 0 else None


def _lead(ahead, behind, rows):
    noise = np.minimum(*(_density(fit.residual * rows) for fit in (ahead, behind)))
    return _in_noise(behind, rows, noise) - _in_noise(ahead, rows, noise)


def _density(values):
    power = np.abs(_spectrum(values))**2
    return uniform_filter1d(power, max(_LINES, int(len(power) * _SMOOTH)), mode="reflect")


def _spectrum(values):
    """Spectrum of values that nothing follows, of a length that is transformed fast."""
    return rfft(values, next_fast_len(len(values), real=True))


def _in_noise(fit, used, noise):
    """Power of what a fit leaves over that of the noise, summed over samples."""
    def whitened(values):
        lines = _spectrum(values * used) / np.sqrt(noise)
        return np.concatenate([lines.real, lines.imag])
    residual = whitened(fit.residual)
    if fit.unknowns:
        slopes = np.column_stack([whitened(slope) for slope in fit.jacobian.T])
        residual = residual - slopes @ np.linalg.lstsq(slopes, residual, rcond=None)[0]
    return np.count_nonzero(used) / len(noise) * float(residual @ residual)
