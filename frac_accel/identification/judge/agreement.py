"""Whether time domain and frequency domain find the same parameters."""

import numpy as np

# Combined standard uncertainties beyond which two values are no longer the same.
_DISAGREE = 3.0


def compare_domains(fit, other):
    """Parameters from the points of the frequency response, beside those of the time domain.

    Parameters
    ----------
    fit : Fit
        In the time domain.
    other : ResponseFit
        Of the same structure in the frequency domain.

    Returns
    -------
    dict
        ``parameters``: ``value`` and ``std`` by name; ``reduced_chi_squared`` of the points;
        ``largest_difference``: ``parameter`` and ``combined_std``, its difference over the root of
        the sum of both variances; ``agrees``; ``words``. Both fits have the same data, so the
        difference is rather smaller than independent ones would give.
    """
    std = dict(zip(fit.names, fit.std))
    differences = {name: abs(other[name] - fit[name]) / np.hypot(own, std[name])
                   for name, own in zip(other.names, other.std)}
    worst = max(differences, key=differences.get)
    place = other.names.index(worst)
    agrees = bool(differences[worst] <= _DISAGREE)
    values = (f"{worst} {fit[worst]:.6g} ± {std[worst]:.2g} in the time domain, "
              f"{other[worst]:.6g} ± {other.std[place]:.2g} in the frequency domain, "
              f"{differences[worst]:.1f} combined standard uncertainties apart")
    return {
        "parameters": {name: {"value": float(value), "std": float(spread)}
                       for name, value, spread in zip(other.names, other.values, other.std)},
        "reduced_chi_squared": other.reduced_chi_squared,
        "largest_difference": {"parameter": worst, "combined_std": float(differences[worst])},
        "agrees": agrees,
        "words": ("time and frequency domain agree: at most " if agrees
                  else "time and frequency domain disagree: ") + values}
