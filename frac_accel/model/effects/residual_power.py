"""How the power of a residual depends on something, for causes that show in nothing else."""

import numpy as np

_PASSES = 8
# Errors larger than this many standard deviations count as that large.
_OUTLIER = 5.0
# Classes in which a law must hold, and how far the mean power of any may be from it: a share, and
# standard errors.
_CLASSES, _WITHIN, _ERRORS = 8, 0.2, 4.0


def variance_law(error, square):
    """Error variance as a + b times a square: (a, b, standard uncertainty of b).

    Least squares on the error's squares with the weights of normal errors (variance 2 v**2),
    iterated: R. J. Carroll, D. Ruppert, *Transformation and Weighting in Regression* (1988), ch. 3.

    Parameters
    ----------
    error, square : ndarray, shape (n,)
    """
    power = np.mean(error**2)
    scale = max(square.mean(), 1e-300)
    columns = np.stack([np.ones(len(error)), square / scale], axis=1)
    law = np.array([power, 0.0])
    for _ in range(_PASSES):
        variance = np.maximum(columns @ law, 1e-3 * power)
        target = np.minimum(error**2, _OUTLIER**2 * variance)
        weighted = columns / variance[:, None]**2
        gram = columns.T @ weighted
        law = np.maximum(np.linalg.solve(gram + 1e-12 * np.diag(np.diag(gram)),
                                         weighted.T @ target), [1e-6 * power, 0.0])
    std = np.sqrt(2 * np.linalg.inv(gram)[1, 1])
    return law[0], law[1] / scale, std / scale


def likelihood(error, variance):
    """Logarithm of the likelihood of normal errors with these variances, up to a constant."""
    squares = np.minimum(error**2 / variance, _OUTLIER**2)
    return float(-0.5 * np.sum(squares + np.log(variance)))


def law_likelihood(error, square):
    """The same with the variance that follows a square best, as a + b times it."""
    noise, factor, _ = variance_law(error, square)
    return likelihood(error, noise + factor * square)


def follows(error, variance, measure):
    """Whether a law of the variance holds in all classes of a measure, as many samples in each.

    Parameters
    ----------
    error, variance, measure : ndarray, shape (n,)
    """
    ratios = np.minimum(error**2 / variance, _OUTLIER**2)
    for rows in np.array_split(np.argsort(measure), _CLASSES):
        off = abs(ratios[rows].mean() - 1)
        if off > _WITHIN and off > _ERRORS * ratios[rows].std() / np.sqrt(len(rows)):
            return False
    return True


def slope_of(values):
    """Derivative by the sample's number, shape (n,).

    Central differences of fourth order on four times as many points: 0.5 % too small at 0.8 of the
    Nyquist frequency.
    """
    from scipy.signal import resample_poly
    fine = np.pad(resample_poly(values, 4, 1), 2, mode="edge")
    return (8 * (fine[3:-1] - fine[1:-3]) - (fine[4:] - fine[:-4]))[::4] / 3
