"""Parameters that a record leaves open, and what would determine them."""

import numpy as np

# Correlation of a parameter with a combination of the others, and relative standard uncertainty,
# from which on it is open.
_TOGETHER = 0.99
_LOOSE = 0.05
_KNOWN = 0.2


def open_combinations(fit, band_hz, sampling_rate_hz):
    """Notes on parameters of which the data determine only combinations.

    Parameters
    ----------
    fit : Fit
        Of a seismic sensor.
    band_hz : tuple of float
        Band that is excited.
    sampling_rate_hz : float

    Returns
    -------
    list of str
    """
    names = [name for name in fit.names if name != "offset"]
    places = [fit.names.index(name) for name in names]
    covariance = fit.covariance[np.ix_(places, places)]
    std = np.sqrt(np.diag(covariance))
    if not np.all(std > 0) or not np.all(np.isfinite(std)):
        return []
    strength, direction = np.linalg.eigh(covariance / np.outer(std, std))
    # the diagonal of the inverse: 1 / (1 - R^2) of each parameter on all others
    inflation = np.sum(direction**2 / np.maximum(strength, 1e-12), axis=1)
    together = [name for name, factor in zip(names, inflation)
                if factor > 1 / (1 - _TOGETHER**2)]
    loose = [name for name in together if name != "delay_s"
             and fit.std[fit.names.index(name)] > _LOOSE * abs(fit[name])]
    if len(together) < 2 or not loose or "natural_frequency_hz" not in names:
        return []
    words = ", ".join(together[:-1]) + " and " + together[-1]
    wanted = _what_to_excite(fit, band_hz, sampling_rate_hz)
    return [f"{words} are only determined together; {wanted} would tell them apart"]


def _what_to_excite(fit, band_hz, rate):
    low, high = band_hz
    resonance, highest = fit["natural_frequency_hz"], 0.4 * rate
    std = fit.std[fit.names.index("natural_frequency_hz")]
    known = std < _KNOWN * resonance and resonance < highest
    if high < (1.2 * resonance if known else highest):
        upper = min(2 * resonance, highest) if known else highest
        return f"excitation from {high:.3g} up to {upper:.3g} Hz"
    if low > resonance / 3:
        return f"excitation below {resonance / 3:.3g} Hz"
    return f"more excitation from {resonance / 2:.3g} to {min(2 * resonance, highest):.3g} Hz"
